"""The conditions that a design is made from, and their simulation (the paper's Fig. 6, for any wheelset)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design import train_worlds
from sim_ecu.physics.contact import CreepCurve, curve_between, peak, traction_ratio
from sim_ecu.physics.rail import BLEND_M, RailSection, rail_table
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet, drawn
from sim_ecu.physics.simulation import Axle, Samples, Simulation, advance_side_by_side
from sim_ecu.physics.track import SPECTRA, Spectrum, Track
from sim_ecu.physics.wheelset import GRAVITY, LANES, OUTPUTS, Command, Wheelset

FloatArray = NDArray[np.float64]
SEEDS_PER_PLAN = 1_000_003  # seeds of a plan begin at its own seed times this
CURVATURE, RAMP_M_S2 = 1 / 1500, 0.8  # a lone wheelset's worlds: curves without cant, accelerations
CHANGES = (0.5, 1.25)  # of the time to settle, when the rail changes: windows begin right after, or later
# Slip cycles: how often, the share of a cycle in which it goes up; lowest and highest creep as shares of the peak's; or
# lowest and highest torque as utilisations, of a torque that the creep's limit takes over from.
CYCLE_HZ, CYCLE_RISE = (0.3, 1.2), (0.45, 0.8)
CREEP_LOW, CREEP_HIGH = (0.2, 0.5), (1.1, 2.4)
TORQUE_LOW, TORQUE_HIGH, TORQUE_LIMIT = (0.0, 0.4), (1.1, 1.8), (1.2, 2.2)
LIMIT = 1.3  # of the creep in all other conditions
TO_COASTING = 0.4  # of the torques that turn, those that end at 0
# Little torque is common on dry rails, and rare as the end of a slippery one's: of the coasting and turning conditions
# so many are dry, with a friction of so much.
ON_DRY, DRY = 0.5, (0.25, 0.65)
COASTS_ALONE = 0.3  # of a train's coasting conditions: those without any torque
TURN_S, TURN_TAKES_S = (0.5, 2.5), (0.3, 4.0)  # when a torque turns (or a curve begins), and how long it takes
UNSATURATED, END_SHARE = 0.5, (0.25, 0.95)  # of the rails that get worse: those that carry such a share of their peak
NOISE_FACTORS = (0.6, 2.2)  # of sensors noisier or quieter than their kind
OTHER_TORQUE = 0.5  # of the second wheelsets of a bogie: a motor may be off, or its wheels slip
TORQUE = ("utilisation", "creep_of_peak", "cycle_hz", "cycle_low", "cycle_rise", "limit_of_peak", "turns_to", "turns_s")
QUICK_PER_SPEED = 30  # of a plan in a hurry
BATCH = 2 * LANES  # conditions that are simulated in one call
Progress = Callable[[str, float], None]  # what is going on, share of it that is done


def quietly(what: str, share: float) -> None:
    """No progress is shown."""


@dataclass(frozen=True, slots=True)
class Condition:
    """One wheelset on one rail, or coming from another; the two of a bogie follow each other. Exactly one of
    utilisation and creep_of_peak is a number; negative when braking. Coming from another rail it keeps the torque that
    is the utilisation of that one.

    In slip cycles, as a wheel-slide protection makes them, the number is the highest, and cycle_low the lowest.
    """

    speed_m_s: float
    curve: CreepCurve
    track: Spectrum
    utilisation: float
    creep_of_peak: float
    seed: int
    before: CreepCurve | None = None  # the rail until changes_at_s
    changes_at_s: float = 0.0
    wheelset: Wheelset | None = None  # None: the one that the design is for
    sensors: SensorSet = SENSOR_SETS["mems"]
    curvature: float = 0.0
    cant_rad: float = 0.0
    curve_s: tuple[float, float] = (0.0, 0.0)  # when the curve begins, and how long its transition takes
    edge_m: float = BLEND_M  # over which the rail changes
    ramp_m_s2: float = 0.0
    cycle_hz: float = 0.0
    cycle_low: float = 0.0
    cycle_rise: float = 0.6
    limit_of_peak: float = LIMIT
    turns_to: float = math.nan  # utilisation that the torque goes to between turns_s
    turns_s: tuple[float, float] = (0.0, 0.0)
    trailing: bool = False  # the second wheelset of its bogie
    ahead_m: float = 0.0  # of where the way of the others begins


@dataclass(frozen=True, slots=True)
class Plan:
    """How the conditions of a design are drawn: in the design's own world, and at least as many in worlds that differ
    from it."""

    seed: int = 1
    speeds: int = 64
    per_speed: int = 160
    speed_range: tuple[float, float] = (3.2, 58.0)
    friction_range: tuple[float, float] = (0.022, 0.65)
    utilisation_range: tuple[float, float] = (0.0, 1.0)
    # Shares of the conditions; the rest has a torque that stays. held: at or about the peak by the creep controller.
    # slipping, let_go: slip cycles through the peak, of the creep, or of a torque that is taken back. turning: a torque
    # that goes up or down. changed: coming from another rail shortly before the windows.
    held_share: float = 0.13
    slipping_share: float = 0.06
    let_go_share: float = 0.07
    coasting_share: float = 0.05
    turning_share: float = 0.1
    changed_share: float = 0.17
    roughness_range: tuple[float, float] = (0.9, 4.0)  # times the good track's spectral density; its ends drawn more
    sensors: str = "mems"
    quiet_share: float = 0.15  # of the conditions, with tactical sensors
    noisy_share: float = 0.2  # with sensors of another noise than their kind's
    worlds: bool = True  # whether there are conditions in worlds that differ
    own_weight: float = 2.0  # of an undisturbed window in the design's own world, which is the likeliest
    settle_s: float = 1.5
    seconds: float = 3.5
    # Which quantile of the error an interval is to be, see `Features.covers`.
    covers_still: float = 0.78
    covers_moved: float = 0.88
    # where the estimate matters most; windows elsewhere weigh EDGE
    core_speeds: tuple[float, float] = (8.0, 52.0)
    core_utilisation: float = 0.14


def in_a_hurry(plan: Plan) -> Plan:
    """The plan with as many conditions as take five minutes."""
    return replace(plan, per_speed=min(plan.per_speed, QUICK_PER_SPEED))


@dataclass(frozen=True, slots=True)
class Group:
    """Conditions that share the vehicle's speed, as the axles of a train do."""

    speed_m_s: float
    ramp_m_s2: float
    conditions: tuple[Condition, ...]


