"""python -m tests.hil.prepare FOLDER: what tests/hil/vcan.sh plays, made where it takes less time."""

import random
import shutil
import sys
from pathlib import Path

from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.mapped import MappedTrain, Train
from sim_ecu.play.play import play_to_log
from sim_ecu.play.scenario import read_scenario
from sim_ecu.play.train import PACKAGED
from tests.support.can_ids import ADHESION_A1
from tests.support.processes import ROOT
from tests.support.scenarios import FOUR_AXLES, SIX_AXLES, held
from wrcd.bus.candump import format_line
from wrcd.bus.e2e import crc
from wrcd.bus.frame import Frame
from wrcd.config.config import DEFAULT, load_config
from wrcd.config.settings import parse_toml
from wrcd.core.core import Core
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

VALID = 1
RIDE_ENDS_S = (3.0, 5.0, 7.0, 9.0)  # of the parts of a ride
FAULTS = "".join(
    f'[[fault]]\nkind = "{kind}"\nat_s = {at_s}\nduration_s = 0.5\n{more}'
    for kind, at_s, more in (
        ("error-flood", 2.5, ""), ("babble", 3.5, "amount = 500\n"), ("counter", 4.5, 'of = "all"\naxle = 1\n'),
    )
)  # fmt: skip
FD = (
    'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","StandardCAN_FD","ExtendedCAN_FD";\n'
    'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";\nBA_ "VFrameFormat" BO_ 513 3;\n'
)
RECORDER = '[recorder]\nfolder = "."\n'


def play(path: Path, text: str, truth: bool = False, train: Train = PACKAGED) -> list[Frame]:
    """Play a scenario into a log that canplayer reads: it takes no direction."""
    play_to_log(read_scenario(parse_toml(text, path.name), path.name), path, truth, train)
    path.write_text(path.read_text().replace(" R\n", "\n"))
    return [f for f, _ in read_log(path, Damage())]


def write(path: Path, frames: list[Frame]) -> None:
    path.write_text("".join(format_line(f, "can0") + "\n" for f in frames))


def garbage() -> list[Frame]:
    """Any id, length and bytes, but for what its CRC says is a frame of wrcd's world."""
    chance, made = random.Random(1), list[Frame]()
    while len(made) < 4000:
        f = Frame(1_700_000_000_000_000 + len(made), chance.randrange(0x800), chance.randbytes(chance.randrange(9)))
        if not f.data or crc(f.data, f.can_id) != f.data[0]:
            made.append(f)
    return made


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    # no more frames than the daemon's socket holds, should the guest not let it run at all: 10 900
    play(folder / "four.log", FOUR_AXLES.replace("duration_s = 6", "duration_s = 5"))
    dry = play(folder / "dry.log", held("A", 4.0, 0.5), truth=True)
    six = SIX_AXLES.replace("= 6.0", "= 3.5").replace("[1.0, 1.0]", "[1.0, 0.5]")  # not too still to be Valid
    play(folder / "six.log", six)
    play(folder / "faults.log", held("A", 8.0, 0.5) + FAULTS)
    play(folder / "busoff.log", held("A", 30.0, 0.5))
    ride = play(folder / "ride.log", held("A", RIDE_ENDS_S[-1], 0.5))
    begin_s = 0.0
    for number, end_s in enumerate(RIDE_ENDS_S, 1):
        since_us, until_us = (ride[0].stamp_us + round(s * 1e6) for s in (begin_s, end_s))
        write(folder / f"ride{number}.log", [f for f in ride if since_us <= f.stamp_us < until_us])
        begin_s = end_s
    write(folder / "few.log", [f for f in dry if f.can_id == 0x101][:20])
    write(folder / "errors.log", [Frame(dry[0].stamp_us + 1000 * k, 0x80, bytes(8), error=True) for k in range(3000)])
    core = Core(load_config(None))
    said = [o.frame for f in dry for o in core.feed(f) if o.frame.can_id == ADHESION_A1]
    write(folder / "foreign.log", [f for f in said if f.data[1] >> 4 == VALID][-60:])
    write(folder / "garbage.log", garbage())
    (folder / "recorded.toml").write_text(DEFAULT + RECORDER)
    shutil.copy(ROOT / "examples/six-axles.toml", folder / "six.toml")
    shutil.copy(ROOT / "tests/hil/peer.py", folder)
    own = ROOT / "examples/own-dbc"
    (folder / "train.dbc").write_text((own / "train.dbc").read_text() + FD)
    config = folder / "fd.toml"
    config.write_text(
        (own / "train.toml").read_text().replace('"can0" }', '"can0", timestamps = "hardware" }') + RECORDER
    )
    play(folder / "fd.log", held("A", 4.0, 0.5), train=MappedTrain(load_config(config), Wheelset()))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
