"""The equations of `wheelset` in time: Runge-Kutta, 4th order, for the axles of a train or for a batch of vehicles."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.compiled import compiled
from sim_ecu.physics.contact import Contact, peak
from sim_ecu.physics.rail import CANT, rail_at, read_rail
from sim_ecu.physics.track import ALIGNMENT, CROSS_LEVEL, between_nodes
from sim_ecu.physics.track import GAUGE as GAUGE_COLUMN
from sim_ecu.physics.wheelset import (
    ACCEL,
    AXLE_STATES,
    BLOCK,
    BOGIE,
    BOGIE_STATES,
    CONSTANTS,
    CREEP_AT_PEAK,
    DRIVE,
    FORCE,
    FRAME_ACCEL,
    FRAME_LAT_ACCEL,
    FRAME_YAW,
    FRAME_YAW_RATE,
    GAUGE,
    HELD,
    LANES,
    LAT_ACCEL,
    LEVEL,
    MU_AVAILABLE,
    MU_USED,
    OUTPUTS,
    ROLL_RATE,
    ROLLING_START,
    SLIP,
    STATES,
    TORQUE,
    TRACK,
    W_L,
    W_R,
    YAW,
    YAW_RATE,
    Command,
    Constants,
    D,
    FloatArray,
    IntArray,
    P,
    R,
    X,
    Y,
    derivatives,
)

BoolArray = NDArray[np.bool_]

# Integration step: the longest allowed, and the longest relative to the fastest decay of the contact (RK4 is stable
# to 2.8; 0.35 keeps the outputs within 1e-3 of half that step, see the convergence test).
MAX_STEP_S = 5.0e-4
STEP_TIMES_RATE = 0.35

# Rows of the integration behind those of the equations: the state at a step's beginning, what the four stages add up
# to, the step (s), how many there are in the sample, and the sums of the outputs.
BEGIN, SUM = BLOCK, BLOCK + STATES * LANES
STEP, STEPS = BLOCK + 2 * STATES * LANES, BLOCK + (2 * STATES + 1) * LANES
OUT = STEPS + LANES
ROWS = OUT + OUTPUTS * LANES
_V, _DISTANCE, _W_R, _W_L = (q * LANES for q in (AXLE_STATES, AXLE_STATES + 1, W_R, W_L))
_R_0, _L_G, _GAMMA, _I_R, _I_L, _N, _LIMIT = (
    P + Constants._fields.index(name) * LANES for name in ("r_0", "L_g", "gamma", "I_R", "I_L", "N", "torque_limit")
)
_NORMAL, _STIFFNESS = (P + (len(Constants._fields) + k) * LANES for k in range(2))
# What is kept of an axle's newest peak: the speed and the curve's five numbers that it is of, and where it lies.
PEAK_CREEP, PEAK_MU = 6, 7
PEAK_COLUMNS = 8


@compiled
def _drive_torque(b: FloatArray, j: int, demand: float, limit: float, integral: float) -> tuple[float, float]:
    """Creep controller: the demanded torque unless creep would pass the limit (both signed). Torque, integral.

    No demand is coasting: there is no torque that could be limited.
    """
    if demand == 0.0:
        return 0.0, 0.0
    v, r_0, most = b[BEGIN + _V + j], b[_R_0 + j], b[_LIMIT + j]
    u = max(v, ROLLING_START)
    inertia = b[_I_R + j] + b[_I_L + j]
    slip = (b[_I_R + j] * b[BEGIN + _W_R + j] + b[_I_L + j] * b[BEGIN + _W_L + j]) / inertia * r_0 - v
    error = limit * u - slip  # m/s
    gain = inertia / r_0 * 40.0  # 40 rad/s: well below the shaft's 374 rad/s
    held = gain * error + integral
    torque = min(demand, held) if limit >= 0 else max(demand, held)
    torque = min(max(torque, -most), most)
    # back-calculation, 50 ms: the integral follows while something else decides the torque
    integral += b[STEP + j] * (gain * 12.0 * error - (held - torque) / 0.05)
    return torque, integral


@compiled
def _brake(b: FloatArray, n: int, holds: FloatArray, drive: FloatArray, weight: float) -> None:
    """What brakes do at a stage, beside the drive, and its share in the torque's mean.

    Friction, as sure as the step resolves: it is whole unless it would stop the driven wheel within a step, and goes
    straight through zero there. So a locked wheel turns by less than what the rail adds to it in one step.
    """
    for j in range(n):
        if holds[j] > 0.0 and b[STEP + j] > 0.0:
            share = b[X + _W_R + j] * b[_I_R + j] / (holds[j] * b[STEP + j])
            torque = holds[j] * min(max(share, -1.0), 1.0)
            b[DRIVE + j] = drive[j] - torque
            b[OUT + TORQUE * LANES + j] -= torque * weight / b[STEPS + j]


@compiled
def _peak_at(rail: FloatArray, distance_m: float, speed_m_s: float, c: Contact, known: FloatArray) -> None:
    """The peak at a place and a speed, in known (PEAK_COLUMNS,); searched for only where it is another than before."""
    r = rail_at(rail, distance_m)
    same = known[0] == speed_m_s
    for j in range(5):
        same = same and known[1 + j] == r[j]
    if not same:
        known[0], known[1:6] = speed_m_s, r[:5]
        known[PEAK_CREEP], known[PEAK_MU] = peak(speed_m_s, c, r[0], r[1], r[2], r[3], r[4])


@compiled
def _stage(b: FloatArray, n: int, weight: float, lead: float) -> None:
    """Derivatives at X: their share of the step, and X for the next stage, lead of a step ahead of the beginning."""
    for j in range(n):
        part, ahead = b[STEP + j] * weight, lead * b[STEP + j]
        for q in range(STATES):
            d = b[D + q * LANES + j]
            b[SUM + q * LANES + j] += part * d
            b[X + q * LANES + j] = b[BEGIN + q * LANES + j] + ahead * d


@compiled
def _outputs(b: FloatArray, n: int, weight: float) -> None:
    """A stage's share in the means over the sample; none of a lane that has finished: its STEPS are infinite."""
    for j in range(n):
        share = weight / b[STEPS + j]
        v = b[X + _V + j]
        b[OUT + YAW_RATE * LANES + j] += share * b[YAW + j]
        b[OUT + LAT_ACCEL * LANES + j] += share * b[ACCEL + j]
        b[OUT + FRAME_YAW_RATE * LANES + j] += share * b[FRAME_YAW + j]
        b[OUT + FRAME_LAT_ACCEL * LANES + j] += share * b[FRAME_ACCEL + j]
        b[OUT + MU_USED * LANES + j] += share * b[FORCE + j] / (2 * b[_N + j])
        slip = 0.5 * b[_R_0 + j] * (b[X + _W_R + j] + b[X + _W_L + j]) - v
        b[OUT + SLIP * LANES + j] += share * slip / max(v, ROLLING_START)