def draw(plan: Plan, wheelset: Wheelset) -> list[Group]:
    """The groups of a plan, in the design's own world and in others by turns. In a bogie both wheelsets are recorded:
    that costs what one of them does."""
    rng = np.random.default_rng([plan.seed, 0])
    out: list[Group] = []
    slowest, fastest = plan.speed_range
    for k in range(plan.speeds):
        v = (slowest**0.5 + k / max(plan.speeds - 1, 1) * (fastest**0.5 - slowest**0.5)) ** 2
        most = RAMP_M_S2 if wheelset.bogie is None else train_worlds.BRAKES_M_S2
        elsewhere, others = (_elsewhere, 1) if wheelset.bogie is None else (_in_a_train, train_worlds.OTHERS)
        for other in (False, *[True] * others) if plan.worlds else (False,):
            ramp = float(rng.uniform(-most, most)) if other and rng.random() < train_worlds.SOME else 0.0
            ramp = min(max(ramp, (slowest - v) / plan.seconds), (fastest - v) / plan.seconds)
            first = plan.seed * SEEDS_PER_PLAN + len(out) * plan.per_speed
            group = []
            for i in range(plan.per_speed):
                one = replace(_one(plan, wheelset, float(v), first + i, rng), ramp_m_s2=ramp)
                group.append(elsewhere(one, wheelset, rng) if other else one)
            if (bogie := wheelset.bogie) is not None:
                pairs = zip(group[::2], group[1::2], strict=False)
                group = [c for pair in pairs for c in following(*pair, bogie.wheelbase_m, rng, trailing=True)]
            out.append(Group(float(v), ramp, tuple(group)))
    return out


def following(
    c: Condition, other: Condition, apart_m: float, rng: np.random.Generator, *, trailing: bool
) -> tuple[Condition, Condition]:
    """Two wheelsets on one track, so far apart; half of the second ones have another condition's torque. trailing:
    whether they share a bogie."""
    second = c
    if c.before is None and other.before is None and rng.random() < OTHER_TORQUE:
        second = replace(c, **{name: getattr(other, name) for name in TORQUE})
    return replace(c, ahead_m=apart_m), replace(second, trailing=trailing)


