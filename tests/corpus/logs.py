"""A recipe becomes a log; the log, by `wrcd replay`, digests: of itself, each message sent, the events, the rows."""

import contextlib
import hashlib
import io
import shutil
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim_ecu.play.mapped import MappedTrain, Train
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.play.scenario import read_scenario
from sim_ecu.play.train import PACKAGED
from tests.corpus.recipes import SIGNED, Recipe
from tests.support.can_ids import VEHICLE_SPEED, WRCD_STATUS
from wrcd.bus.candump import format_line, parse_line
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.config.settings import parse_toml
from wrcd.core.configuration import Config

ROOT = Path(__file__).parents[2]
START_US = 1_700_000_000_000_000
PACKAGED_DBC = ROOT / "dbc/wrcd.dbc"
SIGNED_SPEED = ("SG_ Speed : 16|16@1+ (0.0025,0) [0|163.8375]", "SG_ Speed : 16|16@1- (0.0025,0) [-81|81]")
WAY_ID, REVERSE = 0x214, 1 << 6  # of tests/data/dbc/odd.dbc
USED = 0x3F  # of WrcdStatus' second byte: the digests are of a time when the upper bits said more


def digests_of(recipe: Recipe) -> dict[str, str]:
    """Make a log and its digests in a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        return digests(recipe, Path(folder))


def digests(recipe: Recipe, folder: Path) -> dict[str, str]:
    """By what it is of: "log", the ids of messages in hexadecimal, "events", "rows" (of the CSV), "exit"."""
    config, log = write(recipe, folder)
    names = {"frames": folder / "made.log", "rows": folder / "rows.csv", "events": folder / "events.csv"}
    with contextlib.redirect_stderr(io.StringIO()):
        status = main([
            "replay", str(log), "--config", str(config), "-o", str(names["frames"]), "--csv", str(names["rows"]),
            "--events", str(names["events"]),
        ])  # fmt: skip
    made: dict[str, list[str]] = defaultdict(list)
    for line in names["frames"].read_bytes().splitlines() if names["frames"].exists() else ():
        parsed = parse_line(line)
        assert parsed is not None
        f, data = parsed[0], parsed[0].data
        if f.can_id == WRCD_STATUS and not f.extended:
            data = bytes([0, data[1] & USED, *data[2:]])
        made[f"{f.can_id:08X}" if f.extended else f"{f.can_id:03X}"].append(f"{f.stamp_us} {data.hex()}")
    read = {name: names[name].read_text() if names[name].exists() else "" for name in ("events", "rows")}
    return {
        "log": _digest(log.read_text() + config.read_text()), "exit": str(int(status)),
        **{name: _digest(text) for name, text in read.items()},
        **{name: _digest("\n".join(lines)) for name, lines in sorted(made.items())},
    }  # fmt: skip


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:10]


def write(recipe: Recipe, folder: Path) -> tuple[Path, Path]:
    """The configuration's file, and the log."""
    own = recipe.config.endswith(".toml")
    path = ROOT / recipe.config if own else folder / "train.toml"
    if not own:
        path.write_text(recipe.config)
        (folder / SIGNED).write_text(PACKAGED_DBC.read_text().replace(*SIGNED_SPEED))
    config = load_config(path)
    scenario = read_scenario(parse_toml(recipe.scenario, recipe.name), recipe.name)
    train: Train = MappedTrain(config, scenario.wheelset) if own else PACKAGED
    frames: Iterator[Frame] = (
        Frame(START_US + f.due_us, f.can_id, f.data, f.extended, fd=f.fd, error=f.error)
        for _, sent in Player(scenario, truth=False, chunk=LARGE_CHUNK, train=train)
        for f in sent
    )
    if recipe.reverse_from_s is not None:
        frames = reversed_from(frames, START_US + round(recipe.reverse_from_s * 1e6))
    if recipe.spoilt is not None:
        frames = spoilt(frames, config, np.random.default_rng([recipe.spoilt, 5]))
    log = folder / "played.log"
    log.write_text("".join(format_line(f, "can0") + "\n" for f in frames))
    return misheard(path, *recipe.misheard, folder) if recipe.misheard else path, log


def misheard(path: Path, old: str, new: str, folder: Path) -> Path:
    """A changed copy of a configuration, beside copies of its DBCs."""
    text = path.read_text()
    assert old in text, (path, old)
    for dbc in path.parent.glob("*.dbc"):
        shutil.copy(dbc, folder)
    changed = folder / "changed.toml"
    changed.write_text(text.replace(old, new))
    return changed


