"""What `sim-ecu score` plays: scenarios of up to four wheelsets, whose seeds no training condition has."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between, peak
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.physics.track import QUALITY
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.scenario import AxleScenario, Course, Drive, Scenario, rail_table

FIRST_TEST_SEED = 2_000_000_000  # training seeds stay far below
AXLES = 4
NOMINAL_FROM_S = 2.0  # frames before are not judged
SPEEDS = (10.0, 50.0)
UTILISATIONS = (0.15, 1.0)
FRICTIONS = (CURVES["F"].mu_0, CURVES["A"].mu_0)
ROUGHNESS = (QUALITY["good"], QUALITY["poor"])
Rng = np.random.Generator
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Run:
    """Wheelsets that are played together, and what a report sorts them by.

    group: the variant within the suite. curves: of each axle. changes_s: when the rail changes.
    """

    suite: str
    group: str
    scenario: Scenario
    curves: tuple[str, ...]
    judged_from_s: float = NOMINAL_FROM_S
    changes_s: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Variant:
    """One way in which the world is not as the design thinks."""

    name: str
    wheelset: Callable[[Wheelset, Rng], Wheelset] = lambda w, _: w
    curve: Callable[[CreepCurve, Rng], CreepCurve] = lambda c, _: c
    sensors: Callable[[SensorSet], SensorSet] = lambda s: s
    curvature: float = 0.0  # 1/m
    ramp_m_s2: float = 0.0


def _either(rng: Rng, share: float) -> float:
    return 1.0 + share if rng.random() < 0.5 else 1.0 - share


def _scattered(w: Wheelset, rng: Rng) -> Wheelset:
    """Masses, stiffnesses, dampings and inertias each off by up to 10 %."""
    names = ("m_w", "I_w", "k_w", "I_R", "I_L", "k_s", "C_s", "a", "b")
    return replace(w, **{n: getattr(w, n) * rng.uniform(0.9, 1.1) for n in names})


# Constant errors of cheap sensors: 0.5 degrees per second, 5 mg, a torque that reads 3 % high.
ROBUST = (
    Variant("wheelset parameters off by up to 10 %", wheelset=_scattered),
    Variant("conicity off by 30 %", wheelset=lambda w, r: replace(w, gamma=w.gamma * _either(r, 0.3))),
    Variant("load off by 15 %", wheelset=lambda w, r: replace(w, M_v=w.M_v * _either(r, 0.15))),
    Variant("k_A off by 30 %", curve=lambda c, r: replace(c, k_A=c.k_A * _either(r, 0.3))),
    Variant("torque reads 3 % high", sensors=lambda s: replace(s, torque=replace(s.torque, gain=1.03))),
    Variant("gyro bias 0.5 °/s", sensors=lambda s: replace(s, yaw_rate=replace(s.yaw_rate, bias=math.radians(0.5)))),
    Variant("accelerometer bias 5 mg", sensors=lambda s: replace(s, lat_accel=replace(s.lat_accel, bias=0.049))),
    Variant("curve of 1500 m, no cant", curvature=1 / 1500),
    Variant("speed ramp of 0.8 m/s²", ramp_m_s2=0.8),
)


def paper(w: Wheelset, scale: float) -> Iterator[Run]:
    """Each curve held at its peak at 25 m/s: where the paper shows its results."""
    rng = np.random.default_rng([FIRST_TEST_SEED, 1])
    letters = list(CURVES) * max(2, round(4 * scale))
    for part in _parts(letters):
        drive = Drive("creep_of_peak", Course((0.0, 0.5), (0.0, 1.0)), Course((0.0,), (1.3,)))
        axles = [_axle(i, rail_table([(0.0, CURVES[c], 0.0, 0.0)]), drive, QUALITY["good"], rng) for i, c in part]
        yield Run("paper", "held at the peak", _scenario(w, 10.0, 25.0, axles), tuple(c for _, c in part))


def grid(w: Wheelset, scale: float) -> Iterator[Run]:
    """Curves A to F and between x utilisation x speed x track x sensors."""
    yield from _nominal("grid", "", w, round(300 * scale), 2, Variant("as designed"), ROUGHNESS)


def robust(w: Wheelset, scale: float) -> Iterator[Run]:
    """The same, with a world that differs from the design's."""
    for k, variant in enumerate(ROBUST):
        yield from _nominal("robust", variant.name, w, round(20 * scale), 100 + k, variant, ROUGHNESS, tactical=False)


# Roughness is the spectral density A_a of the irregularity; the amplitude goes with its root. The first two are judged.
ROUGH = (
    ("half as rough as any trained", 0, 0.5),
    ("twice as rough as any trained", 1, 2.0),
    ("half the amplitude of any trained", 0, 0.25),
    ("twice the amplitude of any trained", 1, 4.0),
)


ROUGH_JUDGED = tuple(name for name, _, _ in ROUGH[:2])


def rough(w: Wheelset, scale: float, trained: tuple[float, float]) -> Iterator[Run]:
    """Tracks smoother and rougher than any in the training (whose ends are given times the good track's A_a)."""
    for k, (name, end, factor) in enumerate(ROUGH):
        density = QUALITY["good"] * trained[end] * factor
        variant = Variant(name)
        yield from _nominal("rough", name, w, round(25 * scale), 200 + k, variant, (density, density), tactical=False)