KINDS = ("held", "slipping", "let_go", "coasting", "turning", "changed")


def _one(plan: Plan, w: Wheelset, v: float, seed: int, rng: np.random.Generator) -> Condition:
    """Any condition at a speed, in the design's own world."""
    edges = np.cumsum([getattr(plan, f"{name}_share") for name in KINDS])
    kind = (*KINDS, "steady")[int(np.searchsorted(edges, rng.random(), side="right"))]
    sign = -1.0 if rng.random() < 0.3 else 1.0
    on_dry = kind in ("coasting", "turning") and rng.random() < ON_DRY
    curve, before = (curve_between(math.exp(rng.uniform(*np.log(r)))) for r in
                     (DRY if on_dry else plan.friction_range, plan.friction_range))  # fmt: skip
    steady = Condition(
        speed_m_s=v,
        curve=curve,
        track=train_worlds.track(rng, plan.roughness_range, w.bogie is not None),
        utilisation=sign * float(rng.uniform(*plan.utilisation_range)),
        creep_of_peak=math.nan,
        seed=seed,
        sensors=_sensors(plan, rng),
    )

    def drawn(ends: tuple[float, float]) -> float:
        return float(rng.uniform(*ends))

    match kind:
        case "held":
            creep = sign * float(rng.choice([1.0, rng.uniform(0.7, 1.6)]))
            return replace(steady, utilisation=math.nan, creep_of_peak=creep)
        case "slipping":
            return replace(
                steady, utilisation=math.nan, creep_of_peak=sign * drawn(CREEP_HIGH), cycle_hz=drawn(CYCLE_HZ),
                cycle_low=drawn(CREEP_LOW), cycle_rise=drawn(CYCLE_RISE),
            )  # fmt: skip
        case "let_go":
            return replace(
                steady, utilisation=sign * drawn(TORQUE_HIGH), cycle_hz=drawn(CYCLE_HZ), cycle_low=drawn(TORQUE_LOW),
                cycle_rise=drawn(CYCLE_RISE), limit_of_peak=drawn(TORQUE_LIMIT),
            )  # fmt: skip
        case "coasting":
            if w.bogie is None or rng.random() < COASTS_ALONE:
                return replace(steady, utilisation=0.0)
            most = train_worlds.COASTING * train_worlds.BRAKES_M_S2 / GRAVITY / peak(v, w.contact, *curve.row())[1]
            return replace(steady, utilisation=min(most, 1.0) * float(rng.uniform(-1.0, 1.0)))
        case "turning":
            to = 0.0 if rng.random() < TO_COASTING else sign * drawn(plan.utilisation_range)
            begins = drawn(TURN_S)
            return replace(steady, turns_to=to, turns_s=(begins, begins + drawn(TURN_TAKES_S)))
        case "changed":
            lower = peak(v, w.contact, *curve.row())[1] / peak(v, w.contact, *before.row())[1]
            if lower < 1.0 and rng.random() < UNSATURATED:
                steady = replace(steady, utilisation=sign * lower * drawn(END_SHARE))
            return replace(steady, before=before, changes_at_s=plan.settle_s * drawn(CHANGES))
    return steady


def _sensors(plan: Plan, rng: np.random.Generator) -> SensorSet:
    """Sensors of the plan's kind, tactical ones, or noisier and quieter ones."""
    s = SENSOR_SETS["tactical" if rng.random() < plan.quiet_share else plan.sensors]
    if rng.random() >= plan.noisy_share:
        return s
    gyro, accel = (math.exp(rng.uniform(*np.log(NOISE_FACTORS))) for _ in range(2))
    return replace(
        s,
        yaw_rate=replace(s.yaw_rate, noise_rms=s.yaw_rate.noise_rms * gyro),
        lat_accel=replace(s.lat_accel, noise_rms=s.lat_accel.noise_rms * accel),
    )