class Rides(NamedTuple):
    """What n axles run on, and what they are; arrays of all, one after another.

    Axle i's rail table is rails[first_rail[i]:first_rail[i + 1]]. Node k of its track is nodes[base[i] + k], for k from
    its first one at hand to before[i]; the track's first node lies at start[i] (m). rolls[i]: whether it has
    cross-level or gauge. No bogie goes over a multiple of LANES, nor a train whose speed is not held.
    """

    position: FloatArray  # (n,) m, ahead of the train's own distance
    rails: FloatArray
    first_rail: IntArray  # (n + 1,)
    nodes: FloatArray  # (…, NODE_COLUMNS)
    base: IntArray  # (n,)
    first_node: IntArray  # (n,)
    before: IntArray  # (n,)
    start: FloatArray  # (n,)
    numbers: FloatArray  # (n, CONSTANTS): Constants, then Contact
    rolls: BoolArray  # (n,)
    stiffest: FloatArray  # (n,) m/s2: the fastest decay of the contact times speed
    suspended: FloatArray  # (n,) 1/s: the fastest of the suspension
    leader: IntArray  # (n,): the first axle of its bogie; -1 where the wheelset's spring stands on the ground
    head: IntArray  # (n,): the first axle of its train


@compiled
def _read_track(
    b: FloatArray, j: int, nodes: FloatArray, base: int, first: int, before: int, x: float, rolls: bool
) -> None:
    """The irregularity under lane j at a place, x from its track's first node. It takes what it needs of `Rides`, not
    the whole: to hand over that many arrays takes longer than the rest."""
    b[TRACK + j] = between_nodes(nodes, base, first, before, x, ALIGNMENT)
    if rolls:
        b[LEVEL + j] = between_nodes(nodes, base, first, before, x, CROSS_LEVEL)
        b[GAUGE + j] = between_nodes(nodes, base, first, before, x, GAUGE_COLUMN)


