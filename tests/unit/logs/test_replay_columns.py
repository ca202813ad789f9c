"""A log read by columns gives what it gives frame by frame: frames, counts, damage, whatever is wrong with it."""

import gzip
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from wrcd.bus.candump import parse_line
from wrcd.config.config import load_config
from wrcd.core.core import Core
from wrcd.logs.columns import Stretch, parse_lines
from wrcd.logs.damage import Damage
from wrcd.logs.feed import made, made_of_stretches, outgoing
from wrcd.logs.reader import read_log, read_stretches

GOLDEN = Path(__file__).parents[2] / "golden" / "leaf-film.log"
LINES = GOLDEN.read_bytes().splitlines(keepends=True)
Lines = list[bytes]


def counted(core: Core) -> dict[str, Any]:
    """All that a core counts."""
    c = core.counts
    names = ("accepted", "late", "time_steps", "restarts", "waits", "ticks", "last_reason", "rejected_by_message")
    return {name: getattr(c, name) for name in (*names, "rejected", "clipped", "seen")}


def by_columns(log: Path) -> tuple[list[str], dict[str, Any], Damage]:
    core, damage = Core(load_config(None)), Damage()
    out = [f"{o.frame} {o.cause.name} {c}" for o, c in outgoing(made_of_stretches(core, read_stretches(log, damage)))]
    out += [c.csv_line for c in core.events.since(0)]
    return out, counted(core), damage


def by_frames(log: Path) -> tuple[list[str], dict[str, Any], Damage]:
    core, damage = Core(load_config(None)), Damage()
    out = [f"{o.frame} {o.cause.name} {c}" for o, c in outgoing(made(core, read_log(log, damage)))]
    out += [c.csv_line for c in core.events.since(0)]
    return out, counted(core), damage


def flipped(rng: random.Random, lines: Lines) -> Lines:
    """Some bits of the data flip."""
    out = []
    for line in lines:
        if rng.random() < 0.003:
            at = line.index(b"#") + 1 + rng.randrange(4)
            line = line[:at] + f"{rng.randrange(16):X}".encode() + line[at + 1 :]
        out.append(line)
    return out


def lost_and_doubled(rng: random.Random, lines: Lines) -> Lines:
    return [line for line in lines for _ in range(rng.choices((0, 1, 2), (1, 200, 1))[0])]


def damaged(rng: random.Random, lines: Lines) -> Lines:
    """Lines cut, empty, of other kinds, and the last without its end."""
    out = []
    for line in lines:
        kind = rng.random()
        if kind < 0.002:
            out.append(line[: rng.randrange(len(line))] + b"\n")
        elif kind < 0.004:
            out.append(b"\n")
        elif kind < 0.006:
            out.append(
                line[:20] + rng.choice([b"can0 20000040#0000000000000000\n", b"can0 101#R8\n", b"can0 101##0AB\n"])
            )
        elif kind < 0.008:
            out.append(line.replace(b" R\n", b"\n").lower() if rng.random() < 0.5 else line.replace(b" ", b"  ", 1))
        out.append(line)
    out[-1] = out[-1][:-9]
    return out


def another_channel(rng: random.Random, lines: Lines) -> Lines:
    return [line.replace(b"can0", b"vcan1") if rng.random() < 0.01 else line for line in lines]


def with_gaps_and_steps(rng: random.Random, lines: Lines) -> Lines:
    """Silences of up to three seconds, steps of time forth and back."""
    out, shift_us = [], 0
    for line in lines:
        if rng.random() < 0.001:
            shift_us += rng.choice((300_000, 700_000, 1_200_000, 3_000_000, 120_000_000, -5_000_000, -4_000))
        stamp_us = int(line[1:11]) * 1_000_000 + int(line[12:18]) + shift_us
        out.append(f"({stamp_us // 1_000_000:010d}.{stamp_us % 1_000_000:06d})".encode() + line[19:])
    return out


def as_they_are(_: random.Random, lines: Lines) -> Lines:
    return lines


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    "change", [as_they_are, flipped, lost_and_doubled, damaged, another_channel, with_gaps_and_steps],
    ids=lambda f: f.__name__,
)  # fmt: skip
def test_log_by_columns_gives_what_it_gives_frame_by_frame(
    change: Callable[[random.Random, Lines], Lines], seed: int, tmp_path: Path
) -> None:
    log = tmp_path / "a.log"
    log.write_bytes(b"".join(change(random.Random(seed), LINES)))
    found, expected = by_columns(log), by_frames(log)
    assert len(expected[0]) > 500
    assert found == expected


