"""Membership functions, rule base and polynomial, fitted to simulated residuals (Figs. 6, 8, 9, 10 and (16)).

A rule says: if residual 1 is Low and … and the torque is T_3 and the speed Slow, then the output is its base, changed
by its slopes as the inputs move away from the middle of its sets. The output is the mean of the rules by their weight.
"""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from threading import Lock

import numpy as np
import skfuzzy
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from sim_ecu.design.cases import Progress, quietly
from wrcd.core.terms import LOG_SPREADS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Fuzzy output 0 stands for 60 % adhesion, 100 for 2 %: n = 100 ln(60 / mu) / ln 30.
TOP_PCT, BOTTOM_PCT = 60.0, 2.0
# The paper's (16): strictly decreasing from 42 % at 0, below zero from 96.4 on. Kept as a preset, clamped.
PAPER_POLYNOMIAL = (-2.213e-6, 0.00042, -0.0205, -0.38, 42.0)
ORDER = 6  # of the polynomial
HELD = 4.0  # standard deviations within which a column beyond those that choose the rules is held
# The outputs are those of the least mean loss: squares up to SQUARES of the targets' standard deviations, then absolute
# errors; of the spreads the quantile's own loss, rounded within ROUNDED decades. With a ridge that holds what the data
# does not, the loss has one minimum; after STEPS steps, or where the loss hardly falls, worlds that were not trained in
# gain nothing more.
RIDGE, SQUARES, ROUNDED, STEPS, TOLD_EVERY = 1e-6, 0.35, 0.03, 120, 10
CHOOSE_EVERY = 5  # rules are chosen on every fifth window
COVERS = 0.9  # what an interval is to hold
WEIGHTS_AT_ONCE = 256  # windows whose weights stay in the processor's cache while they are multiplied
AT_ONCE = 50_000  # windows of a part of a sum
FOLDS = 2


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
    """Sets evenly spaced between the 1 % and 99 % quantiles, the rules that speak for most, outputs of the least loss.

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
    local = _Local(centres, rules, inputs, low, high, middle, lambda share: progress("rule base", share))
    none = np.ones(len(rules)), np.zeros((len(rules), inputs.shape[1])), np.zeros(len(rules))
    rest = np.zeros((len(rules), 2)), low, high, middle

    def unseen(fold: int) -> tuple[NDArray[np.bool_], FloatArray]:
        left_out = group % FOLDS == fold
        part = _outputs(local, np.flatnonzero(~left_out), mu_pct, importance)
        guess = RuleBase(centres, rules, *part, *none, *rest).mu_pct(inputs[left_out])
        return left_out, np.abs(guess - mu_pct[left_out]) / guess

    error = np.empty(len(mu_pct))
    with ThreadPoolExecutor(FOLDS) as threads:  # numpy lets go of the interpreter
        for left_out, errors in threads.map(unseen, range(FOLDS)):
            error[left_out] = errors
        made = threads.submit(_outputs, local, np.arange(len(mu_pct)), mu_pct, importance)
        spreads, spread_slopes = _spreads(local, error, covers)
        bases, slopes = made.result()
    progress("rule base", 1.0)
    share = local.share
    typical = np.array([quantiles(mu_pct, share[:, r], (0.05, 0.95)) for r in range(len(rules))])
    support = share.sum(axis=0)
    return RuleBase(centres, rules, bases, slopes, spreads, spread_slopes, support, typical, low, high, middle)


Loss = Callable[[NDArray[np.float32], slice], tuple[NDArray[np.float32], NDArray[np.float32]]]


class _Local:
    """Local linear models, one for each rule: outputs of (rules x (1 + columns)) numbers, standardised."""

    def __init__(
        self, centres: list[FloatArray], rules: IntArray, inputs: FloatArray, low: FloatArray, high: FloatArray,
        middle: FloatArray, solved: Callable[[float], None],
    ) -> None:  # fmt: skip
        """solved: called with the share of the steps of all solutions that is done; they are solved in threads."""
        self._steps, self._solved, self._counts = 0, solved, Lock()
        w = weights(centres, rules, inputs)
        self.share = (w / np.maximum(w.sum(axis=1), 1e-9)[:, None]).astype(np.float32)
        held = np.clip(inputs, low, high)
        self._mean, self._size = held.mean(axis=0), np.maximum(held.std(axis=0), 1e-9)
        self._z = np.column_stack((np.ones(len(held)), (held - self._mean) / self._size)).astype(np.float32)
        self._middles = _middles(centres, rules, middle)

    def solve(self, rows: IntArray, loss: Loss, weight: FloatArray) -> FloatArray:
        """The numbers (rules, 1 + columns) of the least loss over some rows. loss: of some outputs, at their places
        among the rows, and its derivative. weight (rows,): of each row's."""
        share, z, shape = self.share[rows], self._z[rows], (self.share.shape[1], self._z.shape[1])
        each = (weight / weight.sum()).astype(np.float32)

        def total(numbers: FloatArray) -> tuple[float, FloatArray]:
            found, value, slope = numbers.reshape(shape).astype(np.float32), 0.0, np.zeros(shape)
            for part in (slice(k, k + AT_ONCE) for k in range(0, len(rows), AT_ONCE)):
                lost, by_output = loss(np.einsum("nr,nr->n", share[part], z[part] @ found.T), part)
                value += float(each[part] @ lost)
                slope += (share[part] * (each[part] * by_output)[:, None]).T @ z[part]
            return value + 0.5 * RIDGE * float(numbers @ numbers), slope.ravel() + RIDGE * numbers

        limits = {"maxiter": STEPS, "maxcor": 20}
        made = minimize(total, np.zeros(share.shape[1] * shape[1]), jac=True, method="L-BFGS-B", options=limits,
                        callback=self._step)  # fmt: skip
        return np.asarray(made.x.reshape(shape))

    def _step(self, _: FloatArray) -> None:
        with self._counts:
            self._steps += 1
            if self._steps % TOLD_EVERY == 0:
                self._solved(self._steps / STEPS / (FOLDS + 2))

    def read(self, found: FloatArray, middle: float, unit: float) -> tuple[FloatArray, FloatArray]:
        """Values in the middle of each rule's sets (r,), and slopes per unit of the columns (r, c)."""
        slopes = unit * found[:, 1:] / self._size
        return middle + unit * found[:, 0] + np.sum(slopes * (self._middles - self._mean), axis=1), slopes


