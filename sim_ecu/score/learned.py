"""Baselines that learn from the design's own recordings: no filters but the same fuzzy machinery; a neural network."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import FloatArray, Plan
from sim_ecu.design.features import ENDS, Features, features, importance
from sim_ecu.design.recordings import Recording
from sim_ecu.design.rules import COVERS, HELD, RuleBase, fit
from sim_ecu.score.baselines import without_offset
from sim_ecu.score.ticks import Ticks, running_mean
from wrcd.errors import InputError
from wrcd.estimator.design import Design
from wrcd.estimator.fuzzy import MIN_FIRING

FORMAT = "wrcd-baselines/3"
IntArray = NDArray[np.int64]
SMALLEST = 1e-9
MIN_TRACK = 0.03  # of the noise's power: less from the track is not told from none
FILTERLESS_SETS = (4, 4, 5, 4)  # raw yaw rate, raw lateral acceleration, torque, speed: the best of nine combinations
FILTERLESS_RULES = 254  # nearly all that its sets make; with 100, windows without any rule cost it 0.3 points
LAYERS = (48, 32)


def _log(x: FloatArray) -> FloatArray:
    return np.asarray(np.log10(np.maximum(x, SMALLEST)))


def raw_inputs(ticks: Ticks, window: int, noise_rms: tuple[float, float]) -> FloatArray:
    """(t, n, 4): log10 of the windowed RMS of both raw signals, of the torque ratio, of the speed.

    As the rules' own inputs: about the straight line through the window, and without the sensors' noise.
    """
    z = np.where(ticks.present, without_offset(ticks, window).z, 0.0)
    at = np.arange(len(z), dtype=np.float64)[:, None, None] * np.ones((1, *z.shape[1:]))
    z_mean, t_mean = running_mean(z, window), running_mean(at, window)
    power = running_mean(z * z, window) - z_mean**2
    about = running_mean(at * z, window) - t_mean * z_mean
    spread = np.maximum(running_mean(at * at, window) - t_mean**2, SMALLEST)
    noise = np.square(noise_rms)[:, None]
    rms = np.sqrt(np.maximum(power - about**2 / spread - noise, MIN_TRACK * noise))
    torque = running_mean(np.nan_to_num(ticks.torque_ratio), window)
    speed = np.broadcast_to(ticks.speed_m_s[:, None], torque.shape)
    return np.stack((_log(rms[:, 0]), _log(rms[:, 1]), _log(torque), _log(speed)), axis=-1)


@dataclass(frozen=True, slots=True)
class Filterless:
    """The plain RMS of the two signals with torque and speed, through the same fit: do the filters earn their place?"""

    rules: RuleBase
    window: int
    noise_rms: tuple[float, float]

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Adhesion in percent (t, n), not below what is in use, which it is where no rule speaks."""
        inputs = raw_inputs(ticks, self.window, self.noise_rms)
        t, n, k = inputs.shape
        rows = inputs.reshape(-1, k)
        said, firing = self.rules.answer(rows)
        mu = np.where(firing >= MIN_FIRING, said, 0.0).reshape(t, n)
        return np.maximum(mu, 100.0 * 10.0 ** inputs[:, :, 2])


@dataclass(frozen=True, slots=True)
class Regressor:
    """A small multi-layer perceptron on the rules' own inputs: what such a network makes of them, unreadably."""

    window: int
    mean: FloatArray
    size: FloatArray
    layers: tuple[tuple[FloatArray, FloatArray], ...]

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Adhesion in percent (t, n), not below what is in use; NaN before the rules saw anything."""
        assert ticks.seen is not None
        t, n, k = ticks.seen.shape
        mu = 100.0 * np.exp(self.answer(ticks.seen.reshape(-1, k)).reshape(t, n))
        return np.maximum(mu, 100.0 * running_mean(np.nan_to_num(ticks.torque_ratio), self.window))

    def answer(self, inputs: FloatArray) -> FloatArray:
        """ln of the adhesion (n,) for inputs (n, k)."""
        x = np.clip((inputs - self.mean) / self.size, -HELD, HELD)
        for i, (weight, bias) in enumerate(self.layers):
            x = x @ weight + bias
            if i + 1 < len(self.layers):
                x = np.maximum(x, 0.0)
        return np.asarray(x[:, 0])


def learn(design: Design, recordings: list[Recording], plan: Plan) -> dict[str, Any]:
    """The baselines' document: fitted to the recordings that the design was fitted to."""
    noise_rms = float(design.noise_rms[0]), float(design.noise_rms[1])
    raw, mu_pct, condition = _raw_features(design, recordings, plan, noise_rms)
    weight = importance(plan, 10.0 ** raw[:, 3], 100.0 * 10.0 ** raw[:, 2] / mu_pct)
    rules = fit(raw, mu_pct, FILTERLESS_SETS, FILTERLESS_RULES, weight, condition, np.full(len(raw), COVERS))
    document: dict[str, Any] = {
        "format": FORMAT,
        "design": design.checksum,
        "filterless": {
            "centres": [c.tolist() for c in rules.centres],
            "rules": rules.rules.tolist(),
            "bases": rules.bases.tolist(),
            "slopes": rules.slopes.tolist(),
            "low": rules.low.tolist(),
            "high": rules.high.tolist(),
            "noise_rms": list(noise_rms),
        },
    }
    network = _network(features(design, recordings, plan)[0])
    return document if network is None else document | {"regressor": network}