def _elsewhere(c: Condition, w: Wheelset, rng: np.random.Generator) -> Condition:
    """The same condition of a lone wheelset in a world that is not as the design thinks."""
    off = {name: getattr(w, name) * train_worlds.off(rng, most) for name, most in train_worlds.OFF.items()}
    k_A = train_worlds.off(rng, train_worlds.OFF_K_A)
    return replace(
        c,
        wheelset=replace(w, **off),
        sensors=train_worlds.off_sensors(c.sensors, rng),
        curve=replace(c.curve, k_A=c.curve.k_A * k_A),
        before=None if c.before is None else replace(c.before, k_A=c.before.k_A * k_A),
        curvature=CURVATURE * (train_worlds.off(rng, 1.0) - 1.0) if rng.random() < train_worlds.SOME else 0.0,
    )


def _in_a_train(c: Condition, w: Wheelset, rng: np.random.Generator) -> Condition:
    """The same condition in a train's world: its vehicle off, its slopes often not those of the friction, in curves,
    with film edges of any length, often with sensors that sample inside a shaken axle box."""
    factor = train_worlds.slope_factor(rng) if rng.random() < train_worlds.UNTIED else 1.0
    k_A = train_worlds.off(rng, train_worlds.OFF_K_A)

    def other(curve: CreepCurve) -> CreepCurve:
        return train_worlds.off_slope(replace(curve, k_A=curve.k_A * k_A), factor)

    curvature, cant, curve_s = 0.0, 0.0, (0.0, 0.0)
    if rng.random() < train_worlds.SOME:
        curvature, cant = train_worlds.curve_and_cant(c.speed_m_s, rng)
        if c.before is None and rng.random() < train_worlds.BEGINS:
            curve_s = float(rng.uniform(*TURN_S)), float(rng.uniform(*train_worlds.TRANSITION_S))
    return replace(
        c,
        track=train_worlds.smoother(c.track, rng) if rng.random() < train_worlds.SMOOTH else c.track,
        wheelset=train_worlds.off_vehicle(w, rng),
        sensors=train_worlds.off_sensors(drawn(rng) if rng.random() < train_worlds.SAMPLED else c.sensors, rng),
        curve=other(c.curve),
        before=None if c.before is None else other(c.before),
        curvature=curvature,
        cant_rad=cant,
        curve_s=curve_s,
        edge_m=math.exp(rng.uniform(*np.log(train_worlds.EDGE_M))) if rng.random() < train_worlds.SOME else BLEND_M,
    )


def held_at(w: Wheelset, curve: CreepCurve, creep_of_peak: float, speed_m_s: float, seed: int) -> Condition:
    """A wheelset held at a share of its curve's peak creep, on a good track.

    The creep controller holds the peak. Below the peak the torque that belongs to the creep does: on the steep part of
    a dry curve the controller takes more than 4 s to get there.
    """
    creep, mu = peak(speed_m_s, w.contact, *curve.row())
    share = traction_ratio(creep_of_peak * creep, speed_m_s, w.contact, *curve.row()) / mu
    demand = (math.nan, creep_of_peak) if creep_of_peak >= 1.0 else (share, math.nan)
    return Condition(speed_m_s, curve, SPECTRA["good"], *demand, seed)


def command(samples: int, axles: int = 1, **given: float | FloatArray) -> Command:
    """A command that is the same in every sample, or given per sample; what is not named is not given."""
    return Command(
        *(
            np.ascontiguousarray(np.broadcast_to(np.asarray(given.get(f, math.nan), float), (samples, axles)))
            for f in Command._fields
        )
    )


def _course(n: int, c: Condition, tick_s: float) -> FloatArray:
    """(n, 1): the condition's number over the time; it comes up within the first 0.5 s."""
    t = np.arange(1, n + 1) * tick_s
    up = np.minimum(t / 0.5, 1.0)
    highest = c.utilisation if math.isnan(c.creep_of_peak) else c.creep_of_peak
    if not c.cycle_hz:
        to = highest if math.isnan(c.turns_to) else c.turns_to
        return np.asarray(up * np.interp(t, [*c.turns_s, c.turns_s[1] + 1.0], [highest, to, to]))[:, None]
    phase = t * c.cycle_hz % 1.0
    rising = np.where(phase < c.cycle_rise, phase / c.cycle_rise, (1.0 - phase) / (1.0 - c.cycle_rise))
    low = math.copysign(c.cycle_low, highest)
    return np.asarray(up * (low + (highest - low) * rising))[:, None]