def _outputs(
    local: _Local, rows: IntArray, mu_pct: FloatArray, importance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Bases (r,) and slopes (r, c), rounded: a person reads them."""
    target = output_of(mu_pct[rows])
    middle, unit = float(target.mean()), float(target.std())
    standard = ((target - middle) / unit).astype(np.float32)

    def loss(output: NDArray[np.float32], part: slice) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        error = output - standard[part]
        held = np.clip(error, -SQUARES, SQUARES)
        return held * (error - 0.5 * held), held

    bases, slopes = local.read(local.solve(rows, loss, importance[rows]), middle, unit)
    return np.round(bases), np.round(slopes, 1)


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
    """Spreads and their slopes: quantiles (n,) of the logarithm of the relative error."""
    target = np.log10(np.maximum(error, 1e-4))
    middle = float(np.quantile(target, covers.mean()))
    rest, asked = (target - middle).astype(np.float32), covers.astype(np.float32)

    def loss(output: NDArray[np.float32], part: slice) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        above = (rest[part] - output) / ROUNDED
        return ROUNDED * (asked[part] * above + np.logaddexp(np.float32(0.0), -above)), expit(-above) - asked[part]

    found = local.solve(np.arange(len(error)), loss, np.ones(len(error)))
    logs, slopes = local.read(found, middle, 1.0)
    return _spread_of(logs), np.round(slopes, 3)
