"""What is driven: four axles, one behind the other, over a patch of low rail, or over a rail with none.

The train moves freely. A slip controller that does not use wrcd takes the torque back where a wheel slips.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim_ecu.loop import LAWS
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.suites import rides
from sim_ecu.loop.suites.rides import LITTLE, ONSET_S, Rng, curve, free_train
from sim_ecu.physics.axlebox import QUIET, AxleBox
from sim_ecu.physics.cleaning import Cleaning
from sim_ecu.physics.contact import CreepCurve, peak
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.scenario import POSITIONS_M, Course, rail_table
from sim_ecu.score.suites.run import AXLES, FIRST_TEST_SEED

PLACES_M = POSITIONS_M[:AXLES]
SPEEDS_M_S = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0)
PER_SPEED = 10  # patches, half of them cleaned by the axles that slip on them
HELD_PER_SPEED = 2  # patches more, on which the driver demands less than they carry
HELD_SHARES = (0.3, 0.9)  # of the patch's peak
STEADY_RUNS, JOINTS_RUNS, RISE_RUNS = 12, 8, 8
# Friction is drawn from one of the ranges.
HIGH, LOW_RAIL = (rides.DRY, rides.DAMP, rides.WET), (rides.GREASY, rides.LOW, rides.LEAVES)
LENGTHS_M = (30.0, 120.0)
IN_USE = (0.05, 0.32)  # adhesion that the driver demands, MOST_OF_HIGH of the good rail's peak at most
MOST_OF_HIGH = 0.85
FULL = 0.34  # adhesion of the full effort
CLEANING = Cleaning(energy_kJ_m=4.0)
DEMAND_S, ENTER_S = 2.5, 4.0  # a little effort until then; the first axle is on the patch at the last
AFTER_S, LONGEST_S = 1.0, 11.0
ALWAYS_PULLS_M_S = 10.0  # up to here the driver pulls: a train that brakes would stand before its last axle is there
STEADY_S, STEP_S = 20.0, 3.0
STEADY_SPEEDS_M_S = (12.0, 40.0)
RISE_AT_S, RISE_S = 7.0, 12.0
# Joints of one rail, and every other of these a crossing: what the suite harsh plays.
JOINTS_M_S2, CROSSING_M_S2, CROSSING_AT_M = (0.3, 2.0, 5.0), 2.0, 100.0
CURVATURES = (0.0, 1 / 1500)  # 1/m
PATCH, STEADY, JOINTS, RISE = "patch", "unchanging", "unchanging, with joints", "rise"
KINDS = (PATCH, STEADY, JOINTS, RISE)
G = 9.80665


@dataclass(frozen=True, slots=True)
class PatchRide:
    """A run, of one of KINDS. start_m, end_m: where the patch lies for axle 1's place; None where there is none.
    slides: whether the driver demands more than the patch carries. held: one more, so that he demands less."""

    number: int
    scenario: DriveScenario
    law: str
    speed_m_s: float
    kind: str
    start_m: float | None = None
    end_m: float | None = None
    slides: bool = False
    held: bool = False

    @property
    def cleaned(self) -> bool:
        """Whether the axles clean the rail."""
        return self.scenario.cleaning is not None


def patches(scale: float = 1.0, first_seed: int = FIRST_TEST_SEED) -> Iterator[PatchRide]:
    """Patches at every speed, with and without cleaning in turn; scale is the share of them. First those on which the
    driver demands what he likes, then those that hold."""
    number = 0
    for per_speed, held in ((PER_SPEED, False), (HELD_PER_SPEED, True)):
        for speed in SPEEDS_M_S:
            for k in range(max(2, round(per_speed * scale))):
                yield _patch(number, first_seed + number, speed, CLEANING if k % 2 else None, held)
                number += 1


def rails(scale: float = 1.0, first_seed: int = FIRST_TEST_SEED) -> Iterator[PatchRide]:
    """Rails on which nobody is to be warned, under a driver who changes: unchanging ones, those with joints, crossings
    and curves, and rises from low rail to good."""
    for place, (kind, count) in enumerate(((STEADY, STEADY_RUNS), (JOINTS, JOINTS_RUNS), (RISE, RISE_RUNS)), 1):
        for number in range(max(2, round(count * scale))):
            yield _rail(number, first_seed + place * 100_000 + number, kind)


def _rail(number: int, seed: int, kind: str) -> PatchRide:
    rng = np.random.default_rng([seed, 12])
    speed = float(rng.uniform(*STEADY_SPEEDS_M_S))
    good = _drawn(rng, HIGH)
    first = _drawn(rng, LOW_RAIL) if kind == RISE else good
    seconds = RISE_S if kind == RISE else STEADY_S
    driver = _driver(rng, min(IN_USE[1], MOST_OF_HIGH * _peak(speed, first)) / FULL, seconds)
    box, curvature = QUIET, 0.0
    if kind == JOINTS:
        crossing = CROSSING_M_S2 * (number % 2)
        box = AxleBox(joint_m_s2=float(rng.choice(JOINTS_M_S2)), crossing_m_s2=crossing, crossing_at_m=CROSSING_AT_M)
        curvature = float(rng.choice(CURVATURES))
    parts = [(0.0, first, curvature, 0.0)]
    if kind == RISE:
        parts.append((speed * RISE_AT_S, good, 0.0, 0.0))
    train = free_train(rng, seed, rail_table(parts), speed, seconds, AXLES, box=box)
    return PatchRide(number, DriveScenario(train, driver, known_before=True), str(rng.choice(LAWS)), speed, kind)


def _driver(rng: Rng, most: float, seconds: float) -> Course:
    times, shares = [0.0], [LITTLE]
    for t in np.arange(DEMAND_S, seconds, STEP_S):
        way = 1.0 if len(times) % 4 < 2 else -1.0  # there and back: the speed stays about where it was
        times += [float(t), float(t) + ONSET_S]
        shares += [shares[-1], way * float(rng.uniform(0.0, most))]
    return Course(tuple(times), tuple(shares))


def _patch(number: int, seed: int, speed: float, cleaning: Cleaning | None, held: bool) -> PatchRide:
    rng = np.random.default_rng([seed, 11])
    good, bad = _drawn(rng, HIGH), _drawn(rng, LOW_RAIL)
    way = 1.0 if speed <= ALWAYS_PULLS_M_S or rng.random() < 0.5 else -1.0
    used = min(float(rng.uniform(*IN_USE)), MOST_OF_HIGH * _peak(speed, good))
    if held:
        used = float(rng.uniform(*HELD_SHARES)) * _peak(speed, bad)
    start_m = speed * ENTER_S + way * 0.5 * used * G * (ENTER_S - DEMAND_S) ** 2
    end_m = start_m + float(rng.uniform(*LENGTHS_M))
    rail = rail_table([(0.0, good, 0.0, 0.0), (start_m, bad, 0.0, 0.0), (end_m, good, 0.0, 0.0)])
    way_s = (PLACES_M[0] - PLACES_M[-1]) / max(speed - 2.0, 2.0)
    seconds = min(ENTER_S + way_s + AFTER_S, LONGEST_S)
    driver = Course((0.0, DEMAND_S, DEMAND_S + ONSET_S), (way * LITTLE, way * LITTLE, way * used / FULL))
    train = free_train(rng, seed, rail, speed, seconds, AXLES)
    drive = DriveScenario(train, driver, known_before=True, cleaning=cleaning)
    slides = used > _peak(speed, bad)
    return PatchRide(number, drive, str(rng.choice(LAWS)), speed, PATCH, start_m, end_m, slides, held)


def _drawn(rng: Rng, frictions: tuple[tuple[float, float], ...]) -> CreepCurve:
    return curve(rng, frictions[int(rng.integers(len(frictions)))])


def _peak(speed: float, curve: CreepCurve) -> float:
    return float(peak(speed, Wheelset().contact, *curve.row())[1])