def test_compressed_log_by_columns_gives_what_it_gives_frame_by_frame(tmp_path: Path) -> None:
    log = tmp_path / "a.log.gz"
    with gzip.open(log, "wb") as f:
        f.write(b"".join(LINES[:5000]))
    assert by_columns(log) == by_frames(log)


@pytest.mark.parametrize("lines", [500, 6_500])  # more than is read at once
@pytest.mark.parametrize("share", [0.03, 0.5, 0.9, 0.999])
def test_truncated_compressed_log_loses_nothing_that_can_be_read(share: float, lines: int, tmp_path: Path) -> None:
    log = tmp_path / "a.log.gz"
    whole = gzip.compress(b"".join((LINES * 5)[:lines]))
    log.write_bytes(whole[: int(share * len(whole))])
    found, expected = by_columns(log), by_frames(log)
    assert expected[2].read > 0.7 * share * lines - 400
    assert found == expected


@pytest.mark.parametrize("change", [b"\r\r\n", b"\r\n"])
@pytest.mark.parametrize("lines", [20, 6100])
def test_line_ends_of_other_systems_are_read_alike(change: bytes, lines: int, tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    log.write_bytes(b"".join((LINES * 5)[:lines]).replace(b"\n", change))
    assert by_columns(log) == by_frames(log)


def test_stamps_of_nanoseconds_are_read_by_columns_and_truncated(tmp_path: Path) -> None:
    log, plain = tmp_path / "a.log", tmp_path / "b.log"
    log.write_bytes(b"".join(line[:18] + b"%03d" % (k % 1000) + line[18:] for k, line in enumerate(LINES[:6100])))
    plain.write_bytes(b"".join(LINES[:6100]))
    assert by_columns(log) == by_frames(log) == by_columns(plain)
    parsed = parse_lines(log.read_bytes())
    assert parsed is not None
    assert parsed[1].all()


@pytest.mark.parametrize("channel", [b"", b"c\tn"])
def test_line_without_a_channel_is_no_frame(channel: bytes, tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    log.write_bytes(LINES[0] + b"".join(LINES[1:200]).replace(b"can0", channel))
    found, expected = by_columns(log), by_frames(log)
    assert expected[2].read == 1
    assert found == expected


def test_frames_after_one_of_another_clock_are_late_alike(tmp_path: Path) -> None:
    """A frame that nobody maps is stamped more than a second ahead: it drives the clock, and what comes is late."""
    half = len(LINES) // 2
    ahead = LINES[half]
    stamp_us = int(ahead[1:11]) * 1_000_000 + int(ahead[12:18]) + 1_300_000
    other = f"({stamp_us // 1_000_000:010d}.{stamp_us % 1_000_000:06d}) can1 7FF#00\n".encode()
    log = tmp_path / "a.log"
    log.write_bytes(b"".join((*LINES[:half], other, *LINES[half:])))
    found, expected = by_columns(log), by_frames(log)
    assert found == expected
    assert expected[1]["late"] > 0


def test_most_frames_of_a_clean_log_are_read_by_columns() -> None:
    parsed = parse_lines(b"".join(LINES))
    assert parsed is not None
    whole, regular, _, _ = parsed
    assert regular.all()
    assert len(whole) == len(LINES)
    stretches = [item for item in read_stretches(GOLDEN, Damage()) if isinstance(item, Stretch)]
    assert sum(map(len, stretches)) > 0.95 * len(LINES)
    assert len(stretches) < len(LINES) / 100


def test_regular_lines_are_parsed_as_one_by_one() -> None:
    rng = random.Random(3)
    lines = []
    for _ in range(300):
        data = rng.randbytes(rng.randrange(9)).hex()
        number = f"{rng.randrange(0x800):03X}" if rng.random() < 0.5 else f"{rng.randrange(0x20000000):08x}"
        end = rng.choice(["", " R", " T"])
        lines.append(f"({rng.randrange(10**10):010d}.{rng.randrange(10**6):06d}) can0 {number}#{data}{end}\n".encode())
    parsed = parse_lines(b"".join(lines))
    assert parsed is not None
    whole, regular, _, _ = parsed
    assert regular.all()
    assert [(f, "can0") for f in whole.frames()] == [parse_line(line.strip()) for line in lines]
