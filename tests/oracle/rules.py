"""The rules' oracle: what they are given of a window, and inference with scikit-fuzzy's membership functions."""

from dataclasses import dataclass

import numpy as np
import skfuzzy

from tests.oracle.bank import SpeedTable
from tests.oracle.residuals import Statistics
from wrcd.core.design import Design, FloatArray, IntArray, Sets
from wrcd.core.terms import CHANNELS, COLUMNS, INPUTS, MODELS

# Columns: the six that choose the rules, then
LAG = slice(INPUTS, INPUTS + MODELS * CHANNELS)
CROSS = slice(LAG.stop, LAG.stop + MODELS)
LENGTH = CROSS.stop
NOISE = slice(LENGTH + 1, LENGTH + 1 + CHANNELS)
SWING = slice(NOISE.stop, NOISE.stop + 2)
STEP = slice(SWING.stop, SWING.stop + 4)
IN_BANDS = slice(STEP.stop, COLUMNS)
MIN_TORQUE = 0.003  # torque ratio: less is coasting, and says nothing
TORQUE_FLOOR = 0.01  # torque ratio: what moves below this is the noise of its signal
MIN_TRACK = 0.03  # of the noise's power: less from the track is not distinguished from none
MAX_STEP = 1.5  # decades


@dataclass(frozen=True, slots=True)
class Past:
    """What was before the window counts where it tells a drop of adhesion from a slip cycle.

    Torque ratios (n,) of the moment, and the lowest and highest of half a second. decades (n, 4): by which the
    unfiltered residuals of the newest part lie above those of the half second before it; NaN if unknown.
    """

    now: FloatArray
    lowest: FloatArray
    highest: FloatArray
    decades: FloatArray

    @property
    def steps(self) -> FloatArray:
        """(n, 4): the first two residuals' step, that of the third, of the fourth, and the largest without its sign."""
        known = np.where(np.isnan(self.decades), 0.0, self.decades)
        held = np.minimum(np.maximum(known, -MAX_STEP), MAX_STEP)
        out = np.empty_like(held)
        out[:, 0] = 0.5 * (held[:, 0] + held[:, 1])
        out[:, 1:3] = held[:, 2:]
        out[:, 3] = np.maximum.reduce(np.abs(held), axis=1)
        return out

    @property
    def swing(self) -> FloatArray:
        """(n, 2): decades by which the torque has been above and below that of the moment."""
        logs = np.log10(np.maximum((self.lowest, self.now, self.highest), 0.0) + TORQUE_FLOOR)
        out: FloatArray = np.array((logs[2] - logs[1], logs[1] - logs[0])).T
        return out


