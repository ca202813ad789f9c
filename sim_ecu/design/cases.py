"""Simulated conditions and the residuals that the bank shows in them (the paper's Fig. 6, for any wheelset)."""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.contact import CreepCurve, curve_between, peak
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.simulation import Axle, Samples, Simulation
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.wheelset import LAT_ACCEL, MU_AVAILABLE, TORQUE, YAW_RATE, Command, Wheelset
from sim_ecu.play.scenario import BLEND_M, rail_table
from wrcd.estimator.bank import Bank, scheduled_speed
from wrcd.estimator.design import Design
from wrcd.estimator.estimator import OFFSET_WINDOWS, rule_inputs
from wrcd.estimator.offset import Offset
from wrcd.estimator.window import Window

FloatArray = NDArray[np.float64]
SEEDS_PER_PLAN = 1_000_003  # seeds of a plan begin at its own seed times this
EDGE = 0.3  # importance of a window outside the plan's core
Progress = Callable[[str, float], None]  # what is going on, share of it that is done


@dataclass(frozen=True, slots=True)
class Condition:
    """One wheelset on one rail, or coming from another. Exactly one of utilisation and creep_of_peak is a number;
    negative when braking. Coming from another rail it keeps the torque that is the utilisation of that one."""

    speed_m_s: float
    curve: CreepCurve
    roughness: float
    utilisation: float
    creep_of_peak: float
    seed: int
    before: CreepCurve | None = None  # the rail until changes_at_s
    changes_at_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Plan:
    """How the conditions of a design are drawn."""

    seed: int = 1
    speeds: int = 24
    per_speed: int = 500
    speed_range: tuple[float, float] = (4.0, 58.0)
    friction_range: tuple[float, float] = (0.022, 0.65)
    utilisation_range: tuple[float, float] = (0.0, 1.0)
    held_share: float = 0.2  # of the conditions, held at or about the peak by the creep controller
    changed_share: float = 0.15  # of the conditions, coming from another rail shortly before the windows
    roughness_range: tuple[float, float] = (0.9, 4.0)  # times the good track's spectral density; its ends drawn more
    sensors: str = "mems"
    settle_s: float = 2.0
    windows: int = 2  # taken from each condition, half a window apart
    # where the estimate matters most; windows elsewhere weigh EDGE
    core_speeds: tuple[float, float] = (8.0, 52.0)
    core_utilisation: float = 0.14


def draw(plan: Plan) -> list[list[Condition]]:
    """Conditions, one list per speed (the bank shares its gains at a speed)."""
    rng = np.random.default_rng([plan.seed, 0])
    low, high = plan.roughness_range
    out = []
    for k in range(plan.speeds):
        share = k / max(plan.speeds - 1, 1)
        v = plan.speed_range[0] * (plan.speed_range[1] / plan.speed_range[0]) ** share
        group = []
        for i in range(plan.per_speed):
            kind = rng.random()
            held = kind < plan.held_share
            changed = not held and kind < plan.held_share + plan.changed_share
            sign = -1.0 if rng.random() < 0.3 else 1.0
            curve, before = (curve_between(math.exp(rng.uniform(*np.log(plan.friction_range)))) for _ in range(2))
            group.append(
                Condition(
                    speed_m_s=float(v),
                    curve=curve,
                    roughness=QUALITY["good"] * low * (high / low) ** (0.5 - 0.5 * math.cos(math.pi * rng.random())),
                    utilisation=math.nan if held else sign * rng.uniform(*plan.utilisation_range),
                    creep_of_peak=sign * float(rng.choice([1.0, rng.uniform(0.7, 1.6)])) if held else math.nan,
                    seed=plan.seed * SEEDS_PER_PLAN + k * plan.per_speed + i,
                    before=before if changed else None,
                    changes_at_s=plan.settle_s * float(rng.uniform(0.5, 0.95)),
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
    rail = [(0.0, c.curve, 0.0, 0.0)]
    if c.before is not None:
        rail = [(0.0, c.before, 0.0, 0.0), (c.changes_at_s * c.speed_m_s - BLEND_M, c.curve, 0.0, 0.0)]
    ramp = np.minimum(np.arange(1, n + 1) * tick_s / 0.5, 1.0)[:, None]
    sim = Simulation(w, [Axle(rail_table(rail), Track(c.roughness, c.seed))], c.speed_m_s, tick_s)
    if c.before is None:
        drive = command(n, utilisation=ramp * c.utilisation, creep_of_peak=ramp * c.creep_of_peak, limit_of_peak=1.3)
    else:
        carried = peak(c.speed_m_s, w.contact, *c.before.row())[1] * 2 * w.normal_N * w.r_0
        drive = command(n, torque=ramp * c.utilisation * carried, limit_of_peak=1.3)
    return sim.advance(drive, np.full(n, c.speed_m_s))


@dataclass(frozen=True, slots=True)
class Features:
    """One row per window. inputs (n, 6): what the rules are given (see `rule_inputs`); recent (n, 6): the same
    over the newest part of the window; differences (n, 4): decades between that part and the rest; the truth in percent
    (n,); condition (n,): its number."""

    inputs: FloatArray
    recent: FloatArray
    differences: FloatArray
    mu_pct: FloatArray
    condition: NDArray[np.int64]

    def importance(self, plan: Plan) -> FloatArray:
        """Weight of each window in the fit: less at the edges of the plan, more at speed."""
        speed = 10.0 ** self.inputs[:, 5]
        utilisation = 100.0 * 10.0 ** self.inputs[:, 4] / self.mu_pct
        low, high = plan.core_speeds
        core = (speed >= low) & (speed <= high) & (utilisation >= plan.core_utilisation)
        # the speeds are drawn evenly in the logarithm; trains run evenly in the speed
        return np.where(core, 1.0, EDGE) * (np.clip(speed, low, high) / high) ** 0.5


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
    """Run the train's own bank and window over the recordings. Of the design only the bank is used."""
    inputs: list[FloatArray] = []
    recent: list[FloatArray] = []
    differences, truth, condition = [], [], []
    half = design.window_ticks // 2
    first = 0
    for r in recordings:
        ticks, _, n = r.z.shape
        offset, bank = Offset(OFFSET_WINDOWS * design.window_ticks, n), Bank(design, n)
        window = Window(design.window_ticks, design.recent_ticks, n)
        present, good = np.ones((2, n), dtype=bool), np.ones(n, dtype=bool)
        ratio = np.abs(r.torque) / (2 * design.normal_N * design.r_0)
        speed = scheduled_speed(r.speed_m_s, design.speeds_m_s)
        taken = {ticks - 1 - half * i for i in range(windows)}
        for k in range(ticks):
            _, w = bank.step(offset.take(r.z[k], present), present, r.speed_m_s)
            window.put(k, w, good, ratio[k])
            if k not in taken:
                continue
            for rows, residuals, torque in (
                (inputs, window.residuals(), window.torque_ratio()),
                (recent, window.recent_residuals(), window.recent_torque_ratio()),
            ):
                rows.append(rule_inputs(design, residuals, torque, speed))
            differences.append(window.differences())
            truth.append(r.mu_pct)
            condition.append(first + np.arange(n))
        first += n
    return Features(
        np.concatenate(inputs),
        np.concatenate(recent),
        np.concatenate(differences),
        np.concatenate(truth),
        np.concatenate(condition),
    )
