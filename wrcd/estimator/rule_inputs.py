"""From a window's statistics to what the rules are given."""

from dataclasses import dataclass

import numpy as np

from wrcd.estimator.bank import at_speed
from wrcd.estimator.design import CHANNELS, COLUMNS, STEPS, Design, FloatArray
from wrcd.estimator.window import Statistics

_SWING = COLUMNS - STEPS - 2
SWING = slice(_SWING, _SWING + 2)  # columns of rule_inputs
MIN_TORQUE = 0.003  # torque ratio: less is coasting, and says nothing
TORQUE_FLOOR = 0.01  # torque ratio: what moves below this is the noise of its signal
MIN_TRACK = 0.03  # of the noise's power: less from the track is not told from none
MAX_STEP = 1.5  # decades


def noise_floor(design: Design, noise_factor: FloatArray, speed_m_s: float) -> FloatArray:
    """(n, 4): mean square residual that sensors noise_factor (2, n) times as noisy as the design's leave."""
    power = at_speed(design.noise_power, design.speeds_m_s, speed_m_s)
    floor: FloatArray = (power @ (noise_factor * noise_factor)).T / CHANNELS
    return floor


@dataclass(frozen=True, slots=True)
class Past:
    """What was before the window counts where it tells a drop of adhesion from a slip cycle.

    Torque ratios (n,): in the window, of the moment, and the lowest and highest of half a second. decades (n, 4): by
    which the unfiltered residuals of the newest part lie above those of the half second before it; NaN if unknown.
    """

    window: FloatArray
    now: FloatArray
    lowest: FloatArray
    highest: FloatArray
    decades: FloatArray

    @property
    def steps(self) -> FloatArray:
        """(n, 4): the first two residuals' step, that of the third, of the fourth, and the largest without its sign."""
        held = np.clip(np.nan_to_num(self.decades), -MAX_STEP, MAX_STEP)
        largest = np.abs(held).max(axis=1)
        return np.column_stack((0.5 * (held[:, 0] + held[:, 1]), held[:, 2], held[:, 3], largest))

    @property
    def swing(self) -> FloatArray:
        """(n, 2): decades by which the torque has been above and below that of the moment."""
        logs = [np.log10(np.maximum(x, 0.0) + TORQUE_FLOOR) for x in (self.lowest, self.now, self.highest)]
        return np.column_stack((logs[2] - logs[1], logs[1] - logs[0]))


def rule_inputs(design: Design, s: Statistics, past: Past, noise_factor: FloatArray, speed_m_s: float) -> FloatArray:
    """(n, COLUMNS): log10 of residuals 1 to 3 over residual 4, of residual 4, of torque ratio and speed; the
    correlations; log10 of the window's length in seconds and of the noise factor (2, n); the torque's swing; the steps.

    The share of the sensors' noise is taken off first: what is left goes with the track's roughness alike in all four.
    Model 4, in the linear region, takes its present size; what the others make of the same track tells the contact.
    """
    if design.form == "paper":
        logs = np.log10(s.residuals)
        heads = logs
    else:
        floor = noise_floor(design, noise_factor, speed_m_s)
        mean_square = s.power.sum(axis=2) / CHANNELS
        logs = 0.5 * np.log10(np.maximum(mean_square - floor, MIN_TRACK * floor))
        heads = np.column_stack((logs[:, :-1] - logs[:, -1:], logs[:, -1]))
    used = np.log10(np.maximum(past.window, MIN_TORQUE))
    with np.errstate(divide="ignore"):
        length = np.log10(s.ticks * design.tick_s)
    speed = np.full(len(logs), np.log10(speed_m_s))
    noise = np.log10(noise_factor).T
    return np.column_stack((heads, used, speed, s.lag, s.cross, length, noise, past.swing, past.steps))


def excitation(design: Design, s: Statistics, noise_factor: FloatArray, speed_m_s: float) -> FloatArray:
    """(n,): the largest of the four residuals over what the sensors' noise alone leaves of it."""
    floor = noise_floor(design, noise_factor, speed_m_s)
    return np.asarray(np.sqrt((s.power.sum(axis=2) / CHANNELS / floor).max(axis=1)))