class RuleInputs:
    """log10 of residuals 1 to 3 over residual 4, of residual 4, of torque ratio and speed; the correlations; log10 of
    the window's length in seconds and of the noise; the torque's swing; the steps; what the signals are in bands.

    The share of the sensors' noise is taken off first: what is left goes with the track's roughness alike in all four.
    Model 4, in the linear region, takes its present size; what the others make of the same track tells the contact.
    """

    def __init__(self, design: Design) -> None:
        self._paper, self._tick_s = design.form == "paper", design.tick_s
        self._noise_power = SpeedTable(design.noise_power, design.speeds_m_s)

    def floor(self, noise_factor: FloatArray, speed_m_s: float) -> FloatArray:
        """(n, 4): mean square residual that sensors noise_factor (2, n) times as noisy as the design's leave."""
        power = self._noise_power.at(speed_m_s)
        out: FloatArray = (power @ (noise_factor * noise_factor)).T / CHANNELS
        return out

    def columns(
        self, s: Statistics, window_ratio: FloatArray, past: Past, noise_factor: FloatArray, floor: FloatArray,
        speed_m_s: float, in_bands: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """(m, COLUMNS) for the statistics of m windows and their torque ratios (m,): all axles (n,) with one length
        after all with another. past, noise_factor (2, n) and the floor (n, 4) that it leaves are the axles'; in_bands
        (m, 33): what the signals are there."""
        m, n = len(window_ratio), noise_factor.shape[1]
        out = np.empty((m, COLUMNS))
        of_axle = out.reshape(-1, n, COLUMNS)
        if self._paper:
            out[:, :MODELS] = np.log10(s.residuals)
        else:
            above = s.mean_square.reshape(-1, n, MODELS) - floor
            logs = 0.5 * np.log10(np.maximum(above, MIN_TRACK * floor))
            of_axle[:, :, :3] = logs[..., :3] - logs[..., 3:]
            of_axle[:, :, 3] = logs[..., 3]
        out[:, MODELS] = np.log10(np.maximum(window_ratio, MIN_TORQUE))
        of_axle[:, :, MODELS + 1] = np.log10(speed_m_s)
        out[:, LAG] = s.lag
        out[:, CROSS] = s.cross
        out[:, LENGTH] = np.log10(s.ticks * self._tick_s)
        of_axle[:, :, NOISE] = np.log10(noise_factor).T
        of_axle[:, :, SWING] = past.swing
        of_axle[:, :, STEP] = past.steps
        out[:, IN_BANDS] = in_bands
        return out


# Below this total firing no rule speaks for the moment: the answer is "I don't know", not a guess.
MIN_FIRING = 0.05
LOG_SPREADS = (-2.7, 0.3)  # an interval is never narrower or wider than this, relative to the adhesion (log10)


@dataclass(frozen=True, slots=True)
class Inference:
    """Per window (n,): output 0 … 100 (NaN where no rule fires), total firing, spread.

    rule: the one that weighs most (from 1, 0 none), and its share in the output.
    """

    output: FloatArray
    firing: FloatArray
    rule: IntArray
    rule_share: FloatArray
    spread: FloatArray

    def take(self, rows: slice) -> "Inference":
        """Some of the windows."""
        return Inference(
            self.output[rows], self.firing[rows], self.rule[rows], self.rule_share[rows], self.spread[rows]
        )


class Rules:
    """The rule base: scikit-fuzzy's membership functions, the product of the degrees, the weighted mean of what each
    rule says, its base and slopes about the middle of its sets (Takagi's and Sugeno's form).

    Not by skfuzzy.control: a rule's output is linear in the inputs, which its consequents cannot say; as seven
    consequents beside each other (a constant and six slopes) it takes minutes for what this does in milliseconds.
    """

    def __init__(self, design: Design) -> None:
        self._design = design
        centres = [s.centres[design.rules[:, i]] for i, s in enumerate(design.sets)]
        rest = np.tile(design.middle[INPUTS:], (len(design.rules), 1))
        self._middle = np.column_stack((*centres, rest))  # (r, COLUMNS)

    def infer(self, inputs: FloatArray) -> Inference:
        """inputs (n, COLUMNS). NaN in gives NaN out."""
        d = self._design
        weights = np.ones((len(inputs), len(d.rules)))
        for i, sets in enumerate(d.sets):
            weights *= degrees(sets, inputs[:, i])[:, d.rules[:, i]]
        firing = weights.sum(axis=1)
        known = firing >= MIN_FIRING
        share = weights / np.where(known, firing, np.nan)[:, None]
        away = np.clip(inputs, d.low, d.high)[:, None] - self._middle  # (n, r, COLUMNS)
        says = d.bases + (d.slopes * away).sum(axis=2)
        log_spread = np.log10(d.spreads) + (d.spread_slopes * away).sum(axis=2)
        rule = weights.argmax(axis=1)
        return Inference(
            output=(share * says).sum(axis=1).clip(0.0, 100.0),
            firing=firing,
            rule=np.where(known, rule + 1, 0),
            rule_share=share[np.arange(len(share)), rule],
            spread=10.0 ** (share * log_spread).sum(axis=1).clip(*LOG_SPREADS),
        )


def degrees(sets: Sets, x: FloatArray) -> FloatArray:
    """(n, m): of each set for x (n,); beyond the outermost ones x counts as at their middle."""
    c, last = sets.centres, len(sets.centres) - 1
    if not last:  # one set alone always holds
        return np.where(np.isnan(x), np.nan, 1.0)[:, None]
    held = np.clip(x, c[0], c[-1])
    functions = [skfuzzy.trimf(c, [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]]) for j in range(len(c))]
    return np.stack([skfuzzy.interp_membership(c, f, held) for f in functions], axis=1)