def simulate(w: Wheelset, c: Condition, seconds: float, tick_s: float) -> Samples:
    """Play a condition."""
    sim, drive = _ready(w, [c], seconds, tick_s)
    return sim.advance(drive, _held_speed(c, seconds, tick_s))


def simulate_group(w: Wheelset, conditions: Sequence[Condition], seconds: float, tick_s: float) -> FloatArray:
    """Play conditions that share the vehicle's speed, side by side: all alone, or all in twos, each two in a bogie.
    Returns (ticks, OUTPUTS, n)."""
    held_speed = _held_speed(conditions[0], seconds, tick_s)
    out = np.empty((len(held_speed), OUTPUTS, len(conditions)))
    each = 2 if len(conditions) > 1 and all(c.trailing for c in conditions[1::2]) else 1
    trains = [conditions[i : i + each] for i in range(0, len(conditions), each)]
    # neighbours of like stiffness take steps alike
    order = np.argsort([-max(_stiffness(w, c) for c in train) for train in trains], kind="stable")
    for batch in (order[i : i + BATCH // each] for i in range(0, len(order), BATCH // each)):
        sims, drives = zip(*(_ready(w, trains[k], seconds, tick_s) for k in batch.tolist()), strict=True)
        together = Command(*(np.concatenate(parts, axis=1) for parts in zip(*drives, strict=True)))
        places = (each * batch[:, None] + np.arange(each)).ravel()
        out[:, :, places] = advance_side_by_side(sims, together, held_speed)[0].swapaxes(1, 2)
    return out


def _stiffness(w: Wheelset, c: Condition) -> float:
    """What goes with the number of a condition's integration steps at its speed: the steeper of its creep curves."""
    return (c.wheelset or w).contact.stiffness_N * max(k.k_A + k.k_S for k in (c.curve, c.before or c.curve))


def _held_speed(c: Condition, seconds: float, tick_s: float) -> FloatArray:
    return np.asarray(c.speed_m_s + c.ramp_m_s2 * tick_s * np.arange(1, round(seconds / tick_s) + 1))


def _ready(w: Wheelset, train: Sequence[Condition], seconds: float, tick_s: float) -> tuple[Simulation, Command]:
    """The vehicle of conditions, one or both of a bogie, on its track, and what drives it."""
    c = train[0]
    track, n = Track(c.track, c.seed), round(seconds / tick_s)
    axles = [Axle(rail_table(_rail(c)), track, c.ahead_m, c.trailing) for c in train]
    drives = [_drive(c.wheelset or w, c, n, tick_s) for c in train]
    together = Command(*(np.concatenate(parts, axis=1) for parts in zip(*drives, strict=True)))
    return Simulation(c.wheelset or w, axles, c.speed_m_s, tick_s), together


def _rail(c: Condition) -> list[RailSection]:
    rail = [RailSection(0.0, c.curve, c.curvature, c.cant_rad)]
    if c.curve_s[0] > 0.0:
        from_m, transition_m = (c.speed_m_s * s for s in c.curve_s)
        return [RailSection(0.0, c.curve), rail[0]._replace(from_m=from_m, transition_m=transition_m)]
    if c.before is None:
        return rail
    at = max(c.changes_at_s * (c.speed_m_s + 0.5 * c.ramp_m_s2 * c.changes_at_s) - c.edge_m, 0.1)
    return [
        RailSection(0.0, c.before, c.curvature, c.cant_rad),
        RailSection(at, c.curve, c.curvature, c.cant_rad, edge_m=c.edge_m),
    ]


def _drive(w: Wheelset, c: Condition, n: int, tick_s: float) -> Command:
    course = _course(n, c, tick_s)
    if not math.isnan(c.creep_of_peak):
        return command(n, creep_of_peak=course, limit_of_peak=c.limit_of_peak)
    if c.before is None:
        return command(n, utilisation=course, limit_of_peak=c.limit_of_peak)
    carried = peak(c.speed_m_s, w.contact, *c.before.row())[1] * 2 * w.normal_N * w.r_0
    return command(n, torque=course * carried, limit_of_peak=c.limit_of_peak)
