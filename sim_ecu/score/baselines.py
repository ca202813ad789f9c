"""Other ways to the same figure, each given what wrcd has: the offsets taken off, the ticks as they came.

Not among them: interacting multiple models over the four filters. As the design tunes those, for telling residuals,
their likelihoods were worth a mean error of 4.6 points in the grid, and in Python they are too slow to be tuned for
their own sake.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import Plan
from sim_ecu.design.features import Features, estimator_alone, features
from sim_ecu.design.recordings import Recording
from sim_ecu.design.rules import HELD
from sim_ecu.jobs.pool import Workers
from sim_ecu.physics.compiled import compiled
from wrcd.errors import InputError
from wrcd.estimator.design import Design
from wrcd.estimator.estimator import OFFSET_WINDOWS
from wrcd.estimator.records import Ticks

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class GivenTicks:
    """t ticks of n axles of one run, which share the speed. z and torque_ratio are NaN where unknown.

    z and present (t, 2, n): yaw rate (rad/s), lateral acceleration (m/s2), and whether the tick brought them.
    torque_ratio (t, n): |torque| / (2 N r_0).
    """

    z: FloatArray
    present: BoolArray
    torque_ratio: FloatArray
    speed_m_s: FloatArray  # (t,)
    tick_s: float
    number: NDArray[np.int64]  # (t,) of each tick on the bus; they are in order, and some may be missing
    seen: FloatArray | None = None  # (t, n, inputs) what the estimator's rules saw last, NaN before they saw anything


def running_mean(values: FloatArray, window: int) -> FloatArray:
    """Means (t, …) over the newest `window` ticks, or as many as there are yet."""
    total = np.cumsum(np.concatenate((np.zeros_like(values[:1]), values)), axis=0)
    newest = np.arange(1, len(total))
    oldest = np.maximum(newest - window, 0)
    count = (newest - oldest).reshape(-1, *[1] * (values.ndim - 1))
    mean: FloatArray = (total[newest] - total[oldest]) / count
    return mean


ANSWER_EVERY_S = 0.02  # as the adhesion frames
PAPER = "the paper's own form"


class Baseline(Protocol):
    """Another way to the same figure, on the same ticks."""

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
        """Available adhesion in percent, (ticks, n)."""
        ...


def without_offset(ticks: GivenTicks, window_ticks: int) -> GivenTicks:
    """The ticks with the sensors' offsets taken off as the train does it: what a filter alone would have to learn."""
    z = np.nan_to_num(ticks.z)
    _take_offset(z, ticks.present, float(OFFSET_WINDOWS * window_ticks))
    return replace(ticks, z=np.where(ticks.present, z, np.nan))


@compiled
def _take_offset(z: FloatArray, present: BoolArray, most: float) -> None:
    """`wrcd.estimator.signals.noise` over all ticks of z (t, 2, n), in place: a test compares them."""
    for c in range(z.shape[1]):
        for i in range(z.shape[2]):
            mean, count = 0.0, 0.0
            for k in range(z.shape[0]):
                if present[k, c, i]:
                    count = min(count + 1.0, most)
                    mean += 1.0 / max(count, 1.0) * (z[k, c, i] - mean)
                z[k, c, i] -= mean


@dataclass(frozen=True, slots=True)
class Offsetless:
    """A baseline that is given measurements without their offsets."""

    baseline: Baseline
    window_ticks: int

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
        """Adhesion in percent (t, n)."""
        return self.baseline.mu_pct(without_offset(ticks, self.window_ticks))


@dataclass(frozen=True, slots=True)
class TorqueRatio:
    """What anyone can do without a filter: the adhesion in use is the least there can be."""

    window: int

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
        """Adhesion in percent (t, n)."""
        return 100.0 * running_mean(np.nan_to_num(ticks.torque_ratio), self.window)


@dataclass(frozen=True, slots=True)
class Beside:
    """The train's estimator with another design, on the same ticks."""

    design: Design

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
        """Adhesion in percent (t, n); between two answers the last one stands."""
        t, n = ticks.torque_ratio.shape
        every = max(1, round(ANSWER_EVERY_S / self.design.tick_s))
        estimator = estimator_alone(self.design, n)
        out, first = np.empty((t, n)), 0
        gaps = np.flatnonzero(np.diff(ticks.number) != 1).tolist()  # the ticks before them are stops, too
        for stop in sorted({*range(0, t, every), *gaps, t - 1}):
            at, speeds_m_s = slice(first, stop + 1), ticks.speed_m_s[first : stop + 1].tolist()
            given = ticks.z[at], ticks.present[at], ticks.torque_ratio[at], speeds_m_s
            estimator.run(Ticks(int(ticks.number[first]), *given), 0, len(speeds_m_s), resets=True)
            if stop % every == 0:
                out[stop : stop + every] = estimator.estimate().mu_available_pct
            first = stop + 1
        return out


def fitting(name: str, other: Design, design: Design) -> None:
    """Raises InputError where a design cannot run on the ticks that are made for another."""
    for key in ("tick_s", "normal_N", "r_0"):
        ours, theirs = getattr(design, key), getattr(other, key)
        if ours != theirs:
            raise InputError(
                f"has {key} = {theirs:g}, the design that is scored {ours:g}",
                key=f"--beside {name}",
                hint="only designs for the same wheelset and tick can be compared on the same frames",
            )


FORMAT = "wrcd-baselines/3"
SMALLEST = 1e-9
LAYERS = (48, 32)


@dataclass(frozen=True, slots=True)
class Regressor:
    """A small multi-layer perceptron on the rules' own inputs: what such a network makes of them, unreadably."""

    window: int
    mean: FloatArray
    size: FloatArray
    layers: tuple[tuple[FloatArray, FloatArray], ...]

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
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


def learn(design: Design, recordings: list[Recording], plan: Plan, workers: Workers | None = None) -> dict[str, Any]:
    """Return the baselines' document: fitted to the recordings that the design was fitted to. workers: as of
    `features`."""
    network = _network(features(design, recordings, plan, workers=workers)[0])
    return {"format": FORMAT, "design": design.checksum} | ({} if network is None else {"regressor": network})


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


def load(path: Path, design: Design) -> Regressor | None:
    """Return what `learn` made, None where it had no scikit-learn. Raises InputError if it is not for this design."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read: {e}", file=path) from None
    if not isinstance(document, dict) or document.get("format") != FORMAT or document.get("design") != design.checksum:
        raise InputError(
            "does not belong to this design", file=path, hint="make both with `sim-ecu design -o … --baselines …`"
        )
    try:
        r = document.get("regressor")
        if r is None:
            return None
        layers = tuple((np.array(w), np.array(b)) for w, b in r["layers"])
        return Regressor(design.recent_ticks, np.array(r["mean"]), np.array(r["size"]), layers)
    except (KeyError, TypeError, ValueError, IndexError) as e:
        raise InputError(f"is damaged: {e!r}", file=path, hint="make it again with `sim-ecu design`") from None
