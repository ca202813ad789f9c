"""The estimator beside its oracle: the same masks every tick, the same figures to 1e-9."""

from dataclasses import fields
from operator import attrgetter

import numpy as np

from tests.oracle.estimator import Oracle, Stepped
from tests.support.stepped import SteppedEstimator, StepResult, Tick, health_figures, log_odds, pair_states
from wrcd.core.design import FloatArray
from wrcd.core.records import Estimate

# Of the largest innovation of an axle since its reset, and of 1. What differs is the order of sums; a filter's closed
# loop makes a rounding of its state up to 140 times as large before it fades, and H turns a radian of it into up to
# 3200 m/s2.
CLOSE = 1e-9
# Log odds: a network's sum over 194 features, some of them correlations of hardly any power; of a million ticks one was
# 1.5e-9 off.
ODDS = 1e-8
# A window's figures come from running sums of squares: the largest of the last KEPT spans of TICKS takes the digits of
# the small ones. Above LARGE standard deviations, or so many times the least residual, the figures are ROUGH.
LARGE, LARGE_TO_RESIDUAL, TICKS, KEPT, ROUGH = 1000.0, 2e4, 100, 15, 2e-5
# The rules' inputs: correlations of a window whose power is nearly all mean and slope are what is left of those sums
# after both are taken off; of one in which nothing is live, and of which there is no estimate, even less is.
CLOSE_INPUTS, CLOSE_WITHOUT_DATA = 1e-7, 1e-6
HUGE = 1e30  # of a square: absurd values overflow
LENGTHS = (3, 17, 50)  # blocks of windows whose inputs of the rules are compared
# Of what both keep between ticks, its name in C and in the oracle, what no answer shows at once.
STATE = {
    "gate_power": "_gate._power", "gate_count": "_gate._count", "gate_net_outliers": "_gate._net_outliers",
    "joints_power": "_joints._power", "joints_ticks": "_joints._ticks", "joints_since": "_joints._since",
    "noise_power": "_noise._power", "noise_count": "_noise._count", "offset_mean": "_offset._mean",
    "offset_count": "_offset._count", "memory": "_memory", "health_held": "health._held",
}  # fmt: skip
MASKS = ("accepted", "outliers", "near_pulse", "live", "calm", "needs_reset")
WHOLE = ("rule", "winner", "saturated", "contradicted", "doubt", "regime")


