"""Sensors' frames as often as it takes: a stretch of four axles that can follow itself, and more axles made of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import read_scenario
from tests.support.scenarios import FOUR_AXLES
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.settings import parse_toml

RECORDED = 4  # axles
START_US = 1_700_000_000_000_000 - 1_700_000_000_000_000 % 300_000
# All counters of 5, 10 and 20 ms come round in 0.3 s: a stretch of sixteen times that can follow itself.
FIRST_US, LENGTH_US = 1_200_000, 4_800_000


@dataclass(frozen=True, slots=True)
class Recorded:
    """One frame of the stretch, in microseconds after its beginning."""

    at_us: int
    can_id: int
    data: bytes


@cache
def stretch(axles: int = RECORDED) -> tuple[Recorded, ...]:
    """The rig's frames of so many axles; what is beyond four repeats the first ones under ids of their own."""
    out: list[Recorded] = []
    scenario = read_scenario(parse_toml(FOUR_AXLES, "four axles"), "four axles")
    for f in (f for _, frames in Player(scenario, truth=False) for f in frames):
        if FIRST_US <= f.due_us < FIRST_US + LENGTH_US:
            number = f.can_id & 0x0F
            for copy in (0,) if number == 0 else range(0, axles - number + 1, RECORDED):
                data = f.data if copy == 0 else protect(f.data, f.can_id + copy, f.data[1] & 0x0F)
                out.append(Recorded(f.due_us - FIRST_US, f.can_id + copy, data))
    return tuple(sorted(out, key=lambda r: r.at_us))


def frames(axles: int = RECORDED) -> Iterator[Frame]:
    """The stretch again and again, without end; stamps and counters go on."""
    begin_us = START_US
    while True:
        for r in stretch(axles):
            yield Frame(begin_us + r.at_us, r.can_id, r.data)
        begin_us += LENGTH_US
