"""The rules' oracle: scikit-fuzzy's membership functions. No code in common with the engine on the train."""

import numpy as np
import skfuzzy
from numpy.typing import NDArray

from wrcd.estimator.design import Design

FloatArray = NDArray[np.float64]


class FuzzyReference:
    """The rule base rule by rule: scikit-fuzzy's membership functions, the product of the degrees, the weighted mean.

    Not by skfuzzy.control: a rule's output is linear in the inputs, which its consequents cannot say; as seven
    consequents beside each other (a constant and six slopes) it takes minutes for what this does in milliseconds.
    """

    def __init__(self, design: Design) -> None:
        self._design = design
        self._functions = []
        for sets in design.sets:
            c, last = sets.centres, len(sets.centres) - 1
            self._functions.append(
                [skfuzzy.trimf(c, [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]]) for j in range(len(c))]
            )

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """Fuzzy outputs (n,) for inputs (n, columns); NaN where no rule speaks at all."""
        return np.array([self._weighted(row) for row in inputs]).clip(0, 100)

    def _weighted(self, row: FloatArray) -> float:
        d = self._design
        held = [min(max(float(x), low), high) for x, low, high in zip(row, d.low, d.high, strict=True)]
        above = total = 0.0
        for rule, base, rule_slopes in zip(d.rules, d.bases, d.slopes, strict=True):
            weight, says = 1.0, float(base)
            for i, (x, slope) in enumerate(zip(held, rule_slopes, strict=True)):
                if i < len(d.sets):
                    centres = d.sets[i].centres
                    if len(centres) > 1:  # one set alone always holds
                        weight *= float(skfuzzy.interp_membership(centres, self._functions[i][rule[i]], x))
                    middle = float(centres[rule[i]])
                else:
                    middle = float(d.middle[i])
                says += float(slope) * (x - middle)
            above, total = above + weight * says, total + weight
        return above / total if total > 0 else float("nan")
