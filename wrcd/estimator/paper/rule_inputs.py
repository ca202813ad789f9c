"""From a window's statistics to what the rules are given."""

from dataclasses import dataclass

import numpy as np

from wrcd.estimator.design import CHANNELS, COLUMNS, CROSSES, INPUTS, LAGS, MODELS, STEPS, Design, FloatArray
from wrcd.estimator.paper.bank import SpeedTable
from wrcd.estimator.paper.window import Statistics

# Columns: the six that choose the rules, then
LAG = slice(INPUTS, INPUTS + LAGS)
CROSS = slice(LAG.stop, LAG.stop + CROSSES)
LENGTH = CROSS.stop
NOISE = slice(LENGTH + 1, LENGTH + 1 + CHANNELS)
SWING = slice(NOISE.stop, NOISE.stop + 2)
STEP = slice(SWING.stop, SWING.stop + STEPS)
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
    the window's length in seconds and of the noise; the torque's swing; the steps.

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
        speed_m_s: float,
    ) -> FloatArray:  # fmt: skip
        """(m, COLUMNS) for the statistics of m windows and their torque ratios (m,): all axles (n,) with one length
        after all with another. past, noise_factor (2, n) and the floor (n, 4) that it leaves are the axles'."""
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
        return out
