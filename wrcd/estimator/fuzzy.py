"""Fuzzy inference: rules over four residuals and the torque, compiled to a few array operations."""

from dataclasses import dataclass

import numpy as np

from wrcd.estimator.design import Design, FloatArray, IntArray

# Below this total firing no rule speaks for the moment: the answer is "I don't know", not a guess.
LEAST_FIRING = 0.05


@dataclass(frozen=True, slots=True)
class Inference:
    """Per axle (n,): output 0 … 100 (NaN where no rule fires), total firing, dominant rule (from 1, 0 none), spread."""

    output: FloatArray
    firing: FloatArray
    rule: IntArray
    spread: FloatArray


class Fuzzy:
    """Product of the degrees is a rule's weight; the output is the weighted mean of the rules' consequents.

    That is the centroid of the accumulated output sets, which all have the same width.
    """

    def __init__(self, design: Design) -> None:
        self._sets = (*design.residual_sets, design.torque_sets)
        widest = max(len(s.centres) for s in self._sets)
        self._widest = widest
        self._pick = design.rules + widest * np.arange(len(self._sets))
        self._consequents = design.consequents
        self._spreads = design.spreads

    def infer(self, inputs: FloatArray) -> Inference:
        """inputs (n, 5): log10 of the four residuals and of the torque ratio. NaN in gives NaN out."""
        n = len(inputs)
        degrees = np.zeros((n, len(self._sets), self._widest))
        for i, sets in enumerate(self._sets):
            degrees[:, i, : len(sets.centres)] = sets.memberships(inputs[:, i])
        weights = degrees.reshape(n, -1)[:, self._pick].prod(axis=2)
        firing = weights.sum(axis=1)
        known = firing >= LEAST_FIRING
        safe = np.where(known, firing, 1.0)
        return Inference(
            output=np.where(known, weights @ self._consequents / safe, np.nan),
            firing=firing,
            rule=np.where(known, np.argmax(weights, axis=1) + 1, 0),
            spread=np.where(known, weights @ self._spreads / safe, np.nan),
        )
