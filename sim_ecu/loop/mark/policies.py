"""Who drives: each policy's rate for a stop, from what it may know before it brakes."""

from collections.abc import Mapping
from dataclasses import dataclass

from sim_ecu.loop.control.braking_rate import RATES
from sim_ecu.loop.driver import Advised, BrakeTesting, MarkDriver, Rule
from sim_ecu.loop.mark.approach import TRAINS, Advices, advised_configuration, approach
from sim_ecu.loop.mark.lines import FULL_SERVICE, MARK_WORLDS, Stop, braking_m, stops
from sim_ecu.loop.mark.stops import G, StopOutcome, known_rate, stands
from wrcd.core.configuration import Config

DRY, SLIPPERY = f"always {RATES.dry:g} m/s²", f"always {RATES.cautious:g} m/s²"
LAST, REPORT = "slippery rate after a slide", "driver's report"
TOLD = {f"told {pct} %": pct for pct in (3, 8, 15, 25, 40)}
TESTS, WRCD, UNTESTED, KNOWS = "brake test every time", "wrcd", "wrcd, no brake test", "knows the rail"
POLICIES = (DRY, SLIPPERY, LAST, REPORT, *TOLD, TESTS, UNTESTED, WRCD, KNOWS)
REPORT_STOPS = 3  # that a report of a slide holds for


@dataclass(frozen=True, slots=True)
class DrivenStop:
    """What the policies made of a stop. late: the film is first met within the braking distance of who knows it."""

    world: str
    line: int
    station: int
    rail: str
    late: bool
    outcomes: Mapping[str, StopOutcome]


class SlideMemory:
    """Drives at the slippery rate for so many stops after one that slid, else at the dry one."""

    def __init__(self, stops: int) -> None:
        self._stops, self._left = stops, 0

    def stop(self, outcomes: Mapping[str, StopOutcome]) -> StopOutcome:
        """Return what it makes of the next stop, from what both rates make of it."""
        outcome = outcomes[SLIPPERY if self._left else DRY]
        self._left = self._stops if outcome.slid else max(self._left - 1, 0)
        return outcome


def drive_line(world: int, line: int, first_seed: int) -> list[DrivenStop]:
    """Drive all stops of a line, by every policy. world: its place in MARK_WORLDS."""
    every = stops(MARK_WORLDS[world], line, first_seed)
    heard = [h for k in range(0, len(every), TRAINS) for h in approach(every[k : k + TRAINS])]
    config = advised_configuration()
    memories = {LAST: SlideMemory(1), REPORT: SlideMemory(REPORT_STOPS)}
    driven = []
    for stop, advices in zip(every, heard, strict=True):
        rate, outcomes = _drive(stop, advices, config)
        outcomes |= {name: memory.stop(outcomes) for name, memory in memories.items()}
        late = stop.film_m > stop.mark_m - braking_m(stop.speed_m_s, rate)
        driven.append(DrivenStop(stop.world, stop.line, stop.station, stop.rail, late, outcomes))
    return driven


def _drive(stop: Stop, advices: Advices, config: Config) -> tuple[float, dict[str, StopOutcome]]:
    """The rate of who knows the rail, and what every policy makes of the stop but those that remember."""
    rate = known_rate(stop)
    constant = {DRY: RATES.dry, SLIPPERY: RATES.cautious, KNOWS: rate}
    constant |= {name: told_rate(pct) for name, pct in TOLD.items()}
    made: dict[float, StopOutcome] = {}
    outcomes: dict[str, StopOutcome] = {}
    for name, planned in constant.items():
        if planned not in made:
            made[planned] = _stands(stop, Rule(planned))
        outcomes[name] = made[planned]
    outcomes[TESTS] = _stands(stop, BrakeTesting(tuple(stop.scenario.axles)))
    outcomes[WRCD] = _stands(stop, Advised(config), advices)
    outcomes[UNTESTED] = _stands(stop, Advised(config, tests=False), advices)
    return rate, outcomes


def _stands(stop: Stop, rule: Rule, advices: Advices = ()) -> StopOutcome:
    return stands(MarkDriver(rule, FULL_SERVICE), stop, advices)


def told_rate(pct: float) -> float:
    """The rate of who is told an adhesion (%), whatever the rail, and believes it to a point."""
    return min(max(RATES.kept * G * pct / 100.0, RATES.least), RATES.dry)