@compiled
def _roll(b: FloatArray, j: int, rides: Rides, i: int) -> float:
    """The roll (rad, left side up) of a wheelset at the beginning of a step: that of the rail, and what it adds by its
    place on it."""
    at_m = b[BEGIN + _DISTANCE + j] + rides.position[i]
    read_rail(rides.rails, rides.first_rail[i], rides.first_rail[i + 1], at_m, b, R + j, LANES)
    _read_track(b, j, rides.nodes, rides.base[i], rides.first_node[i], rides.before[i], at_m - rides.start[i],
                rides.rolls[i])  # fmt: skip
    displaced = b[BEGIN + Y * LANES + j] - b[TRACK + j]
    roll: float = b[R + CANT * LANES + j] + b[LEVEL + j] + b[_GAMMA + j] / b[_L_G + j] * displaced
    return roll


@compiled
def integrate(
    state: FloatArray, bogie: FloatArray, train: FloatArray, integral: FloatArray, rides: Rides, command: Command,
    brake: FloatArray, held_speed: FloatArray, sample_s: float, step_scale: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Advance n axles by len(held_speed) sample intervals, in place.

    state (n, 7), bogie (n, BOGIE_STATES) with its first axle, train (n, 2) of each one's v and distance, integral (n,)
    of its controller are read, and left at the end of the last interval. brake (samples, n) is what a brake can hold
    (N m, no less than 0), beside the command: it opposes the wheel's turning, and holds a wheel that stands. held_speed
    (samples,) is the speed at the end of each interval, NaN where the vehicle moves freely.
    Returns outputs (samples, n, OUTPUTS), means over the interval except MU_AVAILABLE and CREEP_AT_PEAK (at its end),
    and (samples, n, 2) with v and distance at the end. The step follows each vehicle's speed.
    """
    samples, axles = held_speed.shape[0], state.shape[0]
    out, journey = np.empty((samples, axles, OUTPUTS)), np.empty((samples, axles, 2))
    b = np.zeros(ROWS)
    demand, limit, left = np.empty(LANES), np.empty(LANES), np.empty(LANES, np.int64)
    drive, holds = np.empty(LANES), np.zeros(LANES)
    weight = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    lead = np.array([0.0, 0.5, 0.5, 1.0, 0.0])
    leader, head, size = np.full(LANES, -1), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    rolled = np.zeros(LANES)
    shortest = int(np.ceil(sample_s / MAX_STEP_S))
    nodes, base, first_node, before = rides.nodes, rides.base, rides.first_node, rides.before
    start, rolls = rides.start, rides.rolls
    for first in range(0, axles, LANES):
        n = min(LANES, axles - first)
        peaks = np.zeros((n, PEAK_COLUMNS))
        b[LEVEL : LEVEL + LANES] = b[GAUGE : GAUGE + LANES] = 0.0
        size[:] = 0
        for j in range(n):
            leader[j] = rides.leader[first + j] - first if rides.leader[first + j] >= 0 else -1
            # of a train that goes over LANES, whose speed is held, the first of those here: nobody asks for the pull
            head[j] = max(rides.head[first + j] - first, 0)
            size[head[j]] += 1
        for j in range(n):
            size[j] = size[head[j]]
            i = first + j
            for q in range(AXLE_STATES):
                b[BEGIN + q * LANES + j] = state[i, q]
            b[BEGIN + _V + j], b[BEGIN + _DISTANCE + j] = train[i]
            for q in range(BOGIE_STATES):
                b[BEGIN + (BOGIE + q) * LANES + j] = bogie[i, q]
            for q in range(CONSTANTS):
                b[P + q * LANES + j] = rides.numbers[i, q]
            rolled[j] = _roll(b, j, rides, i)
        for s in range(samples):
            most = 0
            braked = False
            for j in range(n):
                i = first + j
                c = Contact(b[_NORMAL + j], b[_STIFFNESS + j])
                v = b[BEGIN + _V + j]
                rail = rides.rails[rides.first_rail[i] : rides.first_rail[i + 1]]
                _peak_at(rail, b[BEGIN + _DISTANCE + j] + rides.position[i], max(v, ROLLING_START), c, peaks[j])
                creep_peak, mu_peak = peaks[j, PEAK_CREEP], peaks[j, PEAK_MU]
                wanted = command.creep[s, i]
                if np.isnan(wanted):
                    wanted = command.creep_of_peak[s, i] * creep_peak
                if np.isnan(wanted):
                    demand[j] = command.torque[s, i]
                    if np.isnan(demand[j]):
                        demand[j] = command.utilisation[s, i] * mu_peak * 2 * b[_N + j] * b[_R_0 + j]
                    limit[j] = command.limit_of_peak[s, i] * creep_peak * np.sign(demand[j])
                else:
                    demand[j] = b[_LIMIT + j] * np.sign(wanted)
                    limit[j] = wanted
                # brakes hold, they do not drive backwards: they let go as the wheel stops
                if demand[j] < 0:
                    demand[j] *= min(1.0, max(0.0, b[BEGIN + _W_R + j] * b[_R_0 + j] / 0.5))
                rate = max(rides.stiffest[i] / max(v, ROLLING_START), rides.suspended[i])
                steps = int(max(shortest, int(np.ceil(sample_s * rate / STEP_TIMES_RATE))) * step_scale)
                left[j], most = steps, max(most, steps)
                holds[j] = brake[s, i]
                braked = braked or holds[j] > 0.0
                b[HELD + j] = (held_speed[s] - v) / sample_s
                b[STEP + j], b[STEPS + j] = sample_s / steps, steps
                for q in range(OUTPUTS):
                    b[OUT + q * LANES + j] = 0.0
            busy = n
            for step in range(most):
                while left[busy - 1] <= step:
                    busy -= 1
                for j in range(busy):
                    if left[j] > step:
                        torque, integral[first + j] = _drive_torque(b, j, demand[j], limit[j], integral[first + j])
                        b[DRIVE + j] = drive[j] = torque
                        b[OUT + TORQUE * LANES + j] += torque / left[j]
                    else:
                        b[STEP + j], b[STEPS + j] = 0.0, np.inf
                for q in range(STATES * LANES):
                    b[X + q] = b[SUM + q] = b[BEGIN + q]
                for k in range(4):
                    for j in range(busy):
                        i = first + j
                        at = b[X + _DISTANCE + j] + rides.position[i]
                        if rides.first_rail[i + 1] - rides.first_rail[i] > 1:
                            read_rail(rides.rails, rides.first_rail[i], rides.first_rail[i + 1], at, b, R + j, LANES)
                        _read_track(b, j, nodes, base[i], first_node[i], before[i], at - start[i], rolls[i])
                    if braked:
                        _brake(b, busy, holds, drive, weight[k])
                    derivatives(b, busy, leader, head, size)
                    _outputs(b, busy, weight[k])
                    _stage(b, busy, weight[k], lead[k + 1])
                for q in range(STATES * LANES):
                    b[BEGIN + q] = b[SUM + q]
                for j in range(busy):
                    b[BEGIN + _V + j] = max(b[BEGIN + _V + j], 0.0)
            for j in range(n):
                i = first + j
                c = Contact(b[_NORMAL + j], b[_STIFFNESS + j])
                v, distance = b[BEGIN + _V + j], b[BEGIN + _DISTANCE + j]
                rail = rides.rails[rides.first_rail[i] : rides.first_rail[i + 1]]
                _peak_at(rail, distance + rides.position[i], max(v, ROLLING_START), c, peaks[j])
                for q in range(OUTPUTS):
                    out[s, i, q] = b[OUT + q * LANES + j]
                roll = _roll(b, j, rides, i)
                out[s, i, ROLL_RATE], rolled[j] = (roll - rolled[j]) / sample_s, roll
                out[s, i, MU_AVAILABLE], out[s, i, CREEP_AT_PEAK] = peaks[j, PEAK_MU], peaks[j, PEAK_CREEP]
                journey[s, i, 0], journey[s, i, 1] = v, distance
        for j in range(n):
            for q in range(AXLE_STATES):
                state[first + j, q] = b[BEGIN + q * LANES + j]
            for q in range(BOGIE_STATES):
                bogie[first + j, q] = b[BEGIN + (BOGIE + q) * LANES + j]
            train[first + j, 0], train[first + j, 1] = b[BEGIN + _V + j], b[BEGIN + _DISTANCE + j]
    return out, journey