def transitions(w: Wheelset, scale: float) -> Iterator[Run]:
    """Dry to each other curve and back, in traction and braking, at torques that a dry rail carries easily."""
    rng = np.random.default_rng([FIRST_TEST_SEED, 3])
    others = [c for c in CURVES if c != "A"]
    cases = [(c, u, s) for u in (0.15, 0.3, 0.6) for s in (1.0, -1.0) for c in others]
    there_s, back_s = 5.0, 9.0
    for part in _parts(cases * max(1, round(4 * scale)), shuffle=rng):
        v = float(rng.uniform(15.0, 40.0))
        axles = []
        for i, (letter, share, sign) in part:
            rail = rail_table([(d * v, CURVES[c], 0.0, 0.0) for d, c in ((0.0, "A"), (there_s, letter), (back_s, "A"))])
            torque = sign * share * peak(v, w.contact, *CURVES["A"].row())[1] * 2 * w.normal_N * w.r_0
            drive = Drive("torque_N_m", Course((0.0, 0.5), (0.0, torque)), Course((0.0,), (1.2,)))
            axles.append(_axle(i, rail, drive, float(rng.choice(ROUGHNESS)), rng))
        curves = tuple(letter for _, (letter, _, _) in part)
        scenario = _scenario(w, 13.0, v, axles)
        yield Run("transitions", "dry, another, dry", scenario, curves, changes_s=(there_s, back_s))


def dry_hours(w: Wheelset, scale: float) -> Iterator[Run]:
    """An hour of dry, poor track in all, at all utilisations and speeds: how often is it called low?"""
    rng = np.random.default_rng([FIRST_TEST_SEED, 4])
    seconds = 75.0
    for _ in range(max(1, round(12 * scale))):
        v = float(rng.uniform(*SPEEDS))
        axles = []
        for i in range(AXLES):
            t = np.arange(0.0, seconds + 1.0, 5.0)
            wanted = rng.uniform(*UTILISATIONS, len(t)) * float(rng.choice([1.0, 1.0, -1.0]))
            drive = Drive("utilisation", Course(tuple(t), tuple(wanted)), Course((0.0,), (1.3,)))
            axles.append(_axle(i, rail_table([(0.0, CURVES["A"], 0.0, 0.0)]), drive, QUALITY["poor"], rng))
        yield Run("dry-hours", "dry, poor track", _scenario(w, seconds, v, axles), ("A",) * AXLES)


def _nominal(
    suite: str, group: str, w: Wheelset, runs: int, seed: int, variant: Variant,
    roughness: tuple[float, float], tactical: bool = True,
) -> Iterator[Run]:  # fmt: skip
    """Conditions like the training's: half of the curves are A to F, half lie between; a quarter tactical sensors."""
    rng = np.random.default_rng([FIRST_TEST_SEED, seed])
    letters = list(CURVES)
    seconds = 4.0
    for run in range(max(1, runs)):
        v = float(rng.uniform(*SPEEDS))
        axles, names = [], []
        world = variant.wheelset(w, rng)
        for i in range(AXLES):
            known = (run + i) % 2 == 0
            letter = str(rng.choice(letters))
            base = CURVES[letter] if known else curve_between(math.exp(rng.uniform(*np.log(FRICTIONS))))
            curve = variant.curve(base, rng)
            share = float(rng.uniform(*UTILISATIONS)) * (-1.0 if rng.random() < 0.3 else 1.0)
            drive = Drive("utilisation", Course((0.0, 0.5), (0.0, share)), Course((0.0,), (1.3,)))
            kind = "tactical" if tactical and rng.random() < 0.25 else "mems"
            sensors = variant.sensors(SENSOR_SETS[kind])
            rail = rail_table([(0.0, curve, variant.curvature, 0.0)])
            axles.append(_axle(i, rail, drive, float(rng.choice(roughness)), rng, sensors))
            names.append(letter if known else "between")
        speed = Course((0.0, seconds), (v, v + variant.ramp_m_s2 * seconds))
        scenario = replace(_scenario(world, seconds, v, axles), speed=speed)
        yield Run(suite, group, scenario, tuple(names))


def _axle(
    place: int, rail: np.ndarray, drive: Drive, roughness: float, rng: Rng, sensors: SensorSet = SENSOR_SETS["mems"]
) -> AxleScenario:
    seed = FIRST_TEST_SEED + int(rng.integers(1_000_000_000))
    return AxleScenario(place % AXLES + 1, rail, drive, roughness, sensors, seed, 0.0)


def _scenario(w: Wheelset, seconds: float, speed_m_s: float, axles: Sequence[AxleScenario]) -> Scenario:
    return Scenario("score", "", seconds, Course((0.0,), (speed_m_s,)), True, w, tuple(axles))


def _parts(cases: Sequence[T], shuffle: Rng | None = None) -> Iterator[list[tuple[int, T]]]:
    """Four at a time, each with its place."""
    order = shuffle.permutation(len(cases)) if shuffle else range(len(cases))
    for first in range(0, len(cases), AXLES):
        yield [(i, cases[int(k)]) for i, k in enumerate(order[first : first + AXLES])]
