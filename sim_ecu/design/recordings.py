"""What the sensors measure in the conditions of a plan, as the daemon gets it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import Condition, Group, Plan, Progress, draw, simulate_group
from sim_ecu.physics.axlebox import QUIET, AxleBox, drawn_box
from sim_ecu.physics.inertial import InertialStream
from sim_ecu.physics.wheelset import MU_AVAILABLE, TORQUE, Wheelset

FloatArray = NDArray[np.float32]
SIMULATING = "simulating conditions"  # what goes on meanwhile
UP_S = 0.5  # within which a torque comes up
SPEED_TICKS = 4  # the speed comes every so many ticks
# What an axle box feels in the disturbed copies: vibration above the band and in it, joints; m/s2, from … to.
VIBRATION, WHITE, JOINTS = (0.01, 1.2), (0.003, 0.15), (0.1, 2.5)


@dataclass(frozen=True, slots=True)
class Recording:
    """A group's sensors: z (ticks, 2, n), the same as disturbed axle boxes feel it, torque (ticks, n), speed (ticks,),
    the truth in percent (ticks, n); the tick (n,) from which on a condition is what it is; whether the torque stays
    from there on (n,); the design's own world or another."""

    z: FloatArray
    felt: FloatArray
    torque: FloatArray
    speed_m_s: NDArray[np.float64]
    mu_pct: FloatArray
    first: NDArray[np.int64]
    steady: NDArray[np.bool_]
    own_world: bool


def record(
    w: Wheelset, plan: Plan, tick_s: float, progress: Progress, groups: Sequence[Group] | None = None
) -> list[Recording]:
    """Record all groups, in this process. groups: others than the plan's, of which then only the seed of the noise and
    the length count."""
    groups = draw(plan, w) if groups is None else groups
    out = []
    for k, group in enumerate(groups):
        out.append(record_group(w, plan, tick_s, group, k))
        progress(SIMULATING, (k + 1) / len(groups))
    return out


def record_group(w: Wheelset, plan: Plan, tick_s: float, group: Group, place: int) -> Recording:
    """Simulate the group at a place of a plan (the long part: seconds) and add the sensors' noise."""
    outputs = simulate_group(w, group.conditions, plan.seconds, tick_s)
    return measured(group, outputs, tick_s, np.random.default_rng([plan.seed, 1, place]))


def measured(group: Group, y: NDArray[np.float64], tick_s: float, rng: np.random.Generator) -> Recording:
    """Return what the group's sensors make of a simulation y (ticks, outputs, n)."""
    ticks = len(y)
    z = np.empty((ticks, 2, y.shape[2]), np.float32)
    felt, torque = z.copy(), z[:, 0].copy()
    v: NDArray[np.float64] = np.asarray(group.speed_m_s + group.ramp_m_s2 * tick_s * np.arange(1, ticks + 1))
    distance: NDArray[np.float64] = np.cumsum(v) * tick_s
    for i, c in enumerate(group.conditions):
        inside = c.sensors.sampling is not None  # such a sensor's axle box is never calm
        shaken = InertialStream(c.sensors, drawn_box(rng) if inside else _axle_box(rng), tick_s, rng).next(
            y[:, :, i], distance, v
        )
        noise_seed = int(rng.integers(2**62))
        calm = InertialStream(c.sensors, drawn_box(rng) if inside else QUIET, tick_s, rng).next(y[:, :, i], distance, v)
        for into, pair in ((z, calm), (felt, shaken)):
            own = np.random.default_rng(noise_seed)
            into[:, 0, i] = c.sensors.yaw_rate.measure(pair[:, 0], own)
            into[:, 1, i] = c.sensors.lat_accel.measure(pair[:, 1], own)
        torque[:, i] = c.sensors.torque.measure(c.sensors.known_torque(y[:, TORQUE, i]), rng)
    speed = group.conditions[0].sensors.speed.measure(v[::SPEED_TICKS], rng)
    return Recording(
        z=z,
        felt=felt,
        torque=torque,
        speed_m_s=np.repeat(speed, SPEED_TICKS)[:ticks],
        mu_pct=(100 * y[:, MU_AVAILABLE]).astype(np.float32),
        first=np.array([_first(c, tick_s) for c in group.conditions]),
        steady=np.array([not c.cycle_hz and math.isnan(c.turns_to) for c in group.conditions]),
        own_world=all(c.wheelset is None for c in group.conditions),
    )


def _first(c: Condition, tick_s: float) -> int:
    """The tick from which on torque and rail stay; what is ahead meets the other rail earlier."""
    there_s = 0.0 if c.before is None else c.changes_at_s - c.ahead_m / c.speed_m_s + 0.05
    return round(max(there_s, UP_S) / tick_s)


def _axle_box(rng: np.random.Generator) -> AxleBox:
    def drawn(limits: tuple[float, float]) -> float:
        return math.exp(rng.uniform(*np.log(limits)))

    kind = rng.random()
    if kind < 0.35:
        return AxleBox(vibration_m_s2=drawn(VIBRATION))
    if kind < 0.6:
        return AxleBox(vibration_m_s2=drawn(WHITE), band_hz=(0.0, 100.0))
    shape = str(rng.choice(["bipolar", "unipolar"]))
    if kind < 0.9:
        return AxleBox(joint_m_s2=drawn(JOINTS), joint_shape=shape, joint_s=float(rng.uniform(0.02, 0.04)))
    return AxleBox(vibration_m_s2=drawn(VIBRATION), joint_m_s2=drawn(JOINTS), joint_shape=shape)
