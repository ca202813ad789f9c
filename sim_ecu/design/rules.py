"""Membership functions, rule base and polynomial, fitted to simulated residuals (Figs. 6, 8, 9, 10 and (16)).

A rule says: if residual 1 is Low and … and the torque is T_3 and the speed Slow, then the output is its base, changed
by its slopes as the inputs move away from the middle of its sets. The output is the mean of the rules by their weight.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import skfuzzy
from numpy.typing import NDArray
from scipy.linalg import solve
from scipy.linalg.blas import ssyrk

from sim_ecu.design.cases import Progress, quietly
from sim_ecu.physics.compiled import compiled
from wrcd.core.terms import LOG_SPREADS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Fuzzy output 0 stands for 60 % adhesion, 100 for 2 %: n = 100 ln(60 / mu) / ln 30.
TOP_PCT, BOTTOM_PCT = 60.0, 2.0
BASE_STEP, SLOPE_STEP = 1.0, 0.5  # bases and slopes are rounded: a person reads them
# The paper's (16): strictly decreasing from 42 % at 0, below zero from 96.4 on. Kept as a preset, clamped.
PAPER_POLYNOMIAL = (-2.213e-6, 0.00042, -0.0205, -0.38, 42.0)
ORDER = 6  # of the polynomial
RIDGE = 0.3
HELD = 4.0  # standard deviations within which a column beyond those that choose the rules is held
ROUNDS = 3  # of reweighting, which turns squares into absolute errors in percentage points
MIN_ERROR_PP = 0.5  # below this an error weighs as a square
RELATIVE = 0.05  # share of the relative error in the weights, so that slippery rails count
SPREAD_ROUNDS = 6
SPREAD_RIDGE = 3.0
CHOOSE_EVERY = 5  # rules are chosen on every fifth window
COVERS = 0.9  # what an interval is to hold
WEIGHTS_AT_ONCE = 256  # windows whose weights stay in the processor's cache while they are multiplied
FOLDS = 2
ROUNDS_OF_FOLDS = 2


def output_of(mu_pct: FloatArray) -> FloatArray:
    """The fuzzy output that stands for an adhesion."""
    n: FloatArray = 100.0 * np.log(TOP_PCT / mu_pct) / math.log(TOP_PCT / BOTTOM_PCT)
    return n


def adhesion_of(output: FloatArray) -> FloatArray:
    """The adhesion (percent) that an output stands for; the polynomial describes this."""
    mu: FloatArray = TOP_PCT * (BOTTOM_PCT / TOP_PCT) ** (output / 100.0)
    return mu


@dataclass(frozen=True, slots=True)
class RuleBase:
    """Over k inputs with sets: their centres, rules (r, k) of set numbers. Over all c >= k columns: bases (r,) and
    slopes (r, c) of the output, and what the columns are held between, low and high (c,). middle (c,): where columns
    without sets count as in the middle.

    spreads (r,): relative half-width of the 90 % interval in the middle, spread_slopes (r, c) its change in decades per
    unit of a column. support (r,): sum of the weights over the training windows.
    typical (r, 2): adhesion (percent) between which nine tenths of a rule's windows lie.
    """

    centres: list[FloatArray]
    rules: IntArray
    bases: FloatArray
    slopes: FloatArray
    spreads: FloatArray
    spread_slopes: FloatArray
    support: FloatArray
    typical: FloatArray
    low: FloatArray
    high: FloatArray
    middle: FloatArray

    def shares(self, inputs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Share of each rule in the output (n, r), total weight (n,)."""
        w = weights(self.centres, self.rules, inputs)
        firing = w.sum(axis=1)
        return w / np.maximum(firing, 1e-9)[:, None], firing

    def output(self, inputs: FloatArray) -> FloatArray:
        """Fuzzy output (n,), 0 … 100."""
        return np.clip(self._mean(self.bases, self.slopes, inputs), 0.0, 100.0)

    def spread(self, inputs: FloatArray) -> FloatArray:
        """Relative half-width (n,) of the 90 % interval."""
        return _spread_of(self._mean(np.log10(self.spreads), self.spread_slopes, inputs))

    def _mean(self, bases: FloatArray, slopes: FloatArray, inputs: FloatArray) -> FloatArray:
        """Return the mean (n,) of the rules' outputs by their share."""
        share, _ = self.shares(inputs)
        held = np.clip(inputs, self.low, self.high)
        offset = bases - np.sum(slopes * self.middles, axis=1)
        out: FloatArray = share @ offset + np.sum((share @ slopes) * held, axis=1)
        return out

    @property
    def middles(self) -> FloatArray:
        """Where (r, c) each rule's base counts: centres of the sets that it names, and the middle of the rest."""
        return _middles(self.centres, self.rules, self.middle)

    def mu_pct(self, inputs: FloatArray) -> FloatArray:
        """Adhesion in percent (n,)."""
        return adhesion_of(self.output(inputs))


