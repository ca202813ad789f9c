"""A run of a score, and what the suites build theirs from. No training condition has their seeds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from sim_ecu.physics.axlebox import QUIET, AxleBox
from sim_ecu.physics.contact import CURVES, CreepCurve
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.physics.track import QUALITY, SPECTRA, Spectrum
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.faults import Fault
from sim_ecu.play.scenario import AxleScenario, Course, DriveCourse, FloatArray, Scenario, rail_table

FIRST_TEST_SEED = 2_000_000_000  # training seeds stay far below
# Runs that designs are chosen by: above the seeds of all plans, below those of conditions that are held for a search.
FIRST_TRAINING_SEED, TRAINING_SEEDS, TRAINING_LOTS = 1_905_000_000, 1_000_000, 40
TEST_SEEDS, TEST_LOTS = 1_000_000_000, 40
AXLES = 4
NOMINAL_FROM_S = 2.0  # frames before are not judged
SPEEDS = (10.0, 50.0)
UTILISATIONS = (0.15, 1.0)
CLASSES = tuple(QUALITY)  # of tracks, drawn from
CREEP_LIMIT = 1.3  # of the traction controller, as a share of the peak's creep
Rng = np.random.Generator
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Run:
    """Wheelsets that are played together, and what a report sorts them by.

    group: the variant within the suite. number: of the conditions; a run of another group, or of the grid, with the
    same number has the same seeds, speed, rails and torques. curves: of each axle. changes_s: when the rail changes.
    before: what both wheelsets of a bogie of such a train ran through, so that the daemon knows of the design's fit.
    """

    suite: str
    group: str
    number: int
    scenario: Scenario
    curves: tuple[str, ...]
    judged_from_s: float = NOMINAL_FROM_S
    changes_s: tuple[float, ...] = ()
    before: Scenario | None = None


@dataclass(frozen=True, slots=True)
class Lot:
    """Where the seeds of a suite's runs come from: `seeds` of them from first_seed on. No two lots share one."""

    first_seed: int = FIRST_TEST_SEED
    seeds: int = TEST_SEEDS

    def generator(self, *key: int) -> Rng:
        """Random numbers of the lot's own."""
        return np.random.default_rng([self.first_seed, *key])

    def seed(self, rng: Rng) -> int:
        """Of an axle."""
        return self.first_seed + int(rng.integers(self.seeds))


TEST = Lot()  # what `sim-ecu score` plays


def lot_of(number: int) -> Lot:
    """The score's own for 0; further ones below TEST_LOTS, to score on other seeds. Below zero, down to -TRAINING_LOTS:
    to choose a design by."""
    if number < 0:
        return Lot(FIRST_TRAINING_SEED - (1 + number) * TRAINING_SEEDS, TRAINING_SEEDS)
    return Lot(FIRST_TEST_SEED + number * TEST_SEEDS)


def axle(
    lot: Lot, place: int, rail: FloatArray, drive: DriveCourse, track: Spectrum, rng: Rng,
    sensors: SensorSet = SENSOR_SETS["mems"], box: AxleBox = QUIET,
) -> AxleScenario:  # fmt: skip
    """One wheelset on a track of its own."""
    return AxleScenario(
        number=place % AXLES + 1,
        rail=rail,
        drive=drive,
        track=track,
        sensors=sensors,
        seed=lot.seed(rng),
        position_m=0.0,
        axlebox=box,
    )


def scenario(
    w: Wheelset, seconds: float, speed: Course | float, axles: Sequence[AxleScenario], faults: tuple[Fault, ...] = ()
) -> Scenario:
    """At held speed."""
    course = speed if isinstance(speed, Course) else Course((0.0,), (speed,))
    return Scenario("score", "", seconds, course, True, w, tuple(axles), faults)


def any_track(rng: Rng) -> Spectrum:
    """A good one or a poor one."""
    return SPECTRA[str(rng.choice(CLASSES))]


def one_rail(curve: CreepCurve, curvature: float = 0.0) -> FloatArray:
    """A rail that stays as it is."""
    return rail_table([(0.0, curve, curvature, 0.0)])


def rails(parts: Sequence[tuple[float, str]]) -> FloatArray:
    """From a distance (m) on, each curve."""
    return rail_table([(d, CURVES[c], 0.0, 0.0) for d, c in parts])


def drive(demand: str, *points: tuple[float, float], limit: float = CREEP_LIMIT) -> DriveCourse:
    """A demand over time: (s, value) …, linear between them."""
    times, values = zip(*points, strict=True)
    return DriveCourse(demand, Course(times, values), Course((0.0,), (limit,)))


def by_four(cases: Sequence[T], rng: Rng) -> Iterator[list[tuple[int, T]]]:
    """In random order, four at a time, each with its place."""
    order = rng.permutation(len(cases))
    for first in range(0, len(cases), AXLES):
        yield [(i, cases[int(k)]) for i, k in enumerate(order[first : first + AXLES])]
