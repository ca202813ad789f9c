"""Baselines that learn from the design's own recordings: no filters but the same fuzzy machinery, and a regressor."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from sim_ecu.design.cases import FloatArray, Plan, Recording, features
from sim_ecu.design.rules import RuleBase, fit
from sim_ecu.score.imm import Imm
from sim_ecu.score.ticks import Ticks, running_mean
from wrcd.errors import InputError
from wrcd.estimator.design import Design

FORMAT = "wrcd-baselines/1"
SMALLEST = 1e-9
FILTERLESS_SETS = (4, 4, 5, 4)  # raw yaw rate, raw lateral acceleration, torque, speed: the best of nine combinations
LAYERS = (48, 32)
MOST_SHARE = 2000.0
FITTED_EVERY = 40  # the IMM is slow: its levels are fitted to every so many conditions of a speed


def _log(x: FloatArray) -> FloatArray:
    return np.asarray(np.log10(np.maximum(x, SMALLEST)))


def raw_inputs(ticks: Ticks, window: int) -> FloatArray:
    """(t, n, 4): log10 of the windowed RMS of both raw signals about their mean, of the torque ratio, of the speed."""
    z = np.where(ticks.present, ticks.z, 0.0)
    mean = running_mean(z, window)
    rms = np.sqrt(np.maximum(running_mean(z * z, window) - mean * mean, 0.0))
    torque = running_mean(np.nan_to_num(ticks.torque_ratio), window)
    speed = np.broadcast_to(ticks.speed_m_s[:, None], torque.shape)
    return np.stack((_log(rms[:, 0]), _log(rms[:, 1]), _log(torque), _log(speed)), axis=-1)


@dataclass(frozen=True, slots=True)
class Filterless:
    """The plain RMS of the two signals with torque and speed, through the same fit: do the filters earn their place?"""

    rules: RuleBase
    window: int

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Adhesion in percent (t, n), not below what is in use."""
        inputs = raw_inputs(ticks, self.window)
        t, n, k = inputs.shape
        mu = self.rules.mu_pct(inputs.reshape(-1, k)).reshape(t, n)
        return np.maximum(mu, 100.0 * 10.0 ** inputs[:, :, 2])


@dataclass(frozen=True, slots=True)
class Regressor:
    """A small multi-layer perceptron on the rules' own six inputs: what such a network makes of them, unreadably."""

    mean: FloatArray
    size: FloatArray
    layers: tuple[tuple[FloatArray, FloatArray], ...]

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Adhesion in percent (t, n), not below what is in use; NaN before the rules saw anything."""
        assert ticks.seen is not None
        t, n, k = ticks.seen.shape
        mu = 100.0 * np.exp(self.answer(ticks.seen.reshape(-1, k)).reshape(t, n))
        return np.maximum(mu, 100.0 * 10.0 ** ticks.seen[:, :, 4])

    def answer(self, inputs: FloatArray) -> FloatArray:
        """ln of the adhesion (n,) for inputs (n, 6)."""
        x = (inputs - self.mean) / self.size
        for i, (weight, bias) in enumerate(self.layers):
            x = x @ weight + bias
            if i + 1 < len(self.layers):
                x = np.maximum(x, 0.0)
        return np.asarray(x[:, 0])


def learn(design: Design, recordings: list[Recording], plan: Plan, imm: Imm) -> dict[str, Any]:
    """The baselines' document: fitted to the recordings that the design was fitted to, the slow IMM to some of them."""
    data = features(design, recordings, plan.windows)
    importance = data.importance(plan)
    raw = _raw_features(design, recordings, plan.windows)
    rules = fit(raw, data.mu_pct, FILTERLESS_SETS, len(design.rules), importance, data.condition)
    document: dict[str, Any] = {
        "format": FORMAT,
        "design": design.checksum,
        "filterless": {
            "centres": [c.tolist() for c in rules.centres],
            "rules": rules.rules.tolist(),
            "bases": rules.bases.tolist(),
            "slopes": rules.slopes.tolist(),
        },
        "imm_shares": np.round(_imm_shares(design, recordings, plan, imm), 3).tolist(),
    }
    try:
        from sklearn.neural_network import MLPRegressor
    except ImportError:
        return document
    mean, size = data.inputs.mean(axis=0), data.inputs.std(axis=0)
    net = MLPRegressor(
        hidden_layer_sizes=LAYERS, max_iter=400, early_stopping=True, n_iter_no_change=25, alpha=1e-3, random_state=0
    )
    net.fit((data.inputs - mean) / size, np.log(data.mu_pct / 100.0))
    document["regressor"] = {
        "mean": mean.tolist(),
        "size": size.tolist(),
        "layers": [
            [np.round(w, 5).tolist(), np.round(b, 5).tolist()] for w, b in zip(net.coefs_, net.intercepts_, strict=True)
        ],
    }
    return document


