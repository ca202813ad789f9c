"""How a design judges its pairs of sensors: simulated pairs of every state, and the network that tells them apart."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import TURN_S, Condition, Group, Plan, Progress, following, quietly, simulate_group
from sim_ecu.design.recordings import Recording, measured
from sim_ecu.design.rules import quantiles
from sim_ecu.design.side_by_side import SideBySide
from sim_ecu.design.train_worlds import TRANSITION_S, curve_and_cant
from sim_ecu.jobs.pool import Workers
from sim_ecu.jobs.whole import each
from sim_ecu.physics.wheelset import Wheelset
from wrcd.core.design import Design, HealthModel
from wrcd.core.estimator import evidence, step_through
from wrcd.core.records import Ticks
from wrcd.core.terms import CERTAIN, MAX_FEATURE, PAIR_FEATURES, PAIR_OWN, SPAN_TICKS, EstimateDoubt, PairState, Regime

FloatArray = NDArray[np.float64]
G = 9.80665
SOUND, DIES_FROM, DIES_TO = "sound", 0.3, 0.6  # shares of the recording in which a sensor dies
KMH = 3.6
LATE_S = (0.1, 0.3)
# What is made of a sound pair, and the state that it then is in.
BROKEN = {
    "reversed": PairState.REVERSED, "gyro dead": PairState.GYRO_DEAD, "accel dead": PairState.ACCEL_DEAD,
    "both dead": PairState.BOTH_DEAD, "other axle": PairState.OTHER_AXLE, "in g": PairState.WRONG_UNIT,
    "in degrees": PairState.WRONG_UNIT, "late": PairState.LATE, "gyro dies": PairState.GYRO_DEAD,
    "accel dies": PairState.ACCEL_DEAD, "both die": PairState.BOTH_DEAD,
}  # fmt: skip
EACH, SOUND_EACH = 2, 2  # of these, and of sound pairs, of every condition
# Partners: the other axle of the bogie, sound; the same, in the same state; an axle on another track; none.
PARTNERS, SHARES = ("sound", "alike", "elsewhere", "none"), (0.4, 0.25, 0.2, 0.15)
LOOKING = "looking at sensors"  # what goes on meanwhile
MOST_SPEEDS, MOST_PER_SPEED, SECONDS = 22, 80, 12.0  # of the plan's; conditions at each; of a recording
FIRST_SPAN = 6  # that is learnt from
KEEP, KEEP_SOUND = 0.3, 0.25  # shares of the spans
# Of the truths, by an interval; of estimates, or the rules' own spread counts; the least factor: at 0.5 for a saturated
# wheelset, of which the training has more than trains have, 45 % of other worlds' truths were held while it seemed so.
COVERS, MIN_ESTIMATES, LEAST = 0.87, 500, 0.8
# Intervals are wider than that by so much, those while coasting by more: worlds that were not trained in are less like
# these recordings. Of 128 bogies a world with wheel flats 3.5 % of the frames are Valid and wrong instead of 6.
WIDER, WIDER_COASTING = 1.2, 1.4
INTERVAL_SPEEDS = (3.5, 7.0, 14.0, 28.0, 56.0)  # m/s
# With 15 epochs 63 of 100 reversed gyros of a bogie were found in 10 s, with 40 it is 70, at as few accused.
HIDDEN, ALPHA, EPOCHS, BATCH = 96, 1.0, 40, 2048
HELD_OUT = 5  # so many networks judge how much counts: each is fitted to all but a part of the groups, and judges those
# Of the spans of sound pairs, by each state; more by those that a saturated wheelset looks like, or a slow one on
# smooth track: they are hardly found otherwise. Sound pairs of worlds unlike the training bear it, too: 0.1 % of their
# frames accuse a sensor. Of a dead accelerometer's evidence less counts: it is found within 7 s all the same. In stops
# on unlike tracks, at 3 to 5 m/s, sound ones were taken for dead in 3.2 % of the frames with 0.65, in none with 0.42. A
# pair on a smooth, dry ride was taken for dead with 1, not with 0.85; with 0.7 a tenth of dead ones is missed.
ACCUSED, ACCUSED_OF_SILENCE = 5e-4, 1e-3
MARGINS = {PairState.ACCEL_DEAD: 0.42, PairState.BOTH_DEAD: 0.85}
TURNS = 2  # a recording is judged over and over, and the last time counts: a train runs for longer
TEMPERS = np.geomspace(0.03, 1.0, 32)  # the shares of a span's evidence that are tried, one after another
# Of the log odds, at each span: with 0.97 (8 s) a third fewer dead gyros were found, at as many sound ones accused.
KEPT, PRIOR, HAZARD = 0.9, 1e-4, 1e-6
# Looks at pairs, and takes all of them for sound.
TRUSTING = HealthModel(
    middle=np.zeros(PAIR_FEATURES), scale=np.ones(PAIR_FEATURES), hidden=np.zeros((PAIR_FEATURES, 1)),
    hidden_bias=np.zeros(1), out=np.zeros((1, len(PairState))), out_bias=np.zeros(len(PairState)),
    temper=np.zeros(len(PairState)), log_prior=np.r_[0.0, np.full(len(PairState) - 1, -CERTAIN)], kept=1.0, hazard=0.0,
)  # fmt: skip


def require_learning() -> None:
    """Raise ModuleNotFoundError where the extra is missing that fits the network: before minutes of simulation."""
    import_module("sklearn.neural_network")


def plan_of(plan: Plan) -> Plan:
    """The conditions that pairs of sensors are looked at in: more of them at the peak, all longer, with seeds of their
    own."""
    return replace(
        plan, seed=plan.seed + 500, speeds=max(2, min(MOST_SPEEDS, plan.speeds)),
        per_speed=min(MOST_PER_SPEED, plan.per_speed), seconds=SECONDS, held_share=0.22, changed_share=0.12,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Watched:
    """What a group's pairs show: features (spans, lanes, PAIR_FEATURES), what each pair is in (spans, lanes), -1 where
    that does not count, its partner (lanes,), a place in PARTNERS, and whether its wheelset is held about the peak
    (lanes,). Of sound pairs' estimates at the spans' ends: error over half-width, the Regime and the speed (m,)."""

    features: NDArray[np.float16]
    state: NDArray[np.int8]
    partner: NDArray[np.int8]
    held: NDArray[np.bool_]
    off: NDArray[np.float32]
    regime: NDArray[np.int8]
    speed_m_s: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Lane:
    """A pair of sensors and the one beside it: signals (ticks, 2, 2), torque ratios (ticks, 2), what it is in (ticks,),
    a place in PARTNERS, and whether its wheelset is held about the peak."""

    z: FloatArray
    ratio: FloatArray
    state: NDArray[np.int8]
    partner: int
    held: bool


def watched(w: Wheelset, design: Design, plan: Plan, group: Group, place: int) -> Watched:
    """Simulate a group, both wheelsets of each bogie, break their sensors and look at them as the train does. A lone
    wheelset's worlds have curves without cant alone: its group runs once more, half of it in canted ones, and shaken
    where it was not: its groups are by turns of the design's own world and of others."""
    rng, shaken = np.random.default_rng([plan.seed, 3, place]), place % 2 == 0
    seen = _seen(w, design, plan, group, shaken, rng)
    if w.bogie is not None:
        return seen
    rng = np.random.default_rng([plan.seed, 3, place])
    curved = replace(group, conditions=tuple(_in_curve(c, rng) for c in group.conditions))
    return _joined(seen, _seen(w, design, plan, curved, not shaken, rng))