def _middles(centres: list[FloatArray], rules: IntArray, middle: FloatArray) -> FloatArray:
    named = np.column_stack([c[rules[:, i]] for i, c in enumerate(centres)])
    return np.column_stack((named, np.broadcast_to(middle[named.shape[1] :], (len(rules), len(middle) - len(centres)))))


def _spread_of(log10: FloatArray) -> FloatArray:
    return np.asarray(10.0 ** np.clip(log10, *LOG_SPREADS))


def memberships(centres: FloatArray, x: FloatArray) -> FloatArray:
    """Degrees (n, m) of the triangular sets at the centres, flat beyond the ends, by scikit-fuzzy."""
    lo, hi = centres[0], centres[-1]
    x = np.clip(x, lo, hi)
    out = []
    for j, c in enumerate(centres):
        left = centres[j - 1] if j else c
        right = centres[j + 1] if j + 1 < len(centres) else c
        out.append(skfuzzy.trimf(x, [left, c, right]))
    degrees: FloatArray = np.column_stack(out)
    return degrees


def weights(centres: list[FloatArray], rules: IntArray, inputs: FloatArray) -> FloatArray:
    """Firing (n, r): product of the degrees that a rule names."""
    w = np.ones((len(inputs), len(rules)))
    degrees = [memberships(c, inputs[:, i]) for i, c in enumerate(centres)]
    for first in range(0, len(inputs), WEIGHTS_AT_ONCE):
        rows = slice(first, first + WEIGHTS_AT_ONCE)
        for i, d in enumerate(degrees):
            w[rows] *= np.take(d[rows], rules[:, i], axis=1)
    return w


def fit(
    inputs: FloatArray,
    mu_pct: FloatArray,
    sets: Sequence[int],
    max_rules: int,
    importance: FloatArray,
    group: IntArray,
    covers: FloatArray,
    lowest: FloatArray | float = -math.inf,
    progress: Progress = quietly,
) -> RuleBase:
    """Sets evenly spaced between the 1 % and 99 % quantiles, the rules that speak for most, outputs by least squares.

    The first len(sets) columns of the inputs have sets; all of them move the outputs. importance (n,) of the windows.
    group (n,): windows of one condition belong together when errors are judged on windows that the fit has not seen,
    from which the spreads come. covers (n,): which quantile of the error a window's spread is to be.
    lowest (c,): what a column without sets is never held below.
    """
    k = len(sets)
    ends = np.quantile(inputs[:, :k], [0.01, 0.99], axis=0)
    centres = [np.linspace(ends[0, i], ends[1, i], m) for i, m in enumerate(sets)]
    every = np.stack(np.meshgrid(*(np.arange(m) for m in sets), indexing="ij"), axis=-1).reshape(-1, k)
    rules = every[choose(weights(centres, every, inputs[::CHOOSE_EVERY]), max_rules)]
    mean, reach = inputs.mean(axis=0), HELD * inputs.std(axis=0)
    low, high = np.maximum(mean - reach, lowest), mean + reach
    low[:k], high[:k] = ends
    middle = np.clip(mean, low, high)
    solutions = FOLDS * ROUNDS_OF_FOLDS + ROUNDS + SPREAD_ROUNDS
    local = _Local(centres, rules, inputs, low, high, middle, lambda done: progress("rule base", done / solutions))
    none = np.ones(len(rules)), np.zeros((len(rules), inputs.shape[1])), np.zeros(len(rules))
    rest = np.zeros((len(rules), 2)), low, high, middle
    error = np.empty(len(mu_pct))
    for fold in range(FOLDS):
        left_out = group % FOLDS == fold
        part = _outputs(local, np.flatnonzero(~left_out), mu_pct, importance, ROUNDS_OF_FOLDS)
        guess = RuleBase(centres, rules, *part, *none, *rest).mu_pct(inputs[left_out])
        error[left_out] = np.abs(guess - mu_pct[left_out]) / guess
    bases, slopes = _outputs(local, np.arange(len(mu_pct)), mu_pct, importance, ROUNDS)
    spreads, spread_slopes = _spreads(local, error, covers)
    share = local.share
    typical = np.array([quantiles(mu_pct, share[:, r], (0.05, 0.95)) for r in range(len(rules))])
    support = share.sum(axis=0)
    return RuleBase(centres, rules, bases, slopes, spreads, spread_slopes, support, typical, low, high, middle)


