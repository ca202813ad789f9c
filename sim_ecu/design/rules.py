"""Membership functions, rule base and polynomial, fitted to simulated residuals (Figs. 6, 8, 9, 10 and (16))."""

import math
from dataclasses import dataclass

import numpy as np
import skfuzzy
from numpy.typing import NDArray

from sim_ecu.design.cases import Features

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Fuzzy output 0 stands for 60 % adhesion, 100 for 2 %: n = 100 ln(60 / mu) / ln 30.
TOP_PCT, BOTTOM_PCT = 60.0, 2.0
OUTPUT_STEP = 5.0  # output sets stand at 0, 5, … 100, all of one width
# The paper's (16): strictly decreasing from 42 % at 0, below zero from 96.4 on. Kept as a preset, clamped.
PAPER_POLYNOMIAL = (-2.213e-6, 0.00042, -0.0205, -0.38, 42.0)
RIDGE = 1.0
ORDER = 6  # of the polynomial
RESIDUAL_NAMES = ("Low", "Moderate", "High")


def output_of(mu_pct: FloatArray) -> FloatArray:
    """The fuzzy output that stands for an adhesion."""
    n: FloatArray = 100.0 * np.log(TOP_PCT / mu_pct) / math.log(TOP_PCT / BOTTOM_PCT)
    return n


@dataclass(frozen=True, slots=True)
class RuleBase:
    """centres of the sets of each input; rules (r, 5) of set numbers; consequents 0 … 100; spreads (shares)."""

    centres: list[FloatArray]
    rules: IntArray
    consequents: FloatArray
    spreads: FloatArray
    support: FloatArray  # sum of the rule's weights over the training data
    polynomial: FloatArray
    fuzzy: FloatArray  # output on the training data


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
    for i, c in enumerate(centres):
        w *= memberships(c, inputs[:, i])[:, rules[:, i]]
    return w


def fit(data: Features, torque_sets: int, most_rules: int) -> RuleBase:
    """Sets evenly spaced between the 1 % and 99 % quantiles, the rules that fire most, consequents by least squares.

    A ridge pulls each consequent towards the mean of the data it fires on. Relative errors of the adhesion weigh alike.
    """
    centres = []
    for i in range(data.inputs.shape[1]):
        lo, hi = np.quantile(data.inputs[:, i], [0.01, 0.99])
        centres.append(np.linspace(lo, hi, torque_sets if i == 4 else len(RESIDUAL_NAMES)))
    grid = np.stack(np.meshgrid(*(np.arange(len(c)) for c in centres), indexing="ij"), axis=-1).reshape(-1, 5)
    every = weights(centres, grid, data.inputs)
    rules = grid[np.sort(np.argsort(-every.sum(axis=0), kind="stable")[:most_rules])]
    W = weights(centres, rules, data.inputs)
    firing = W.sum(axis=1)
    share = W / np.maximum(firing, 1e-9)[:, None]
    target = output_of(data.mu_pct)
    importance = np.sqrt(firing)
    X = share * importance[:, None]
    own = (W.T @ target) / np.maximum(W.sum(axis=0), 1e-9)
    # minimise |X (own + d) - y|^2 + RIDGE |d|^2
    d = np.linalg.solve(X.T @ X + RIDGE * np.eye(len(rules)), X.T @ (target * importance - X @ own))
    consequents = np.clip(np.round((own + d) / OUTPUT_STEP) * OUTPUT_STEP, 0.0, 100.0)
    fuzzy = share @ consequents
    polynomial = fit_polynomial(fuzzy, data.mu_pct)
    error = np.abs(np.polyval(polynomial, fuzzy) / data.mu_pct - 1.0)
    return RuleBase(centres, rules, consequents, _spreads(share, error), W.sum(axis=0), polynomial, fuzzy)


def fit_polynomial(fuzzy: FloatArray, mu_pct: FloatArray) -> FloatArray:
    """Sixth order, as the paper says of its (16): fuzzy output to percent adhesion. Highest power first."""
    c = np.polynomial.polynomial.polyfit(fuzzy / 100.0, mu_pct, ORDER, w=1.0 / mu_pct)
    return np.array([c[k] / 100.0**k for k in range(ORDER, -1, -1)])


def _spreads(share: FloatArray, error: FloatArray) -> FloatArray:
    """Relative half-width of the 90 % interval where each rule speaks: the weighted quantile of the training errors."""
    order = np.argsort(error)
    mass = np.cumsum(share[order], axis=0)
    total = mass[-1]
    at = np.array([np.searchsorted(mass[:, r], 0.9 * total[r]) for r in range(share.shape[1])])
    spread: FloatArray = np.where(total > 1.0, error[order][np.minimum(at, len(error) - 1)], 1.0)
    return spread