def _imm_shares(design: Design, recordings: list[Recording], plan: Plan, imm: Imm) -> FloatArray:
    """The shares of the models' peaks that give the IMM its least mean error, over some conditions of the core."""
    parts, used, truth = [], [], []
    for r in [r for r in recordings if plan.core_speeds[0] <= r.speed_m_s <= plan.core_speeds[1]][::3]:
        z, torque, mu = r.z[:, :, ::FITTED_EVERY], r.torque[:, ::FITTED_EVERY], r.mu_pct[::FITTED_EVERY]
        ratio = np.abs(torque) / (2 * design.normal_N * design.r_0)
        ticks = Ticks(z, np.ones(z.shape, dtype=bool), ratio, np.full(len(z), r.speed_m_s), design.tick_s)
        parts.append(imm.parts(ticks)[-1])
        used.append(100.0 * ratio[-design.window_ticks :].mean(axis=0))
        truth.append(mu)
    p, u, m = np.concatenate(parts), np.concatenate(used), np.concatenate(truth)

    def error(shares: FloatArray) -> float:
        return float(np.abs(np.fmax(p @ shares, u) - m).mean())

    starts = [np.full(p.shape[1], s) for s in (0.3, 1.0, 3.0)]
    found = [minimize(error, s, method="Powell", bounds=[(0.0, MOST_SHARE)] * len(s)) for s in starts]
    best: FloatArray = min(found, key=lambda f: float(f.fun)).x
    return best


def _raw_features(design: Design, recordings: list[Recording], windows: int) -> FloatArray:
    """(windows, 4), in the order of `features`."""
    rows = []
    half = design.window_ticks // 2
    for r in recordings:
        ticks = len(r.z)
        ratio = np.abs(r.torque) / (2 * design.normal_N * design.r_0)
        present = np.ones(r.z.shape, dtype=bool)
        every = raw_inputs(Ticks(r.z, present, ratio, np.full(ticks, r.speed_m_s), design.tick_s), design.window_ticks)
        rows += [every[k] for k in sorted(ticks - 1 - half * i for i in range(windows))]
    return np.concatenate(rows)


@dataclass(frozen=True, slots=True)
class Learned:
    """What `learn` made, ready to be used."""

    filterless: Filterless
    regressor: Regressor | None
    imm_shares: FloatArray


def load(path: Path, design: Design) -> Learned:
    """Read what `learn` made. Raises InputError if it is not for this design."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read: {e}", file=path) from None
    if not isinstance(document, dict) or document.get("format") != FORMAT or document.get("design") != design.checksum:
        raise InputError(
            "does not belong to this design", file=path, hint="make both with `sim-ecu design -o … --baselines …`"
        )
    try:
        return _read(document, design)
    except (KeyError, TypeError, ValueError, IndexError) as e:
        raise InputError(f"is damaged: {e!r}", file=path, hint="make it again with `sim-ecu design`") from None


def _read(document: dict[str, Any], design: Design) -> Learned:
    f = document["filterless"]
    rules = np.array(f["rules"])
    one, none = np.ones(len(rules)), np.zeros(rules.shape)
    base = RuleBase(
        [np.array(c) for c in f["centres"]], rules, np.array(f["bases"]), np.array(f["slopes"]),
        one, none, one, np.zeros((len(rules), 2)),
    )  # fmt: skip
    r = document.get("regressor")
    regressor = None
    if r is not None:
        layers = tuple((np.array(w), np.array(b)) for w, b in r["layers"])
        regressor = Regressor(np.array(r["mean"]), np.array(r["size"]), layers)
    return Learned(Filterless(base, design.window_ticks), regressor, np.array(document["imm_shares"]))