def _seen(w: Wheelset, design: Design, plan: Plan, group: Group, shaken: bool, rng: np.random.Generator) -> Watched:
    both = group.conditions
    if w.bogie is None:
        pairs = zip(both[::2], both[1::2], strict=False)
        both = tuple(c for pair in pairs for c in following(*pair, design.wheelbase_m, rng, trailing=False))
        group = replace(group, conditions=both)
    r = measured(group, simulate_group(w, both, plan.seconds, design.tick_s), design.tick_s, rng)
    z = (r.felt if shaken else r.z).astype(np.float64)
    noise = np.zeros_like(z)
    for i, c in enumerate(both):
        for k, sensor in enumerate((c.sensors.yaw_rate, c.sensors.lat_accel)):
            noise[:, k, i] = sensor.measure(np.zeros(len(z)), rng)
    held = [np.isfinite(c.creep_of_peak) and c.cycle_hz == 0.0 for c in both]
    lanes = _lanes(design, r, z, noise, held, rng)
    first = _watched(design, lanes, r.speed_m_s, r.mu_pct)
    if KMH * group.speed_m_s > design.speeds_m_s[-1]:
        return first
    sound = [lane for lane in lanes if not lane.state.any()][::SOUND_EACH]
    wrong = [replace(lane, state=np.full_like(lane.state, PairState.WRONG_UNIT)) for lane in sound]
    return _joined(first, _watched(design, wrong, KMH * r.speed_m_s, r.mu_pct))


