"""Simulated conditions and the residuals that the bank shows in them (the paper's Fig. 6, for any wheelset)."""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.contact import CreepCurve, curve_between
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.simulation import Axle, Samples, Simulation
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.wheelset import LAT_ACCEL, MU_AVAILABLE, RAIL_COLUMNS, TORQUE, YAW_RATE, Command, Wheelset
from wrcd.estimator.design import Design
from wrcd.estimator.estimator import Estimator, Tick

FloatArray = NDArray[np.float64]
Progress = Callable[[str, float], None]  # what is going on, share of it that is done


@dataclass(frozen=True, slots=True)
class Condition:
    """One wheelset on one rail. Exactly one of utilisation and creep_of_peak is a number; negative when braking."""

    speed_m_s: float
    curve: CreepCurve
    roughness: float
    utilisation: float
    creep_of_peak: float
    seed: int


@dataclass(frozen=True, slots=True)
class Plan:
    """How the conditions of a design are drawn."""

    seed: int = 1
    speeds: int = 24
    per_speed: int = 250
    speed_range: tuple[float, float] = (4.0, 58.0)
    friction_range: tuple[float, float] = (0.022, 0.65)
    utilisation_range: tuple[float, float] = (0.10, 1.0)
    held_share: float = 0.25  # of the conditions, held at or about the peak by the creep controller
    roughness_range: tuple[float, float] = (0.7, 4.0)  # times the good track's spectral density
    sensors: str = "mems"
    settle_s: float = 2.0
    windows: int = 2  # taken from each condition, half a window apart


def draw(plan: Plan) -> list[list[Condition]]:
    """Conditions, one list per speed (the bank shares its gains at a speed)."""
    rng = np.random.default_rng([plan.seed, 0])
    out = []
    for k in range(plan.speeds):
        share = k / max(plan.speeds - 1, 1)
        v = plan.speed_range[0] * (plan.speed_range[1] / plan.speed_range[0]) ** share
        group = []
        for i in range(plan.per_speed):
            held = rng.random() < plan.held_share
            sign = -1.0 if rng.random() < 0.3 else 1.0
            group.append(
                Condition(
                    speed_m_s=float(v),
                    curve=curve_between(math.exp(rng.uniform(*np.log(plan.friction_range)))),
                    roughness=QUALITY["good"] * math.exp(rng.uniform(*np.log(plan.roughness_range))),
                    utilisation=math.nan if held else sign * rng.uniform(*plan.utilisation_range),
                    creep_of_peak=sign * float(rng.choice([1.0, rng.uniform(0.7, 1.6)])) if held else math.nan,
                    seed=plan.seed * 1_000_003 + k * plan.per_speed + i,
                )
            )
        out.append(group)
    return out


def command(samples: int, axles: int = 1, **given: float | FloatArray) -> Command:
    """A command that is the same in every sample, or given per sample; what is not named is not given."""
    return Command(
        *(
            np.ascontiguousarray(np.broadcast_to(np.asarray(given.get(f, math.nan), float), (samples, axles)))
            for f in Command._fields
        )
    )


def simulate(w: Wheelset, c: Condition, seconds: float, tick_s: float) -> Samples:
    """Play a condition at held speed; torque or creep comes up within the first 0.5 s."""
    n = round(seconds / tick_s)
    rail = np.zeros((1, RAIL_COLUMNS))
    rail[0, 1:6] = c.curve.row()
    ramp = np.minimum(np.arange(1, n + 1) * tick_s / 0.5, 1.0)[:, None]
    sim = Simulation(w, [Axle(rail, Track(c.roughness, c.seed))], c.speed_m_s, tick_s)
    drive = command(n, utilisation=ramp * c.utilisation, creep_of_peak=ramp * c.creep_of_peak, limit_of_peak=1.3)
    return sim.advance(drive, np.full(n, c.speed_m_s))


@dataclass(frozen=True, slots=True)
class Features:
    """One row per window: log10 residuals and torque ratio (n, 5), the truth in percent (n,)."""

    inputs: FloatArray
    mu_pct: FloatArray


@dataclass(frozen=True, slots=True)
class Recording:
    """What the sensors said at one speed: z (ticks, 2, n), torque (ticks, n), the truth in percent (n,)."""

    speed_m_s: float
    z: FloatArray
    torque: FloatArray
    mu_pct: FloatArray


def record(
    w: Wheelset, plan: Plan, tick_s: float, window_s: float, progress: Progress, jobs: int = 2
) -> list[Recording]:
    """Simulate all conditions (the long part: minutes) and add the sensors' noise."""
    groups = draw(plan)
    seconds = plan.settle_s + window_s * (plan.windows + 1) / 2
    sensors = SENSOR_SETS[plan.sensors]
    out = []
    with ThreadPoolExecutor(jobs) as pool:
        for k, group in enumerate(groups):
            runs = list(pool.map(lambda c: simulate(w, c, seconds, tick_s).outputs[:, 0], group))
            y = np.stack(runs, axis=-1)  # (ticks, outputs, n)
            rng = np.random.default_rng([plan.seed, 1, k])
            out.append(
                Recording(
                    speed_m_s=group[0].speed_m_s,
                    z=np.stack(
                        (
                            sensors.yaw_rate.measure(y[:, YAW_RATE], rng),
                            sensors.lat_accel.measure(y[:, LAT_ACCEL], rng),
                        ),
                        axis=1,
                    ),
                    torque=sensors.torque.measure(y[:, TORQUE], rng),
                    mu_pct=100 * y[-1, MU_AVAILABLE],
                )
            )
            progress("simulating conditions", (k + 1) / len(groups))
    return out


def features(design: Design, recordings: list[Recording], windows: int) -> Features:
    """Run the estimator's own bank and windows over the recordings. Only its residuals and torque are used."""
    inputs, truth = [], []
    half = design.window_ticks // 2
    for r in recordings:
        ticks, _, n = r.z.shape
        estimator = Estimator(design, n)
        present = np.ones((2, n), dtype=bool)
        ratio = np.abs(r.torque) / (2 * design.normal_N * design.r_0)
        taken = {ticks - 1 - half * i for i in range(windows)}
        for k in range(ticks):
            estimator.step(Tick(k, r.z[k], present, ratio[k], r.speed_m_s))
            if k in taken:
                e = estimator.estimate()
                inputs.append(np.column_stack((np.log10(e.residuals), np.log10(np.maximum(e.torque_ratio, 1e-6)))))
                truth.append(r.mu_pct)
    return Features(np.concatenate(inputs), np.concatenate(truth))
