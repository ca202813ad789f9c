"""How a design judges its pairs of sensors: simulated pairs of every state, and the network that tells them apart."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.neural_network import MLPClassifier

from sim_ecu.design.cases import Group, Plan, simulate_group
from sim_ecu.design.recordings import Recording, measured
from sim_ecu.physics.wheelset import Wheelset
from wrcd.estimator.design import Design
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.health import FEATURES, MIN_SHARE, MOST, SPAN_TICKS, Health, State
from wrcd.estimator.records import Ticks

FloatArray = NDArray[np.float64]
G = 9.80665
SOUND, DIES_FROM, DIES_TO = "sound", 0.3, 0.6  # shares of the recording in which a sensor dies
KMH = 3.6
TICK_S = 0.005
LATE_S = (0.1, 0.3)
NEXT_M = 2.5  # from a lone wheelset to the next one on its track
# What is made of a sound pair, and the state that it then is in.
BROKEN = {
    "reversed": State.REVERSED, "gyro dead": State.GYRO_DEAD, "accel dead": State.ACCEL_DEAD,
    "both dead": State.BOTH_DEAD, "other axle": State.OTHER_AXLE, "in g": State.WRONG_UNIT, "late": State.LATE,
    "gyro dies": State.GYRO_DEAD, "accel dies": State.ACCEL_DEAD, "both die": State.BOTH_DEAD,
}  # fmt: skip
EACH = 4  # of these, of every condition
# Partners: the other axle of the bogie, sound; the same, in the same state; an axle on another track; none.
PARTNERS, SHARES = ("sound", "alike", "elsewhere", "none"), (0.4, 0.25, 0.2, 0.15)
LOOKING = "looking at sensors"  # what goes on meanwhile
SPEEDS, PER_SPEED, SECONDS = 22, 28, 12.0  # see Plan; seconds of a recording
FIRST_SPAN = 6  # that is learnt from
KEEP, KEEP_SOUND = 0.25, 0.5  # shares of the spans
HIDDEN, ALPHA, EPOCHS = 48, 1e-3, 30
WIRES = (State.REVERSED, State.OTHER_AXLE, State.LATE)  # they do not change while a train runs
TEMPER, TEMPER_WIRES, KEPT, PRIOR, HAZARD = 0.25, 0.1, 0.97, 1e-4, 1e-6


def plan_of(plan: Plan) -> Plan:
    """The conditions that pairs of sensors are looked at in: more of them at the peak, all longer, with seeds of their
    own."""
    return replace(
        plan, seed=plan.seed + 500, speeds=SPEEDS, per_speed=PER_SPEED, seconds=SECONDS, held_share=0.22,
        changed_share=0.12,
    )  # fmt: skip


class Watch(Health):
    """Keeps the features of every span."""

    seen: list[tuple[FloatArray, NDArray[np.bool_]]]

    def look(self, speed_m_s: float, ratio: FloatArray, inputs: FloatArray) -> None:
        """Keep them."""
        span = self.pairs.take()
        known = span.ticks >= MIN_SHARE * SPAN_TICKS
        self.seen.append((self._features(span, known, speed_m_s, ratio, inputs).astype(np.float32), known))


@dataclass(frozen=True, slots=True)
class Pairs:
    """Features (k, FEATURES) of spans, and what each pair is in (k,)."""

    features: NDArray[np.floating[Any]]
    state: NDArray[np.int64]


def pairs_of(w: Wheelset, design: Design, plan: Plan, group: Group, place: int) -> Pairs:
    """Simulate a group, both wheelsets of each bogie, break their sensors and look at them as the train does."""
    apart_m = NEXT_M if w.bogie is None else w.bogie.wheelbase_m
    ends = (False, apart_m), (w.bogie is not None, 0.0)
    both = tuple(replace(c, trailing=t, ahead_m=m) for c in group.conditions for t, m in ends)
    group = replace(group, conditions=both)
    rng = np.random.default_rng([plan.seed, 3, place])
    r = measured(group, simulate_group(w, both, plan.seconds, design.tick_s), design.tick_s, rng)
    z = (r.z if place % 2 else r.felt).astype(np.float64)
    noise = np.zeros_like(z)
    for i, c in enumerate(both):
        for k, sensor in enumerate((c.sensors.yaw_rate, c.sensors.lat_accel)):
            noise[:, k, i] = sensor.measure(np.zeros(len(z)), rng)
    first = _watched(design, r, z, noise, rng, 1.0)
    if KMH * group.speed_m_s > design.speeds_m_s[-1]:
        return first
    second = _watched(design, r, z, noise, rng, KMH)
    return Pairs(np.concatenate((first.features, second.features)), np.concatenate((first.state, second.state)))


def _watched(
    d: Design, r: Recording, z: FloatArray, noise: FloatArray, rng: np.random.Generator, faster: float
) -> Pairs:
    """Sound and broken pairs, each with a partner beside it; or sound ones alone at a speed in a wrong unit."""
    ticks, _, n = z.shape
    lanes, present, ratios, states = [], [], [], []
    ratio = np.abs(r.torque.astype(np.float64)) / (2 * d.normal_N * d.r_0)
    for i in range(n):
        names = [SOUND, *rng.choice(list(BROKEN), EACH, replace=False)] if faster == 1.0 else [SOUND]
        for name in names:
            begins = int(ticks * rng.uniform(DIES_FROM, DIES_TO)) if "die" in name else 0
            seed = int(rng.integers(2**31))
            partner = str(rng.choice(PARTNERS, p=SHARES))
            beside = (i + 2) % n if partner == "elsewhere" else i ^ 1
            of_partner = _broken(name, z, noise, beside, begins, seed) if partner == "alike" else z[:, :, beside]
            if name == "other axle" and partner == "sound":
                of_partner = _broken(name, z, noise, beside, begins, seed)
            lanes += [_broken(name, z, noise, i, begins, seed), of_partner]
            present += [True, partner != "none"]
            ratios += [ratio[:, i], ratio[:, beside]]
            state = np.full(ticks, BROKEN.get(name, State.SOUND) if faster == 1.0 else State.WRONG_UNIT)
            state[: begins + 2 * SPAN_TICKS if begins else 0] = State.SOUND
            state[begins : begins + SPAN_TICKS if begins else 0] = -1
            states.append(state)
    z = np.stack(lanes, axis=2)
    there = np.broadcast_to(np.array(present), z.shape)
    estimator = Estimator(replace(d, health=None), z.shape[2])
    watch = Watch(None, d.noise_rms, d.tick_s, z.shape[2])
    watch.seen = []
    estimator.health = watch
    _run(estimator, Ticks(0, z, there, np.stack(ratios, axis=1), (faster * r.speed_m_s).tolist()))
    x = np.stack([f[::2] for f, _ in watch.seen])
    known = np.stack([k[::2] for _, k in watch.seen])
    y = np.stack(states, axis=1)[SPAN_TICKS - 1 :: SPAN_TICKS][: len(x)]
    keep = known & (y >= 0) & (rng.random(y.shape) < np.where(y == State.SOUND, KEEP_SOUND, KEEP))
    keep[:FIRST_SPAN] = False
    return Pairs(x[keep], y[keep].astype(np.int64))


def _run(estimator: Estimator, ticks: Ticks) -> None:
    at = 0
    while at < len(ticks):
        end = at + 1
        while end < len(ticks) and not estimator.block_end(end - 1):
            end += 1
        block, first = ticks.part(at, end), 0
        while first < len(block):
            result = estimator.step(block, first)
            first += len(result)
            for axle in np.flatnonzero(result.needs_reset).tolist():
                estimator.reset(axle)
        at = end


def _broken(name: str, z: FloatArray, noise: FloatArray, i: int, begins: int, seed: int) -> FloatArray:
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
        lag, which = round(rng.uniform(*LATE_S) / TICK_S), int(rng.integers(2))
        out[lag:, which] = out[:-lag, which]
    return out


def fit(parts: Sequence[Pairs]) -> dict[str, Any]:
    """The design's part that judges pairs."""
    x, y = np.concatenate([p.features for p in parts]), np.concatenate([p.state for p in parts])
    assert x.shape[1] == FEATURES
    middle, scale = x.mean(axis=0), x.std(axis=0) + 1e-6
    z = np.clip((x - middle) / scale, -MOST, MOST)
    net = MLPClassifier(
        (HIDDEN,), activation="tanh", batch_size=2048, learning_rate_init=3e-3, max_iter=EPOCHS, alpha=ALPHA,
        random_state=0, tol=0.0,
    )  # fmt: skip
    net.fit(z, y)
    counts = np.bincount(y, minlength=len(State)) / len(y)
    temper = np.full(len(State), TEMPER)
    temper[list(WIRES)] = TEMPER_WIRES
    prior = np.full(len(State), PRIOR)
    prior[State.SOUND] = 1.0 - PRIOR * (len(State) - 1)
    return {
        "states": [s.words for s in State], "middle": middle, "scale": scale, "hidden": net.coefs_[0],
        "hidden_bias": net.intercepts_[0], "out": net.coefs_[1], "out_bias": net.intercepts_[1] - np.log(counts),
        "temper": temper, "prior": prior, "kept": KEPT, "hazard": HAZARD, "spans": len(y), "loss": float(net.loss_),
    }  # fmt: skip