def _joined(*parts: Watched) -> Watched:
    """Of several, with all their pairs; a wrong unit's have no estimates that count."""
    return Watched(*(np.concatenate([getattr(p, f.name) for p in parts], axis=-2 if f.name == "features" else -1)
                     for f in fields(Watched)))  # fmt: skip


def _in_curve(c: Condition, rng: np.random.Generator) -> Condition:
    """Half of the conditions of a lone wheelset, whose worlds have curves without cant alone: in a canted one, that
    begins on the way where the rail does not change. Gravity takes from the acceleration what the yaw rate shows."""
    if rng.random() < 0.5:
        return c
    curvature, cant = curve_and_cant(c.speed_m_s, rng)
    curve_s = float(rng.uniform(*TURN_S)), float(rng.uniform(*TRANSITION_S))
    return replace(c, curvature=curvature, cant_rad=cant, curve_s=curve_s if c.before is None else (0.0, 0.0))


def _lanes(
    d: Design, r: Recording, z: FloatArray, noise: FloatArray, held: Sequence[bool], rng: np.random.Generator
) -> list[Lane]:
    """Of every condition sound pairs with different kinds of partner, and broken ones; sound ones first."""
    ticks, _, n = z.shape
    ratio = np.abs(r.torque.astype(np.float64)) / (2 * d.normal_N * d.r_0)
    cases = [(i, SOUND, str(p)) for i in range(n) for p in rng.choice(PARTNERS, SOUND_EACH, replace=False)]
    for i in range(n):
        for name in rng.choice(list(BROKEN), EACH, replace=False):
            cases += [(i, str(name), str(rng.choice(PARTNERS, p=SHARES)))]
    out = []
    for i, name, partner in cases:
        begins = int(ticks * rng.uniform(DIES_FROM, DIES_TO)) if "die" in name else 0
        seed = int(rng.integers(2**31))
        beside = (i + 2) % n if partner == "elsewhere" else i ^ 1
        alike = partner == "alike" or (name == "other axle" and partner == "sound")  # wires are swapped in pairs
        pair = _broken(name, z, noise, i, begins, seed, d.tick_s)
        other = _broken(name, z, noise, beside, begins, seed, d.tick_s) if alike else z[:, :, beside]
        state = np.full(ticks, BROKEN.get(name, PairState.SOUND), np.int8)
        if begins:  # what it is in its first two spans is not learnt from
            state[:begins], state[begins : begins + 2 * SPAN_TICKS] = PairState.SOUND, -1
        two = np.stack((pair, other), axis=2)
        out.append(Lane(two, ratio[:, [i, beside]], state, PARTNERS.index(partner), held[i]))
    return out


def _watched(d: Design, lanes: Sequence[Lane], speed_m_s: FloatArray, mu_pct: NDArray[np.float32]) -> Watched:
    z = np.concatenate([lane.z for lane in lanes], axis=2)
    there = np.array([(True, PARTNERS[lane.partner] != "none") for lane in lanes]).reshape(-1)
    estimator = SideBySide(replace(d, health=TRUSTING, interval=None), z.shape[2])
    ends = np.arange(SPAN_TICKS - 1, len(z), SPAN_TICKS)
    ratio = np.concatenate([lane.ratio for lane in lanes], axis=1)
    ticks = Ticks(0, z, np.broadcast_to(there, z.shape), ratio, speed_m_s.tolist())
    stops = step_through(estimator, ticks.part(0, int(ends[-1]) + 1), ends[:-1].tolist(), resets=True)
    sound = [2 * k for k, lane in enumerate(lanes) if not lane.state.any()][::SOUND_EACH]
    asked = max(sound, default=0) + 1
    seen, found = zip(*((estimator.features()[::2], estimator.estimate(asked)) for _ in stops), strict=True)
    features = np.array(seen)
    # a pair's own features of its newest span stay where it has too little data in another one
    known = np.diff(features[..., :PAIR_OWN], axis=0, prepend=np.nan).any(axis=-1)
    state = np.where(known, np.stack([lane.state for lane in lanes], axis=1)[ends], -1)
    state[:FIRST_SPAN] = -1
    mu, half_width, regime = (
        np.stack([getattr(e, name)[sound] for e in found]) for name in ("mu_available_pct", "half_width_pp", "regime")
    )
    off = np.abs(mu - mu_pct[ends][:, : len(sound)]) / half_width
    usable = np.stack([e.doubt[sound] == EstimateDoubt.NONE for e in found]) & np.isfinite(off)
    usable[:FIRST_SPAN] = False
    speeds = np.broadcast_to(speed_m_s[ends][:, None], off.shape)
    return Watched(
        features=features.astype(np.float16),
        state=state.astype(np.int8),
        partner=np.array([lane.partner for lane in lanes], np.int8),
        held=np.array([lane.held for lane in lanes]),
        off=off[usable].astype(np.float32),
        regime=regime[usable].astype(np.int8),
        speed_m_s=speeds[usable].astype(np.float32),
    )