def reversed_from(frames: Iterator[Frame], since_us: int) -> Iterator[Frame]:
    """The direction says reverse from a time on; where none is mapped, the speed is below zero."""
    for f in frames:
        if f.can_id == WAY_ID and f.stamp_us >= since_us:
            yield replace(f, data=bytes([*f.data[:2], f.data[2] & 0x3F | REVERSE, *f.data[3:]]))
        elif f.can_id == VEHICLE_SPEED and f.stamp_us >= since_us:
            raw = int.from_bytes(f.data[2:4], "little")
            data = f.data[:2] + (-raw).to_bytes(2, "little", signed=True)
            yield replace(f, data=protect(data, f.can_id, f.data[1] & 0x0F))
        else:
            yield f


def spoilt(frames: Iterator[Frame], config: Config, chance: np.random.Generator) -> Iterator[Frame]:
    """The frames with what happens on a bus: damage, repeats, losses, jitter, foreign and odd frames, stuck sensors,
    values that jump or stand at an end, senders that call themselves degraded, silences and steps of the clock."""
    identities = {(m.frame_id, m.is_extended_frame): config.data_ids.get(m.name) for m in config.database.messages}
    moved_us, silent_until_us, rare = 0, 0, 1.5e-4 / len(config.axles)
    stuck: dict[int, tuple[bytes, int]] = {}
    quiet: dict[int, int] = {}
    for f in frames:
        happens, what = chance.random(4), chance.random()
        if happens[0] < rare:
            moved_us += int(chance.choice([-30_000, -8_000, 700_000, 1_500_000, -5_000_000, 3_600_000_000]))
        if happens[1] < rare:
            silent_until_us = f.stamp_us + int(chance.choice([12_000, 60_000, 300_000, 1_400_000]))
        if happens[2] < 3e-4:
            quiet[f.can_id] = f.stamp_us + int(chance.choice([8_000, 17_000, 50_000, 400_000]))
        if happens[3] < 3e-4:
            stuck[f.can_id] = f.data, f.stamp_us + int(chance.choice([20_000, 40_000, 200_000, 2_500_000]))
        if f.stamp_us < max(silent_until_us, quiet.get(f.can_id, 0)):
            continue
        jitter_us = int(chance.integers(-1500, 1500)) if chance.random() < 0.05 else 0
        if f.error:
            yield replace(f, stamp_us=f.stamp_us + moved_us)
            continue
        held, until_us = stuck.get(f.can_id, (f.data, 0))
        identity = identities.get((f.can_id, f.extended))
        data = _payload(f.data, held if f.stamp_us < until_us else f.data, what, identity, chance)
        frame = replace(f, stamp_us=f.stamp_us + moved_us + jitter_us, data=data)
        yield frame
        yield from _beside(frame, what, chance)


def _payload(sent: bytes, held: bytes, what: float, identity: int | None, chance: np.random.Generator) -> bytes:
    """A frame's data with damage, protected again where it is protected, or not."""
    data, counter = bytearray(held), sent[1] & 0x0F if len(sent) > 1 else 0
    first = 0 if identity is None else 2  # CRC and counter are the protection's
    if what < 1e-3:
        data[first:] = chance.integers(0, 256, len(data) - first, dtype=np.uint8).tobytes()
    elif what < 2e-3:
        data[first:] = b"\xff\xff\x7f\x00"[chance.integers(4) :][:1] * (len(data) - first)
    elif what < 2.5e-3:
        data[min(first, 1) or -1] ^= 0x10
    elif what < 3e-3:
        counter = (counter + int(chance.integers(1, 14))) % 15
    if identity is None:
        return bytes(data)
    out = protect(bytes(data), identity, counter)
    return bytes([out[0] ^ 1, *out[1:]]) if 3e-3 < what < 4e-3 else out


def _beside(frame: Frame, what: float, chance: np.random.Generator) -> Iterator[Frame]:
    """What else comes with a frame."""
    if what > 0.999:
        yield replace(frame, stamp_us=frame.stamp_us + 50)
    elif what > 0.998:
        yield replace(frame, can_id=int(chance.integers(0, 0x7FF)), extended=False)
    elif what > 0.9975:
        yield Frame(frame.stamp_us, frame.can_id, b"", frame.extended, remote=True)
    elif what > 0.997:
        yield Frame(frame.stamp_us, 0x20, bytes(8), error=True)
    elif what > 0.9965:
        yield replace(frame, data=frame.data[:-1])