def _network(data: Features) -> dict[str, Any] | None:
    """Trained on the windows of the rules; None without scikit-learn."""
    try:
        from sklearn.neural_network import MLPRegressor
    except ImportError:
        return None
    net = MLPRegressor(
        hidden_layer_sizes=LAYERS, max_iter=400, early_stopping=True, n_iter_no_change=25, alpha=1e-3, random_state=0
    )
    mean, size = data.inputs.mean(axis=0), np.maximum(data.inputs.std(axis=0), SMALLEST)
    net.fit(np.clip((data.inputs - mean) / size, -HELD, HELD), np.log(data.mu_pct / 100.0))
    return {
        "mean": mean.tolist(),
        "size": size.tolist(),
        "layers": [
            [np.round(w, 5).tolist(), np.round(b, 5).tolist()] for w, b in zip(net.coefs_, net.intercepts_, strict=True)
        ],
    }


def _raw_features(
    design: Design, recordings: list[Recording], plan: Plan, noise_rms: tuple[float, float]
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Whole windows of one rail and torque: inputs (n, 4), the truth in percent and the condition's number (n,)."""
    rows, truths, numbers = [], [], []
    first = 0
    for r in recordings:
        ratio = np.abs(r.torque) / (2 * design.normal_N * design.r_0)
        settled = round(plan.settle_s / plan.seconds * len(r.z))
        at = [settled + round(share * (len(r.z) - settled)) - 1 for share in ENDS]
        for z in (r.z, r.felt):
            present = np.ones(z.shape, dtype=bool)
            ticks = Ticks(z.astype(np.float64), present, ratio, r.speed_m_s, design.tick_s, np.arange(len(z)))
            every = raw_inputs(ticks, design.window_ticks, noise_rms)
            for k in at[1::2] if z is r.felt else at:
                whole = k + 1 - r.first >= design.window_ticks
                rows.append(every[k, whole])
                truths.append(r.mu_pct[k, whole].astype(np.float64))
                numbers.append(first + np.flatnonzero(whole))
        first += r.z.shape[2]
    return np.concatenate(rows), np.concatenate(truths), np.concatenate(numbers)


@dataclass(frozen=True, slots=True)
class Learned:
    """What `learn` made, ready to be used."""

    filterless: Filterless
    regressor: Regressor | None


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
    n, slopes = len(rules), np.array(f["slopes"])
    none = np.zeros_like(slopes)
    base = RuleBase(
        centres=[np.array(c) for c in f["centres"]], rules=rules, bases=np.array(f["bases"]), slopes=slopes,
        spreads=np.ones(n), spread_slopes=none, support=np.ones(n), typical=np.zeros((n, 2)),
        low=np.array(f["low"]), high=np.array(f["high"]), middle=none[0],
    )  # fmt: skip
    r = document.get("regressor")
    regressor = None
    if r is not None:
        layers = tuple((np.array(w), np.array(b)) for w, b in r["layers"])
        regressor = Regressor(design.recent_ticks, np.array(r["mean"]), np.array(r["size"]), layers)
    yaw_rate, lat_accel = (float(x) for x in f["noise_rms"])
    return Learned(Filterless(base, design.window_ticks, (yaw_rate, lat_accel)), regressor)