def _broken(name: str, z: FloatArray, noise: FloatArray, i: int, begins: int, seed: int, tick_s: float) -> FloatArray:
    """(ticks, 2): a pair's signals as they come when this is wrong from a tick on."""
    out = z[:, :, i].copy()
    if name in ("gyro dead", "both dead", "gyro dies", "both die"):
        out[begins:, 0] = noise[begins:, 0, i]
    if name in ("accel dead", "both dead", "accel dies", "both die"):
        out[begins:, 1] = noise[begins:, 1, i]
    if name == "reversed":
        out[:, 0] *= -1.0
    if name == "other axle":
        out[:, 1] = z[:, 1, i ^ 1]
    if name == "in g":
        out[:, 1] /= G
    if name == "in degrees":
        out[:, 0] = np.degrees(out[:, 0])
    if name == "late":
        rng = np.random.default_rng(seed)
        lag, which = round(rng.uniform(*LATE_S) / tick_s), int(rng.integers(2))
        out[lag:, which] = out[:-lag, which]
    return out


def intervals(parts: Sequence[Watched]) -> dict[str, Any]:
    """The design's part by which half-widths hold the truth in more than COVERS of what goes on at a speed: the
    quantile of the error over the half-width that the rules gave, from recordings that they were not fitted on, and
    WIDER."""
    off, regimes, speed = (np.concatenate([getattr(p, name) for p in parts]) for name in ("off", "regime", "speed_m_s"))
    nodes = np.log(INTERVAL_SPEEDS)
    at = np.interp(np.log(speed), nodes, np.arange(len(nodes)))
    factors = np.ones((len(Regime), len(nodes)))
    for (k, node), _ in np.ndenumerate(factors):
        here = (regimes == k) & (np.abs(at - node) < 1.0)
        if here.sum() >= MIN_ESTIMATES:
            factors[k, node] = max(LEAST, *quantiles(off[here], 1.0 - np.abs(at[here] - node), (COVERS,)))
        factors[k, node] *= WIDER_COASTING if k == Regime.COASTING else WIDER
    return {"regimes": [r.words for r in Regime], "speeds_m_s": INTERVAL_SPEEDS, "factors": factors}


def fit(parts: Sequence[Watched], progress: Progress = quietly, workers: Workers | None = None) -> dict[str, Any]:
    """The design's part that judges pairs: a network fitted to all groups, and for each state how much of its word
    counts, by what networks that were fitted to the others say of the sound pairs of every group. workers: whose
    processes do it; None: the caller's does. Raises Stopped where one of them cannot."""
    folds = min(HELD_OUT, len(parts))
    lots = [[p for k, p in enumerate(parts) if k % folds != fold] if folds > 1 else parts for fold in range(folds)]
    jobs = [chosen(lot) for lot in (parts, *lots)]
    names = ["the network of all groups", *(f"a network that judges part {k + 1}" for k in range(folds))]
    ends = enumerate(map(network, jobs)) if workers is None else each(network, jobs, workers, names)
    found = {}
    for place, result in ends:
        found[place] = result
        progress("learning to judge", len(found) / len(jobs))
    model, spans, loss = found[0]
    temper = tempers([(found[k + 1][0], parts[k::folds]) for k in range(folds)])
    return {
        "states": [s.words for s in PairState], "middle": model.middle, "scale": model.scale, "hidden": model.hidden,
        "hidden_bias": model.hidden_bias, "out": model.out, "out_bias": model.out_bias, "temper": temper,
        "prior": _prior(), "kept": KEPT, "hazard": HAZARD, "spans": spans, "loss": loss,
    }  # fmt: skip


