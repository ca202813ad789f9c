"""How a design judges its pairs of sensors: simulated pairs of every state, and the network that tells them apart."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import Group, Plan, simulate_group
from sim_ecu.design.recordings import Recording, measured
from sim_ecu.design.rules import quantiles
from sim_ecu.physics.wheelset import Wheelset
from wrcd.estimator.design import Design, HealthModel
from wrcd.estimator.estimator import Estimator, step_through
from wrcd.estimator.records import EstimateDoubt, Ticks
from wrcd.estimator.trust.health import CERTAIN, FEATURES, MIN_SHARE, MOST, SPAN_TICKS, PairHealth, PairState, evidence
from wrcd.estimator.trust.interval import Regime

FloatArray = NDArray[np.float64]
G = 9.80665
SOUND, DIES_FROM, DIES_TO = "sound", 0.3, 0.6  # shares of the recording in which a sensor dies
KMH = 3.6
LATE_S = (0.1, 0.3)
# What is made of a sound pair, and the state that it then is in.
BROKEN = {
    "reversed": PairState.REVERSED, "gyro dead": PairState.GYRO_DEAD, "accel dead": PairState.ACCEL_DEAD,
    "both dead": PairState.BOTH_DEAD, "other axle": PairState.OTHER_AXLE, "in g": PairState.WRONG_UNIT,
    "late": PairState.LATE, "gyro dies": PairState.GYRO_DEAD, "accel dies": PairState.ACCEL_DEAD,
    "both die": PairState.BOTH_DEAD,
}  # fmt: skip
EACH, SOUND_EACH = 2, 2  # of these, and of sound pairs, of every condition
# Partners: the other axle of the bogie, sound; the same, in the same state; an axle on another track; none.
PARTNERS, SHARES = ("sound", "alike", "elsewhere", "none"), (0.4, 0.25, 0.2, 0.15)
LOOKING = "looking at sensors"  # what goes on meanwhile
SPEEDS_SHARE, PER_SPEED_SHARE, SECONDS = 0.7, 0.16, 12.0  # of the plan's conditions; seconds of a recording
FIRST_SPAN = 6  # that is learnt from
KEEP, KEEP_SOUND = 0.3, 0.25  # shares of the spans
# Of the truths, by an interval; of estimates, or the rules' own spread stays; the least factor: at 0.5 for a saturated
# wheelset, of which the training has more than trains have, 45 % of other worlds' truths were held while it seemed so.
COVERS, MIN_ESTIMATES, LEAST = 0.87, 500, 0.8
INTERVAL_SPEEDS = (3.5, 7.0, 14.0, 28.0, 56.0)  # m/s
HIDDEN, ALPHA, EPOCHS = 96, 1.0, 30
HELD_OUT = 5  # of every so many groups one is not learnt from: how much counts is judged by it
# Of the spans of sound pairs, by each state; more by those that a saturated wheelset looks like, or a slow one on
# smooth track: they are hardly found otherwise. And how much of what bears that counts: the sound pairs are few.
ACCUSED, ACCUSED_OF_SILENCE, MARGIN = 3e-4, 8e-4, 0.8
TEMPERS = np.geomspace(0.02, 0.5, 25)  # the shares of a span's evidence that are tried, one after another
KEPT, PRIOR, HAZARD = 0.97, 1e-4, 1e-6


def plan_of(plan: Plan) -> Plan:
    """The conditions that pairs of sensors are looked at in: more of them at the peak, all longer, with seeds of their
    own."""
    return replace(
        plan, seed=plan.seed + 500, speeds=max(2, round(SPEEDS_SHARE * plan.speeds)),
        per_speed=max(2, round(PER_SPEED_SHARE * plan.per_speed)), seconds=SECONDS, held_share=0.22, changed_share=0.12,
    )  # fmt: skip


class FeatureRecorder(PairHealth):
    """Keeps the features of every span."""

    seen: list[tuple[FloatArray, NDArray[np.bool_]]]

    def look(self, speed_m_s: float, ratio: FloatArray, inputs: FloatArray) -> None:
        """Keep them."""
        span = self.pairs.take(speed_m_s)
        known = (span.ticks >= MIN_SHARE * SPAN_TICKS) & span.goes_on
        self.seen.append((self._features(span, known, speed_m_s, ratio, inputs).astype(np.float32), known))


@dataclass(frozen=True, slots=True)
class Watched:
    """What a group's pairs show: features (spans, lanes, FEATURES), what each pair is in (spans, lanes), -1 where that
    does not count, and its partner (lanes,), a place in PARTNERS. Of sound pairs' estimates at the spans' ends: the
    error over the half-width, the Regime and the speed (m,)."""

    features: NDArray[np.float16]
    state: NDArray[np.int8]
    partner: NDArray[np.int8]
    off: NDArray[np.float32]
    regime: NDArray[np.int8]
    speed_m_s: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Lane:
    """A pair of sensors and the one beside it: signals (ticks, 2, 2), torque ratios (ticks, 2), what it is in (ticks,),
    and a place in PARTNERS."""

    z: FloatArray
    ratio: FloatArray
    state: NDArray[np.int8]
    partner: int


def watched(w: Wheelset, design: Design, plan: Plan, group: Group, place: int) -> Watched:
    """Simulate a group, both wheelsets of each bogie, break their sensors and look at them as the train does."""
    ends = (False, design.wheelbase_m), (w.bogie is not None, 0.0)
    both = tuple(replace(c, trailing=t, ahead_m=m) for c in group.conditions for t, m in ends)
    group = replace(group, conditions=both)
    rng = np.random.default_rng([plan.seed, 3, place])
    r = measured(group, simulate_group(w, both, plan.seconds, design.tick_s), design.tick_s, rng)
    z = (r.z if place % 2 else r.felt).astype(np.float64)
    noise = np.zeros_like(z)
    for i, c in enumerate(both):
        for k, sensor in enumerate((c.sensors.yaw_rate, c.sensors.lat_accel)):
            noise[:, k, i] = sensor.measure(np.zeros(len(z)), rng)
    lanes = _lanes(design, r, z, noise, rng)
    first = _watched(design, lanes, r.speed_m_s, r.mu_pct)
    if KMH * group.speed_m_s > design.speeds_m_s[-1]:
        return first
    sound = [lane for lane in lanes if not lane.state.any()][::SOUND_EACH]
    wrong = [replace(lane, state=np.full_like(lane.state, PairState.WRONG_UNIT)) for lane in sound]
    second = _watched(design, wrong, KMH * r.speed_m_s, r.mu_pct)
    return replace(
        first, features=np.concatenate((first.features, second.features), axis=1),
        state=np.concatenate((first.state, second.state), axis=1),
        partner=np.concatenate((first.partner, second.partner)),
    )  # fmt: skip


def _lanes(d: Design, r: Recording, z: FloatArray, noise: FloatArray, rng: np.random.Generator) -> list[Lane]:
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
        state[: begins + 2 * SPAN_TICKS if begins else 0] = PairState.SOUND
        state[begins : begins + SPAN_TICKS if begins else 0] = -1
        out.append(Lane(np.stack((pair, other), axis=2), ratio[:, [i, beside]], state, PARTNERS.index(partner)))
    return out


def _watched(d: Design, lanes: Sequence[Lane], speed_m_s: FloatArray, mu_pct: NDArray[np.float32]) -> Watched:
    z = np.concatenate([lane.z for lane in lanes], axis=2)
    there = np.array([(True, PARTNERS[lane.partner] != "none") for lane in lanes]).reshape(-1)
    estimator = Estimator(replace(d, health=None, interval=None), z.shape[2])
    watch = FeatureRecorder(None, d.noise_rms, d.tick_s, z.shape[2], d.wheelbase_m)
    watch.seen = []
    estimator.health = watch
    ends = np.arange(SPAN_TICKS - 1, len(z), SPAN_TICKS)
    ratio = np.concatenate([lane.ratio for lane in lanes], axis=1)
    ticks = Ticks(0, z, np.broadcast_to(there, z.shape), ratio, speed_m_s.tolist())
    stops = step_through(estimator, ticks.part(0, int(ends[-1]) + 1), ends[:-1].tolist(), resets=True)
    found = [estimator.estimate() for _ in stops]
    known = np.stack([known[::2] for _, known in watch.seen])
    state = np.where(known, np.stack([lane.state for lane in lanes], axis=1)[ends], -1)
    state[:FIRST_SPAN] = -1
    sound = [2 * k for k, lane in enumerate(lanes) if not lane.state.any()][::SOUND_EACH]
    mu, half_width, regime = (
        np.stack([getattr(e, name)[sound] for e in found]) for name in ("mu_available_pct", "half_width_pp", "regime")
    )
    off = np.abs(mu - mu_pct[ends][:, : len(sound)]) / half_width
    usable = np.stack([e.doubt[sound] == EstimateDoubt.NONE for e in found]) & np.isfinite(off)
    usable[:FIRST_SPAN] = False
    speeds = np.broadcast_to(speed_m_s[ends][:, None], off.shape)
    return Watched(
        features=np.stack([f[::2] for f, _ in watch.seen]).astype(np.float16),
        state=state.astype(np.int8),
        partner=np.array([lane.partner for lane in lanes], np.int8),
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
    if name == "late":
        rng = np.random.default_rng(seed)
        lag, which = round(rng.uniform(*LATE_S) / tick_s), int(rng.integers(2))
        out[lag:, which] = out[:-lag, which]
    return out


def intervals(parts: Sequence[Watched]) -> dict[str, Any]:
    """The design's part by which half-widths hold the truth in COVERS of what goes on at a speed: the quantile of the
    error over the half-width that the rules gave, from recordings that they were not fitted on."""
    off, regimes, speed = (np.concatenate([getattr(p, name) for p in parts]) for name in ("off", "regime", "speed_m_s"))
    nodes = np.log(INTERVAL_SPEEDS)
    at = np.interp(np.log(speed), nodes, np.arange(len(nodes)))
    factors = np.ones((len(Regime), len(nodes)))
    for (k, node), _ in np.ndenumerate(factors):
        here = (regimes == k) & (np.abs(at - node) < 1.0)
        if here.sum() >= MIN_ESTIMATES:
            factors[k, node] = max(LEAST, *quantiles(off[here], 1.0 - np.abs(at[here] - node), (COVERS,)))
    return {"regimes": [r.words for r in Regime], "speeds_m_s": INTERVAL_SPEEDS, "factors": factors}


def fit(parts: Sequence[Watched]) -> dict[str, Any]:
    """The design's part that judges pairs: a network fitted to most groups, and for each state how much of its word
    counts, by what it says of the sound pairs of the others."""
    from sklearn.neural_network import MLPClassifier  # an extra of its own: who has a design does not need it

    rng = np.random.default_rng(0)
    others = parts[::HELD_OUT] if len(parts) > HELD_OUT else parts
    chosen = [_chosen(p, rng) for k, p in enumerate(parts) if k % HELD_OUT or len(parts) <= HELD_OUT]
    x, y = (np.concatenate(of) for of in zip(*chosen, strict=True))
    assert x.shape[1] == FEATURES
    middle, scale = x.mean(axis=0), x.std(axis=0) + 1e-6
    z = np.clip((x - middle) / scale, -MOST, MOST)
    net = MLPClassifier(
        (HIDDEN,), activation="tanh", batch_size=2048, learning_rate_init=3e-3, max_iter=EPOCHS, alpha=ALPHA,
        random_state=0, tol=0.0,
    )  # fmt: skip
    net.fit(z, y)
    states = len(PairState)
    found, counts = net.classes_.astype(np.int64), np.bincount(y, minlength=states) / len(y)
    out, bias = np.zeros((HIDDEN, states)), np.full(states, -CERTAIN)  # a state that never came is not found
    out[:, found], bias[found] = net.coefs_[1], net.intercepts_[1] - np.log(counts[found])
    prior = np.full(states, PRIOR)
    prior[PairState.SOUND] = 1.0 - PRIOR * (states - 1)
    model = HealthModel(
        middle, scale, net.coefs_[0], net.intercepts_[0], out, bias, np.zeros(states), np.log(prior / prior[0]),
        KEPT, HAZARD,
    )  # fmt: skip
    temper = tempers(model, others)
    return {
        "states": [s.words for s in PairState], "middle": middle, "scale": scale, "hidden": model.hidden,
        "hidden_bias": model.hidden_bias, "out": out, "out_bias": bias, "temper": temper, "prior": prior, "kept": KEPT,
        "hazard": HAZARD, "spans": len(y), "loss": float(net.loss_),
    }  # fmt: skip


def _chosen(p: Watched, rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
    """Spans to learn from: one differs little from the next."""
    keep = (p.state >= 0) & (rng.random(p.state.shape) < np.where(p.state == PairState.SOUND, KEEP_SOUND, KEEP))
    return p.features[keep].astype(np.float32), p.state[keep]


def tempers(model: HealthModel, parts: Sequence[Watched]) -> FloatArray:
    """(states,): of each state alone, as much of its evidence as leaves sound pairs unaccused in all but so much of the
    spans, whatever their partner is, and some less."""
    sound = [np.flatnonzero((p.state <= 0).all(axis=0)) for p in parts]
    x = np.concatenate([p.features[:, s].astype(np.float64) for p, s in zip(parts, sound, strict=True)], axis=1)
    counts = np.concatenate([p.state[:, s] == PairState.SOUND for p, s in zip(parts, sound, strict=True)], axis=1)
    partner = np.concatenate([p.partner[s] for p, s in zip(parts, sound, strict=True)])
    spoken = np.stack([evidence(model, of) for of in x])
    out = np.zeros(len(PairState))
    for state in list(PairState)[1:]:
        most = ACCUSED_OF_SILENCE if state in (PairState.GYRO_DEAD, PairState.BOTH_DEAD) else ACCUSED
        for temper in TEMPERS:
            odds = np.full(spoken.shape[1], model.log_prior[state])
            accused = np.zeros(len(PARTNERS))
            for e, known in zip(spoken[:, :, state], counts, strict=True):
                new = model.log_prior[state] + model.kept * (odds - model.log_prior[state]) + temper * e
                odds = np.where(known, np.clip(new, -CERTAIN, CERTAIN), odds)
                accused += np.bincount(partner[known & (odds > 0.0)], minlength=len(PARTNERS))
            if (accused > most * np.bincount(partner, counts.sum(axis=0), minlength=len(PARTNERS))).any():
                break
            out[state] = MARGIN * temper
    return out
