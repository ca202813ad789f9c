"""What is fed: a recorded stretch of four axles, as often as it takes, and the configurations that go with it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import Scenario, read_scenario
from tests.support.scenarios import FOUR_AXLES
from wrcd.bus.candump import format_line
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.settings import parse_toml

RECORDED = 4  # axles
TICK_US = 5_000
START_US = 1_700_000_000_000_000 - 1_700_000_000_000_000 % 300_000
# All counters of 5, 10 and 20 ms come round in 0.3 s: a stretch of sixteen times that can follow itself.
FIRST_US, LENGTH_US = 1_200_000, 4_800_000


@dataclass(frozen=True, slots=True)
class Recorded:
    """One frame of the stretch, in microseconds after its beginning."""

    at_us: int
    can_id: int
    data: bytes


# A rough track with joints, and an axle that slides and grips again: pulses, filters that swing, windows that are cut.
ROUGH = """
track = "poor"
[axlebox]
joint_m_s2 = 20
vibration_m_s2 = 2
[axle.1]
drive = { creep_of_peak = [[0, 0.2], [2, 0.2], [2.2, 3.0], [3.2, 3.0], [3.4, 0.3], [4.6, 0.3], [4.8, 3.0], [6, 3.0]] }
"""


def scenario(rough: bool = False) -> Scenario:
    """Four wheelsets on different rails, the creep held; on a rough track one slides."""
    text = FOUR_AXLES.replace("[axle.2]", ROUGH + "[axle.2]") if rough else FOUR_AXLES
    return read_scenario(parse_toml(text, "four axles"), "four axles")


@cache
def stretch(axles: int = RECORDED, rough: bool = False) -> tuple[Recorded, ...]:
    """The rig's frames of so many axles; what is beyond four repeats the first ones under ids of their own."""
    out: list[Recorded] = []
    for _, frames in Player(scenario(rough), truth=False):
        for f in frames:
            if not FIRST_US <= f.due_us < FIRST_US + LENGTH_US:
                continue
            number = f.can_id & 0x0F
            copies = (0,) if number == 0 else range(0, axles - number + 1, RECORDED)
            for copy in copies:
                data = f.data if copy == 0 else protect(f.data, f.can_id + copy, f.data[1] & 0x0F)
                out.append(Recorded(f.due_us - FIRST_US, f.can_id + copy, data))
    return tuple(sorted(out, key=lambda r: r.at_us))


def frames(axles: int = RECORDED, start_us: int = START_US) -> Iterator[Frame]:
    """The stretch again and again, without end; stamps and counters go on."""
    begin_us = start_us
    while True:
        for r in stretch(axles):
            yield Frame(begin_us + r.at_us, r.can_id, r.data)
        begin_us += LENGTH_US


def write_stretch(path: Path, axles: int, rough: bool = False) -> None:
    """One line a frame, for another process: microseconds, id, data."""
    path.write_text("".join(f"{r.at_us} {r.can_id} {r.data.hex()}\n" for r in stretch(axles, rough)))


def write_log(path: Path, seconds: float, axles: int = RECORDED) -> int:
    """A candump log of the stretch. Returns how many frames it has."""
    end_us, count = START_US + round(seconds * 1e6), 0
    with path.open("w") as f:
        for frame in frames(axles):
            if frame.stamp_us >= end_us:
                break
            f.write(format_line(frame, "can0") + "\n")
            count += 1
    return count