def _prior() -> FloatArray:
    prior = np.full(len(PairState), PRIOR)
    prior[PairState.SOUND] = 1.0 - PRIOR * (len(PairState) - 1)
    return prior


def network(spans: tuple[NDArray[np.float16], NDArray[np.int8]]) -> tuple[HealthModel, int, float]:
    """How much likelier each state is than a sound pair, with no temper yet; how many spans that is of, and its loss on
    them. spans: features (n, PAIR_FEATURES) and states (n,)."""
    # an extra of its own: who has a design does not need it
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    x, y = spans[0].astype(np.float32), spans[1]
    middle, scale = x.mean(axis=0), x.std(axis=0) + 1e-6
    z = np.clip((x - middle) / scale, -MAX_FEATURE, MAX_FEATURE)
    net = MLPClassifier(
        (HIDDEN,), activation="tanh", batch_size=min(BATCH, len(y)), learning_rate_init=3e-3, max_iter=EPOCHS,
        alpha=ALPHA, random_state=0, tol=0.0,
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # no more epochs than these are meant
        net.fit(z, y)
    states = len(PairState)
    found, counts = net.classes_.astype(np.int64), np.bincount(y, minlength=states) / len(y)
    out, bias = np.zeros((HIDDEN, states)), np.full(states, -CERTAIN)  # a state that never came is not found
    out[:, found], bias[found] = net.coefs_[1], net.intercepts_[1] - np.log(counts[found])
    prior = _prior()
    model = HealthModel(
        middle, scale, net.coefs_[0], net.intercepts_[0], out, bias, np.zeros(states), np.log(prior / prior[0]),
        KEPT, HAZARD,
    )  # fmt: skip
    return model, len(y), float(net.loss_)


def chosen(parts: Sequence[Watched]) -> tuple[NDArray[np.float16], NDArray[np.int8]]:
    """Spans to learn from: one differs little from the next."""
    rng, x, y = np.random.default_rng(0), [], []
    for p in parts:
        share = np.where(p.state == PairState.SOUND, KEEP_SOUND, KEEP)
        keep = (p.state >= 0) & (rng.random(p.state.shape) < share)
        x.append(p.features[keep])
        y.append(p.state[keep])
    return np.concatenate(x), np.concatenate(y)


def tempers(held_out: Sequence[tuple[HealthModel, Sequence[Watched]]]) -> FloatArray:
    """(states,): of each state alone, as much of its evidence as leaves sound pairs unaccused in all but so much of the
    spans, or as one pair has, whatever their partner is, and of those that are held about the peak; of that the share
    in MARGINS.
    held_out: models and groups that they were not fitted to."""
    spoken, counts, kinds = (
        np.concatenate(rows, axis=-1) for rows in zip(*(_of_sound(m, p) for m, of in held_out for p in of), strict=True)
    )
    model, out = held_out[0][0], np.zeros(len(PairState))
    seen = counts.sum(axis=0)  # spans of each pair
    for state in list(PairState)[1:]:
        most = ACCUSED_OF_SILENCE if state in (PairState.GYRO_DEAD, PairState.BOTH_DEAD) else ACCUSED
        for temper in TEMPERS:
            odds = np.full(spoken.shape[2], model.log_prior[state])
            accused = np.zeros(len(kinds))
            for turn in range(TURNS):
                for e, known in zip(spoken[:, state], counts, strict=True):
                    new = model.log_prior[state] + model.kept * (odds - model.log_prior[state]) + temper * e
                    odds = np.where(known, np.clip(new, -CERTAIN, CERTAIN), odds)
                    accused += (turn == TURNS - 1) * (kinds @ (known & (odds > 0.0)))
            # of few pairs the unluckiest would say how much counts, and half of what is broken would not be found
            if (accused > np.maximum(most * (kinds @ seen), seen.max(initial=0))).any():
                break
            out[state] = MARGINS.get(state, 1.0) * temper
    return out


def _of_sound(model: HealthModel, p: Watched) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Of a group's sound pairs: evidence (spans, states, pairs), which spans count (spans, pairs), and which are of a
    kind (kinds, pairs): of each partner, and held about the peak."""
    sound = np.flatnonzero((p.state <= 0).all(axis=0))
    spoken = np.stack([evidence(model, x).T for x in p.features[:, sound].astype(np.float64)])
    kinds = np.array([*(p.partner[sound] == k for k in range(len(PARTNERS))), p.held[sound]], float)
    return spoken, p.state[:, sound] == PairState.SOUND, kinds
