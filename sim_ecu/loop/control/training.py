"""Rides that the reference controllers are tuned on, and what a ride costs. Seeds 1 ... 999: the suites use others."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from sim_ecu.loop.control.controller import Controller
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.lockstep import ride
from sim_ecu.loop.rig import Step
from sim_ecu.loop.scenario import NO_DRIVE, DriveScenario
from sim_ecu.physics.actuators import Actuators, Drive, swept
from sim_ecu.physics.contact import CURVES, curve_between
from sim_ecu.physics.rail import RailSection
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import QUALITY
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play import scenario as play

WEAR_WEIGHT = 2.0  # a kJ that slides away in the contact counts as two of effort lost
DEMAND_S, DURATION_S = 0.6, 7.0
LEARNT_S = 0.5  # after the demand came: the actuators' own rise is nobody's loss
SLIDES_M_S = 0.3  # slip, when the reference's error is looked at
MASS_ERROR = 0.1  # a controller's load weighing: uniform, our choice
RAILS = ("A", "C", "E", "D", "leaf on dry", "C", "E", "leaf on wet", "low patches")
FRICTION = 0.2  # about a curve's own: uniform
BRAKES = (Actuators(), Actuators(drive=Drive(max_brake_N_m=0.0)), Actuators(drive=Drive(max_brake_N_m=10_000.0)), None)


@dataclass(frozen=True, slots=True)
class Training:
    """A ride and the facts that its controller believes."""

    scenario: DriveScenario
    facts: Facts


@dataclass(frozen=True, slots=True)
class Cost:
    """What a ride missed. lost: share of the effort that the rail and the driver allowed; wear: slip energy over the
    work that this effort would have done."""

    lost: float
    wear: float
    max_slip_m_s: float

    @property
    def total(self) -> float:
        """What the search makes small."""
        return self.lost + WEAR_WEIGHT * self.wear


def training(seed: int) -> Training:
    """The ride of a seed: direction, rail, speed, demand, actuators and load error are drawn from it."""
    rng = np.random.default_rng([seed, 13])
    braking, axles = seed % 4 != 0, 4 if seed % 8 == 5 else 1
    rail = RAILS[seed % len(RAILS)]
    speed = float(rng.uniform(6.0, 30.0) if braking else rng.uniform(4.0, 20.0))
    share = float(rng.uniform(0.6, 1.0))
    before, sign = 0.1 * share, -1.0 if braking else 1.0
    actuators = BRAKES[seed // 4 % 4] or swept(rng)
    driver = play.Course((0.0, DEMAND_S, DEMAND_S + 0.1), (sign * before, sign * before, sign * share))
    table = play.rail_table(_sections(rail, speed, rng))
    ground = seed * 16
    wheels = tuple(
        play.AxleScenario(
            n, table, NO_DRIVE, QUALITY["good"], SENSOR_SETS["mems"], ground + n, play.POSITIONS_M[n - 1], ground
        )
        for n in range(1, axles + 1)
    )
    train = play.Scenario(
        f"training-{seed}", rail, DURATION_S, play.Course((0.0,), (speed,)), False, Wheelset(), wheels
    )
    scenario = DriveScenario(train, driver, actuators)
    facts = Facts.of(scenario)
    error = float(rng.uniform(1.0 - MASS_ERROR, 1.0 + MASS_ERROR))
    return Training(scenario, replace(facts, mass_kg=facts.mass_kg * error))


def _sections(rail: str, speed_m_s: float, rng: np.random.Generator) -> list[RailSection]:
    def section(at_m: float, curve: str) -> RailSection:
        return RailSection(at_m, curve_between(CURVES[curve].mu_0 * rng.uniform(1.0 - FRICTION, 1.0 + FRICTION)))

    if rail in CURVES:
        return [section(0.0, rail)]
    base, film = {"leaf on dry": ("A", "F"), "leaf on wet": ("C", "F")}.get(rail, ("C", "D"))
    at, sections = speed_m_s * DEMAND_S, [section(0.0, base)]
    for _ in range(1 if "leaf" in rail else 3):
        at += speed_m_s * float(rng.uniform(0.3, 1.0))
        sections.append(section(at, film))
        at += speed_m_s * float(rng.uniform(0.5, 2.0))
        sections.append(section(at, base))
    return sections


def cost(scenario: DriveScenario, steps: Iterable[Step]) -> Cost:
    """What a ride missed from the demand on."""
    w, actuators = scenario.train.wheelset, scenario.actuators
    unit = 2.0 * w.normal_N * w.r_0
    could = did = work = slipped = slip = 0.0
    for s in steps:
        if s.due_us < (DEMAND_S + LEARNT_S) * 1e6:
            continue
        traction = actuators.drive.traction_N_m(s.speed_m_s, w.r_0)
        full = actuators.full_brake_N_m if s.share < 0.0 else traction
        ideal = np.minimum(s.mu_available, abs(s.share) * full / unit)
        could += float(ideal.sum())
        did += float(np.minimum(np.sign(s.share) * s.mu_used, ideal).sum())
        work += float(ideal.sum()) * 2.0 * w.normal_N * s.speed_m_s * 0.005
        slipped += float(s.slip_energy_J.sum())
        slip = max(slip, float(np.abs(s.slip_m_s).max()))
    return Cost(1.0 - did / max(could, 1e-9), slipped / max(work, 1e-9), slip)


def run(seed: int, make: Callable[[Facts], Controller]) -> Cost:
    """The cost of a seed's ride with a controller."""
    t = training(seed)
    return cost(t.scenario, ride(t.scenario, make(t.facts), None))


def reference_errors(seed: int, make: Callable[[Facts], SlipController]) -> list[float]:
    """Errors of the reference speed (m/s) at every sample after the demand at which an axle slides by SLIDES_M_S.

    Positive: it lies towards the sliding wheel.
    """
    t = training(seed)
    controller, errors = make(t.facts), []
    for s in ride(t.scenario, controller, None):
        if s.due_us > DEMAND_S * 1e6 and float(np.abs(s.slip_m_s).max()) > SLIDES_M_S:
            error = (controller.reference_m_s or 0.0) - s.speed_m_s
            errors.append(-error if s.share < 0.0 else error)
    return errors