@compiled
def _fill_columns(
    share: NDArray[np.float32], z: NDArray[np.float32], rows: IntArray, root: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:  # fmt: skip
    width = z.shape[1]
    for i in range(len(rows)):
        for r in range(share.shape[1]):
            for c in range(width):
                out[i, r * width + c] = share[rows[i], r] * z[rows[i], c] * root[i]


class _Local:
    """Local linear models, one for each rule, as one linear regression over (rules x (1 + columns)) columns."""

    def __init__(
        self, centres: list[FloatArray], rules: IntArray, inputs: FloatArray, low: FloatArray, high: FloatArray,
        middle: FloatArray, solved: Callable[[int], None],
    ) -> None:  # fmt: skip
        """solved: is told how many solutions have been found."""
        self._solutions, self._solved = 0, solved
        w = weights(centres, rules, inputs)
        self.share = (w / np.maximum(w.sum(axis=1), 1e-9)[:, None]).astype(np.float32)
        held = np.clip(inputs, low, high)
        self._mean, self._size = held.mean(axis=0), np.maximum(held.std(axis=0), 1e-9)
        self._z = np.column_stack((np.ones(len(held)), (held - self._mean) / self._size)).astype(np.float32)
        self._width = self._z.shape[1]
        self._middles = _middles(centres, rules, middle)
        self._room = np.empty((0, 0), np.float32)  # for columns: new pages for each piece would cost as much as filling
        # a rule's level is held by little, its slopes by all of the ridge
        self._ridge = np.diag(np.tile([0.1, *[1.0] * (self._width - 1)], len(rules)))

    def columns(self, rows: IntArray, root: NDArray[np.float32]) -> NDArray[np.float32]:
        """The regression's columns of some rows, each times its root (rows,); they hold until the next call."""
        if len(self._room) < len(rows):
            self._room = np.empty((len(rows), self.share.shape[1] * self._width), np.float32)
        out = self._room[: len(rows)]
        _fill_columns(self.share, self._z, rows, root, out)
        return out

    def apply(self, found: FloatArray, rows: IntArray) -> FloatArray:
        """Return a solution's output for some rows."""
        found = found.astype(np.float32)
        parts = [self.columns(part, np.ones(len(part), np.float32)) @ found for part in _pieces(rows)]
        return np.concatenate(parts).astype(np.float64)

    def solve(self, rows: IntArray, target: FloatArray, weight: FloatArray, ridge: float) -> FloatArray:
        """Weighted least squares over some rows; target and weight are of those rows."""
        size = self._width * self.share.shape[1]
        square = np.asarray(ridge * self._ridge, dtype=np.float64)
        side: FloatArray = np.zeros(size)
        done = 0
        for part in _pieces(rows):
            root = np.sqrt(weight[done : done + len(part)]).astype(np.float32)
            X = self.columns(part, root)
            # the upper half of X' X; BLAS takes the transpose of a row-major array as it lies
            square += ssyrk(1.0, X.T)
            side += X.T @ (root * target[done : done + len(part)].astype(np.float32))
            done += len(part)
        found = np.asarray(solve(square, side, lower=False, assume_a="pos"), dtype=np.float64)
        self._solutions += 1
        self._solved(self._solutions)
        return found

    def read(self, found: FloatArray, middle: float) -> tuple[FloatArray, FloatArray]:
        """Values in the middle of each rule's sets (r,), and slopes per unit of the columns (r, c)."""
        table = found.reshape(-1, self._width)
        slopes = table[:, 1:] / self._size
        return middle + table[:, 0] + np.sum(slopes * (self._middles - self._mean), axis=1), slopes


def _pieces(rows: IntArray) -> list[IntArray]:
    """Rows in parts that fit into memory."""
    return np.array_split(rows, len(rows) // 20_000 + 1)


def _outputs(
    local: _Local, rows: IntArray, mu_pct: FloatArray, importance: FloatArray, rounds: int
) -> tuple[FloatArray, FloatArray]:
    """Bases and slopes, rounded. Reweighted least squares in the output; a ridge holds what the data does not."""
    mu = mu_pct[rows]
    target = output_of(mu)
    middle = float(target.mean())
    per_pp = importance[rows] * (1.0 + RELATIVE * 15.0 / mu)
    weight = importance[rows] / importance[rows].mean()
    for _ in range(rounds):
        found = local.solve(rows, target - middle, weight, RIDGE)
        error = np.abs(adhesion_of(np.clip(local.apply(found, rows) + middle, 0.0, 100.0)) - mu)
        weight = per_pp * mu / np.maximum(error, MIN_ERROR_PP)
        weight /= weight.mean()
    bases, slopes = local.read(found, middle)
    return np.round(bases / BASE_STEP) * BASE_STEP, np.round(slopes / SLOPE_STEP) * SLOPE_STEP


def polynomial() -> FloatArray:
    """Sixth order, as the paper says of its (16): fuzzy output to percent adhesion. Highest power first."""
    n = np.linspace(0.0, 100.0, 201)
    mu = adhesion_of(n)
    c = np.polynomial.polynomial.polyfit(n / 100.0, mu, ORDER, w=1.0 / mu)
    return np.array([c[k] / 100.0**k for k in range(ORDER, -1, -1)])


def choose(every: FloatArray, most: int) -> IntArray:
    """The rules (columns of (n, r)) that together speak for the windows best, one by one: each time the one that adds
    most where little is known so far."""
    left = np.ones(len(every))
    chosen: list[int] = []
    for _ in range(min(most, every.shape[1])):
        gain = left @ every
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        left -= left * every[:, best]
    return np.array(sorted(chosen))


def quantiles(x: FloatArray, weight: FloatArray, at: tuple[float, ...]) -> list[float]:
    """Weighted quantiles."""
    order = np.argsort(x, kind="stable")
    mass = np.cumsum(weight[order])
    return [float(x[order][min(int(np.searchsorted(mass, q * mass[-1])), len(x) - 1)]) for q in at]


def _spreads(local: _Local, error: FloatArray, covers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Spreads and their slopes: quantiles (n,) of the logarithm of the relative error, by reweighted squares."""
    target = np.log10(np.maximum(error, 1e-4))
    middle = float(np.quantile(target, covers.mean()))
    rows = np.arange(len(error))
    rest = target - middle  # one quantile for all is where it begins: from their mean it takes twice as many rounds
    for _ in range(SPREAD_ROUNDS):
        weight = np.where(rest > 0, covers, 1.0 - covers) / np.maximum(np.abs(rest), 0.02)
        found = local.solve(rows, target - middle, weight / weight.mean(), SPREAD_RIDGE)
        rest = target - middle - local.apply(found, rows)
    logs, slopes = local.read(found, middle)
    return _spread_of(logs), np.round(slopes, 3)
