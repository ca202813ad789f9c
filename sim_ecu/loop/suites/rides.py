"""A case of a suite, and what the suites build its runs from. No controller was tuned on their seeds."""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim_ecu.loop import CONTROLLERS
from sim_ecu.loop.drive_scenario import NO_DRIVE, DriveScenario
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.axlebox import QUIET, AxleBox
from sim_ecu.physics.contact import CreepCurve, curve_between
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.physics.track import QUALITY, Spectrum
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.faults import Fault
from sim_ecu.play.scenario import POSITIONS_M, AxleScenario, Course, FloatArray, Scenario, rail_table
from sim_ecu.score.suites.nominal import noisier

FIRST_TEST_SEED = 1_000_000  # controllers are tuned on seeds below 1000
SEEDS = 20
FEW_SEEDS = 8  # of the broad suites, whose rows are many variants of one stop
Rng = np.random.Generator

# What differs from run to run of a case: all drawn evenly, the track's roughness by its logarithm.
EFFORT = (0.9, 1.0)  # of the full effort
ROUGHNESS = (QUALITY["good"], QUALITY["poor"])
NOISE = (0.67, 1.5)  # times the noise of the mems sensors
DRY, DAMP = (0.45, 0.55), (0.38, 0.45)  # friction mu_0, as in docs/reference/scenario.md
WET, GREASY, LOW, LEAVES = (0.27, 0.33), (0.13, 0.17), (0.05, 0.07), (0.03, 0.06)

KNOWN_S = 3.5  # of a little effort, before the demand: what is known before
BEFORE_S = 1.5  # of coasting, where nothing is known before
LITTLE = 0.05  # of the full effort
ONSET_S = 0.1  # in which the demand comes


@dataclass(frozen=True, slots=True)
class RidePlan:
    """A run as a suite draws it: rail sections from a distance (m) on, first speed, driver, and how long at most."""

    rail: tuple[tuple[float, CreepCurve], ...]
    speed_m_s: float
    driver: tuple[tuple[float, float], ...]
    duration_s: float
    known_before: bool = False


@dataclass(frozen=True, slots=True)
class LoopCase:
    """One row of a suite.

    plan draws a run's plan; world changes the scenario that is made of it. key: cases with the same one draw the same
    runs. bare: the case of the suite whose bare runs, and ideal, are this one's too; empty for its own.
    """

    suite: str
    name: str
    plan: Callable[[Rng], RidePlan]
    axles: int = 1
    world: Callable[[DriveScenario, Rng], DriveScenario] = lambda s, _: s
    key: str = ""
    bare: str = ""
    controllers: tuple[str, ...] = CONTROLLERS
    fault: Fault | None = None  # of the inputs: until it begins the run is that of `bare`, which is driven once
    constant_pct: float | None = None  # adhesion that somebody says all along, in the daemon's place
    shown: bool = False  # its first run is drawn over time

    def scenario(self, number: int) -> DriveScenario:
        """The run of a number, always the same."""
        seed = FIRST_TEST_SEED + number
        key = zlib.crc32((self.key or self.name).encode())
        rng, own = np.random.default_rng([seed, key]), np.random.default_rng([seed, key, 1])
        found = self.world(drive(self.plan(rng), seed, rng, self.axles), own)
        return found if self.fault is None else replace(found, train=replace(found.train, faults=(self.fault,)))

    @property
    def braking(self) -> bool:
        """Whether the driver brakes."""
        return self.plan(np.random.default_rng(0)).driver[-1][1] < 0.0

    @property
    def known_before(self) -> bool:
        """Whether the rail was under the wheels before the demand came."""
        return self.plan(np.random.default_rng(0)).known_before


def drive(plan: RidePlan, seed: int, rng: Rng, axles: int) -> DriveScenario:
    """The scenario of a plan, with its track and its sensors drawn."""
    rail = rail_table([(at, curve, 0.0, 0.0) for at, curve in plan.rail])
    train = free_train(rng, seed, rail, plan.speed_m_s, plan.duration_s, axles, noisy=True)
    times, shares = zip(*plan.driver, strict=True)
    return DriveScenario(train, Course(times, shares), known_before=plan.known_before)


def free_train(
    rng: Rng, seed: int, rail: FloatArray, speed_m_s: float, seconds: float, axles: int, noisy: bool = False,
    box: AxleBox = QUIET,
) -> Scenario:  # fmt: skip
    """A train that moves freely over a rail, its track's roughness drawn; noisy: its sensors' noise, too."""
    track = Spectrum.of_roughness(float(np.exp(rng.uniform(*np.log(ROUGHNESS)))))
    sensors = noisier(float(rng.uniform(*NOISE))) if noisy else SENSOR_SETS["mems"]
    every = tuple(
        AxleScenario(n, rail, NO_DRIVE, track, sensors, seed * 16 + n, POSITIONS_M[n - 1], seed * 16, axlebox=box)
        for n in range(1, axles + 1)
    )
    return Scenario("loop", "", seconds, Course((0.0,), (speed_m_s,)), False, Wheelset(), every)


def curve(rng: Rng, friction: tuple[float, float]) -> CreepCurve:
    """A rail of a friction drawn from a range."""
    return curve_between(float(rng.uniform(*friction)))


def demand(way: float, rng: Rng, known: bool) -> tuple[tuple[float, float], ...]:
    """The driver's course: a little effort or none, then the demand. way 1 pulls, -1 brakes."""
    share = way * float(rng.uniform(*EFFORT))
    at, before = (KNOWN_S, way * LITTLE) if known else (BEFORE_S, 0.0)
    return ((0.0, before), (at, before), (at + ONSET_S, share))


def with_train(
    s: DriveScenario, wheelset: Wheelset | None = None, sensors: Callable[[SensorSet], SensorSet] | None = None,
    actuators: Actuators | None = None, axles: Callable[[AxleScenario], AxleScenario] | None = None,
) -> DriveScenario:  # fmt: skip
    """The scenario with another train."""
    every: Sequence[AxleScenario] = s.train.axles
    if sensors is not None:
        every = [replace(a, sensors=sensors(a.sensors)) for a in every]
    if axles is not None:
        every = [axles(a) for a in every]
    train = replace(s.train, wheelset=wheelset or s.train.wheelset, axles=tuple(every))
    return replace(s, train=train, actuators=actuators or s.actuators)
