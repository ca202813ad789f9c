"""The paper's own form of the estimator, as a design that the daemon runs: what wrcd is compared with first.

Raw RMS of the four residuals over one window, and torque; Low, Moderate and High, T_1 … T_8; a rule says one of the
named output sets; the output is the rules' mean by weight, and (16) turns it into adhesion. No ratios of residuals, no
slopes, no speed, no low-pass, no noise taken off, no joints left out, no change looked for, one length of window.

A residual is the innovation as it is: each channel in units of its sensor's noise, alike in all four models. (In units
of its own expected size, as wrcd's own form has it, a filter's residual is about 1 where it matches, and that need not
be the lowest.) So a filter whose process noise is right for its point leaves the least there, whatever the others do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.linear import Point
from sim_ecu.design.rules import COVERS, PAPER_POLYNOMIAL, RuleBase, choose, quantiles, weights
from sim_ecu.physics.contact import CURVES
from wrcd.core.terms import LOG_SPREADS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# The paper's four design points. Searched: the three process noises of each model, by CMA-ES from the noise that leaves
# the least residual of each at its own point, some 4000 candidates from several starts; for the mean and the worst
# share of one-second windows at 15, 25 and 40 m/s in which the matching residual is the lowest of the four (models 1 to
# 3 held at their points, 20 tracks; model 4 on six curves at 0.004 to 0.3 of the peak's creep, 4 tracks). What came
# out, on ten fresh tracks (`search.matching`): 0.97, 0.87, 0.73 and 0.72 of the windows; wrcd's own noise in the same
# form: 0.03, 0, 1 and 0.42. Much more is not in a second: between the peaks of C and D the lead is 2 to 4 % of a
# residual. Three short searches in units of each innovation's own expected size came to 0.5 to 0.57 of all windows,
# these to 0.82.
PAPER_POINTS = (
    Point("curve A at its peak", CURVES["A"], 1.0, (1.12e-5, 0.000201, 3.16e-5)),
    Point("curve C at its peak", CURVES["C"], 1.0, (0.000767, 0.000923, 3.13e-5)),
    Point("curve D at its peak", CURVES["D"], 1.0, (0.000108, 0.00223, 0.00203)),
    Point("curve B, linear region", CURVES["B"], 0.004, (0.00492, 0.45, 0.00278)),
)
PAPER_GRID = 24  # speeds of the bank: half of wrcd's, for a smaller file
TORQUE_SETS = 8  # the paper's T_8 is the highest that it names
PASS = ((1.0, 0.0, 0.0, 1.0, 0.0, 0.0),)  # second-order sections of no filter at all
# Borders of the named output sets, percent: the paper's rules name "mu >= 40 %" and "20 % >= mu >= 10 %".
BORDERS_PCT = (40.0, 30.0, 20.0, 10.0, 5.0, 2.5)
RANGE_PCT = (0.5, 42.0)  # (16) is 42 % at 0 and below zero from 96.4 on
FOLDS = 2


def output_of(mu_pct: FloatArray) -> FloatArray:
    """The fuzzy output that (16) turns into an adhesion; 0 for what is above its 42 %."""
    n = np.linspace(0.0, 100.0, 10_001)
    return np.asarray(np.interp(-np.asarray(mu_pct), -np.polyval(PAPER_POLYNOMIAL, n), n))


def output_sets() -> tuple[list[str], FloatArray]:
    """Names of the output sets, from dry to slippery, and their middles, 0 … 100: where (16) gives the middle of
    their adhesions."""
    top, bottom = BORDERS_PCT[0], BORDERS_PCT[-1]
    inner = list(pairwise(BORDERS_PCT))
    names = [f"mu >= {top:g} %", *(f"{a:g} % >= mu >= {b:g} %" for a, b in inner), f"mu <= {bottom:g} %"]
    middles = [RANGE_PCT[1], *(0.5 * (a + b) for a, b in inner), 0.5 * bottom]
    return names, np.round(output_of(np.array(middles)))


@dataclass(frozen=True, slots=True)
class PaperRules(RuleBase):
    """A rule base whose rules say output sets: says (r,) which, of `output_sets`."""

    says: IntArray

    def mu_pct(self, inputs: FloatArray) -> FloatArray:
        """Adhesion in percent (n,), by (16)."""
        return np.clip(np.polyval(PAPER_POLYNOMIAL, self.output(inputs)), *RANGE_PCT)


def fit_paper(
    inputs: FloatArray,
    mu_pct: FloatArray,
    sets: Sequence[int],
    max_rules: int,
    importance: FloatArray,
    group: IntArray,
) -> PaperRules:
    """Sets evenly spaced between the 1 % and 99 % quantiles, rules as Wang and Mendel make them from data: a rule says
    the output set nearest to the mean of its windows by weight.

    Arguments as of `rules.fit`. The spreads are constants, from windows that the rules have not seen.
    """
    k, columns = len(sets), inputs.shape[1]
    ends = np.quantile(inputs[:, :k], [0.01, 0.99], axis=0)
    centres = [np.linspace(ends[0, i], ends[1, i], m) if m > 1 else ends[:, i].mean(keepdims=True)
               for i, m in enumerate(sets)]  # fmt: skip
    every = np.stack(np.meshgrid(*(np.arange(m) for m in sets), indexing="ij"), axis=-1).reshape(-1, k)
    rules = every[choose(weights(centres, every, inputs[::5]), max_rules)]
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    low[:k], high[:k] = [c[0] for c in centres], [c[-1] for c in centres]
    fired = weights(centres, rules, inputs)
    share = fired / np.maximum(fired.sum(axis=1), 1e-9)[:, None]
    none = np.zeros((len(rules), columns))

    def base(rows: NDArray[np.bool_], spreads: FloatArray) -> PaperRules:
        says = _nearest_sets(share[rows] * importance[rows, None], mu_pct[rows])
        bases = output_sets()[1][says]
        typical = np.array([quantiles(mu_pct, share[:, r], (0.05, 0.95)) for r in range(len(rules))])
        return PaperRules(
            centres,
            rules,
            bases,
            none,
            spreads,
            none,
            share.sum(axis=0),
            typical,
            low,
            high,
            inputs.mean(axis=0),
            says,
        )

    error = np.empty(len(mu_pct))
    for fold in range(FOLDS):
        left_out = group % FOLDS == fold
        guess = base(~left_out, np.ones(len(rules))).mu_pct(inputs[left_out])
        error[left_out] = np.abs(guess - mu_pct[left_out]) / guess
    spreads = np.array([quantiles(error, share[:, r], (COVERS,))[0] for r in range(len(rules))])
    return base(np.ones(len(mu_pct), dtype=bool), np.clip(spreads, *10.0 ** np.array(LOG_SPREADS)))


def _nearest_sets(weight: FloatArray, mu_pct: FloatArray) -> IntArray:
    """(r,): the output set nearest to the mean of each rule, for weights (n, r) of the windows."""
    mean = output_of(mu_pct) @ weight / np.maximum(weight.sum(axis=0), 1e-9)
    return np.asarray(np.abs(mean[:, None] - output_sets()[1]).argmin(axis=1))
