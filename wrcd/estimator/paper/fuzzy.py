"""Fuzzy inference: rules over four residuals, torque and speed, compiled to a few array operations."""

from dataclasses import dataclass

import numpy as np

from wrcd.estimator.design import INPUTS, Design, FloatArray, IntArray

# Below this total firing no rule speaks for the moment: the answer is "I don't know", not a guess.
MIN_FIRING = 0.05
LOW_FIRING = 0.2  # below, few training conditions were like the moment: the interval is wider
LOG_SPREADS = (-2.7, 0.3)  # an interval is never narrower or wider than this, relative to the adhesion (log10)


@dataclass(frozen=True, slots=True)
class Inference:
    """Per axle (n,): output 0 … 100 (NaN where no rule fires), total firing, spread.

    rule: the one that weighs most (from 1, 0 none), and its share in the output.
    """

    output: FloatArray
    firing: FloatArray
    rule: IntArray
    rule_share: FloatArray
    spread: FloatArray

    def take(self, rows: IntArray | slice) -> "Inference":
        """Some of the axles."""
        return Inference(
            self.output[rows], self.firing[rows], self.rule[rows], self.rule_share[rows], self.spread[rows]
        )


class Fuzzy:
    """Product of the degrees is a rule's weight; the output is the weighted mean of what the rules say.

    A rule says its base, changed by its slopes as the inputs move away from the middle of its sets (Takagi and
    Sugeno's form). The first six inputs choose the rules, all of them move the outputs. Beyond its outermost sets an
    input counts as at their middle, for degrees and slopes alike.
    """

    def __init__(self, design: Design) -> None:
        self._sets = design.sets
        # A degree rises from a set's left neighbour and falls to its right one. Beyond the outermost sets, neighbours
        # at a distance of one and beyond: the degree stays one. A set that an input lacks lies far off.
        widest = max(len(s.centres) for s in self._sets)
        shape = (len(self._sets), widest)
        self._left, self._right = np.full(shape, 1e9), np.full(shape, -1e9)
        self._rise, self._fall = np.ones(shape), np.ones(shape)
        for i, s in enumerate(self._sets):
            c, m = s.centres, len(s.centres)
            gaps = np.diff(c)
            self._left[i, 0], self._left[i, 1:m] = c[0] - 1.0, c[:-1]
            self._right[i, m - 1], self._right[i, : m - 1] = c[-1] + 1.0, c[1:]
            self._rise[i, 1:m] = gaps
            self._fall[i, : m - 1] = gaps
        self._first = np.array([s.centres[0] for s in self._sets])
        self._last = np.array([s.centres[-1] for s in self._sets])
        # which product of two inputs' degrees, for the first and second, third and fourth, fifth and sixth input
        pairs = widest * design.rules[:, ::2] + design.rules[:, 1::2]
        self._pick = (pairs + widest * widest * np.arange(INPUTS // 2)).T.copy()
        self._low, self._high = design.low, design.high
        sets = [s.centres[design.rules[:, i]] for i, s in enumerate(self._sets)]
        rest = np.broadcast_to(design.middle[len(sets) :], (len(design.rules), len(design.middle) - len(sets)))
        middle = np.column_stack((*sets, rest))
        # base + slopes (x - middle), as one number and a row over x; the same of the spreads' logarithms
        logs = np.log10(design.spreads)
        offset = design.bases - np.sum(design.slopes * middle, axis=1)
        spread_offset = logs - np.sum(design.spread_slopes * middle, axis=1)
        self._columns = len(design.middle)
        self.consequents = np.column_stack((design.slopes, offset, design.spread_slopes, spread_offset))

    def infer(self, inputs: FloatArray) -> Inference:
        """inputs (n, COLUMNS): see `rule_inputs`. NaN in gives NaN out."""
        n = len(inputs)
        degrees = self.degrees(inputs)
        pairs = (degrees[:, ::2, :, None] * degrees[:, 1::2, None, :]).reshape(n, -1)
        of_pairs = pairs.take(self._pick, axis=1)
        weights = of_pairs[:, 0] * of_pairs[:, 1]
        weights *= of_pairs[:, 2]
        firing = np.add.reduce(weights, axis=1)
        known = firing >= MIN_FIRING
        share = weights / np.where(known, firing, 1.0)[:, None]
        held = np.minimum(np.maximum(inputs, self._low), self._high)
        both = (share @ self.consequents).reshape(n, 2, self._columns + 1)
        output, log_spread = (both[:, :, -1] + np.add.reduce(both[:, :, :-1] * held[:, None], axis=2)).T
        output = np.minimum(np.maximum(output, 0.0), 100.0)
        spread = 10.0 ** np.minimum(np.maximum(log_spread, LOG_SPREADS[0]), LOG_SPREADS[1])
        rule = weights.argmax(axis=1)
        rule_share = share[np.arange(n), rule]
        if known.all():
            return Inference(output, firing, rule + 1, rule_share, spread)
        return Inference(
            output=np.where(known, output, np.nan),
            firing=firing,
            rule=np.where(known, rule + 1, 0),
            rule_share=np.where(known, rule_share, np.nan),
            spread=np.where(known, spread, np.nan),
        )

    def degrees(self, inputs: FloatArray) -> FloatArray:
        """(n, 6, widest): of each set of each of the first six inputs; 0 for sets that an input lacks."""
        x = np.minimum(np.maximum(inputs[:, : len(self._sets)], self._first), self._last)[:, :, None]
        degrees = np.minimum((x - self._left) / self._rise, (self._right - x) / self._fall)
        out: FloatArray = np.minimum(np.maximum(degrees, 0.0), 1.0)
        return out