class Comparison:
    """Shown an estimator's ticks, an oracle does the same; raises AssertionError where they differ."""

    def __init__(self, estimator: SteppedEstimator) -> None:
        self.estimator, self.oracle = estimator, Oracle(estimator.design, estimator.axles)
        self._largest = np.ones(estimator.axles)
        self._recent, self._ticks = np.zeros((KEPT, estimator.axles)), 0
        self.worst = 0.0  # difference of figures that are to be close
        self.estimates = self.large = 0  # of axles; of which some value was large

    def stepped(self, tick: Tick, result: StepResult) -> Stepped:
        """The estimator has taken a tick. Returns what the oracle makes of it."""
        with np.errstate(all="ignore"):  # absurd values overflow in both
            expected = self.oracle.step(tick)
        for name in MASKS:
            assert getattr(expected, name).tolist() == getattr(result, name).tolist(), name
        assert expected.notable == result.notable
        for axle in np.flatnonzero(expected.needs_reset).tolist():
            why = self.oracle.why_reset(expected, tick.z[0], axle), self.estimator.why_reset(result, tick.z[0], axle)
            ours, theirs = (np.array([[*o.times_usual, *o.limits, o.jump_rad_s]]) for o in why)
            self._close("why_reset", ours, theirs, ROUGH)
        self._largest = np.fmax(self._largest, np.abs(expected.whitened).max(axis=(0, 1)))
        self._largest = np.fmax(self._largest, np.abs(expected.innovations).max(axis=(0, 1)))
        span = self._ticks // TICKS % KEPT
        if self._ticks % TICKS == 0:
            self._recent[span] = 0.0
        self._recent[span] = np.fmax(self._recent[span], np.abs(expected.whitened).max(axis=(0, 1)))
        self._ticks += 1
        for name in ("innovations", "whitened"):
            self._close(name, getattr(expected, name) / self._largest, getattr(result, name) / self._largest, CLOSE)
        return expected

    def reset(self, axle: int) -> None:
        """The estimator's axle was reset."""
        self.oracle.reset(axle)
        self._largest[axle] = 1.0

    def estimated(self, estimate: Estimate) -> None:
        """The estimator has answered."""
        with np.errstate(all="ignore"):
            expected = self.oracle.estimate()
        recent = self._recent.max(axis=0)
        large = (recent > LARGE) | (recent > LARGE_TO_RESIDUAL * expected.residuals.min(axis=1))
        close = np.where(large, ROUGH, CLOSE)
        self.estimates += len(recent)
        self.large += int(large.sum())
        for field in fields(Estimate):
            x, y = getattr(expected, field.name), getattr(estimate, field.name)
            if field.name in WHOLE:
                assert x.tolist() == y.tolist(), field.name
            elif field.name in ("inputs", "reaches_pct"):  # the second is what the rules make of 0.16 s
                silent = np.isnan(expected.residuals).any(axis=1)
                limit = np.where(silent, CLOSE_WITHOUT_DATA, CLOSE_INPUTS)
                self._close(field.name, x, y, np.maximum(limit, close))
            else:
                self._close(field.name, x, y, close)
        self._answered(float(close.max()))

        for name, path in STATE.items():
            there = attrgetter(path)(self.oracle)
            ours = np.moveaxis(there.reshape(-1, there.shape[-1]), -1, 0)
            kept = self.estimator._axle[name].reshape(ours.shape)
            self._close(name, np.where(np.abs(ours) > HUGE, 0.0, ours), np.where(np.abs(ours) > HUGE, 0.0, kept), close)

    def _answered(self, close: float) -> None:
        """What an estimator tells beside its estimate."""
        oracle, estimator = self.oracle, self.estimator
        ours, theirs = oracle.health, estimator
        now = oracle.torque_now()
        self._close("torque_now", now, estimator.torque_now(), CLOSE)
        slides = [[a.before_pct, a.used_pct, a.age_s, a.held_s] for a in oracle.slides.axles]
        self._close("slide", np.array(slides), estimator._axle["slide"][:, :4], ROUGH)  # some were rough a while ago
        told = np.array([[len(oracle.slides.told) > 0, oracle.slides.bias]])
        self._close("slides", told, np.array([[estimator.slides[0] > 0.0, estimator.slides[3]]]), ROUGH)
        self._close("log_odds", ours.log_odds, log_odds(theirs), max(close, ODDS))
        assert ours.state.tolist() == pair_states(theirs).tolist()
        blocks = np.repeat(LENGTHS, oracle.axles)
        of_inputs = max(close, CLOSE_WITHOUT_DATA)
        with np.errstate(all="ignore"):
            given, theirs_given = (e.inputs_of(blocks, now) for e in (oracle, estimator))
            known = np.isfinite(given).all(axis=1)  # of a window without data correlations are of nothing
            self._close("inputs_of", given[known], theirs_given[known], of_inputs)
            self._close("steps", oracle.steps(), estimator.steps(), of_inputs)
            self._close("features", oracle.features(), estimator.features(), of_inputs)
        for axle in range(oracle.axles):
            self._close("figures", np.array([ours.figures(axle)]), np.array([health_figures(theirs, axle)]), of_inputs)
        assert self.oracle.outliers == self.estimator.outliers
        assert self.oracle.started.tolist() == self.estimator.started.tolist()

    def _close(self, name: str, x: FloatArray, y: FloatArray, close: float | FloatArray) -> None:
        """close: one difference for all, or one of each axle, the first axis."""
        assert x.shape == y.shape, name
        both = np.isfinite(x)
        assert np.array_equal(np.where(both, 0.0, x), np.where(np.isfinite(y), 0.0, y), equal_nan=True), name
        with np.errstate(invalid="ignore"):
            differ = np.where(both, np.abs(x - y), 0.0) / np.where(both, np.maximum(np.abs(x), 1.0), 1.0)
        limit = np.broadcast_to(
            np.asarray(close).reshape((-1,) + (1,) * (x.ndim - 1) if np.ndim(close) else ()), x.shape
        )
        assert (differ <= limit).all(), (name, float((differ / limit).max()))
        self.worst = max(self.worst, float(differ[limit == CLOSE].max(initial=0.0)))
