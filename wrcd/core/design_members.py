"""A design as the table that the estimator in C reads: member by member of `wrcd_design`, in the header's order."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from wrcd.core.design import Design, FloatArray, HealthModel, closed_loop
from wrcd.core.terms import BLOCK_TICKS, SLOWEST_M_S

NOW_S = 0.06  # the torque of so long is the torque of the moment
STEP_S = 0.16  # and of so long before, that before a step
LASTS_S = 0.4  # so long lasts what the rail carries; a wheel that speeds up takes more torque for less
BANDS_HZ = ((0.0, 1.5), (3.0, 10.0), (10.0, 25.0))  # that a pair of sensors is compared in


class OverSpeed(NamedTuple):
    """A `wrcd_speed_table`: rows (v, width) over growing speeds (v,)."""

    speeds_m_s: FloatArray
    rows: FloatArray


Member = float | int | OverSpeed | np.ndarray | tuple[np.ndarray, ...] | Mapping[str, "Member"] | None
IN_PLACE = ("noise_rms", "sets")  # short arrays that stand in the table; of others it has the address


def band_filters(tick_s: float) -> FloatArray:
    """(BANDS, 6): b0 b1 b2 1 a1 a2 of a first-order Butterworth filter (bilinear) for each of BANDS_HZ."""
    out = []
    for low_hz, high_hz in BANDS_HZ:
        low, high = (math.tan(math.pi * f * tick_s) for f in (low_hz, high_hz))
        if low_hz == 0.0:
            b = high / (1.0 + high)
            out.append((b, b, 0.0, 1.0, (high - 1.0) / (high + 1.0), 0.0))
        else:
            width, square = high - low, low * high
            whole = 1.0 + width + square
            b = width / whole
            out.append((b, 0.0, -b, 1.0, 2.0 * (square - 1.0) / whole, (1.0 - width + square) / whole))
    return np.array(out)


def consequents(d: Design) -> FloatArray:
    """(rules, 2 (COLUMNS + 1)): what a rule says, its base and slopes about the middle of its sets, as slopes over the
    columns and one number; and the same of the logarithm of its spread."""
    sets = [s.centres[d.rules[:, i]] for i, s in enumerate(d.sets)]
    rest = np.broadcast_to(d.middle[len(sets) :], (len(d.rules), len(d.middle) - len(sets)))
    middle = np.column_stack((*sets, rest))
    offset = d.bases - np.sum(d.slopes * middle, axis=1)
    spread_offset = np.log10(d.spreads) - np.sum(d.spread_slopes * middle, axis=1)
    return np.column_stack((d.slopes, offset, d.spread_slopes, spread_offset))


def members(d: Design) -> dict[str, Member]:
    """Every member of `wrcd_design`; `health` is a `wrcd_health_table`, or None."""

    def over(table: FloatArray, speeds_m_s: FloatArray = d.speeds_m_s) -> OverSpeed:
        return OverSpeed(np.ascontiguousarray(speeds_m_s), np.ascontiguousarray(table.reshape(len(table), -1)))

    def blocks(seconds: float) -> int:
        return max(1, round(seconds / d.tick_s / BLOCK_TICKS))

    recent = max(2, round(d.recent_ticks / BLOCK_TICKS))
    interval, wheelbase = d.interval, d.wheelbase_m / d.tick_s
    return {
        "tick_s": d.tick_s,
        "is_paper": int(d.form == "paper"),
        "states": d.states,
        "window_ticks": d.window_ticks,
        "usual": -(-d.window_ticks // BLOCK_TICKS),
        "longest": -(-d.longest_ticks // BLOCK_TICKS),
        "recent": recent,
        "now": blocks(NOW_S),
        "step": blocks(STEP_S),
        "lasts": blocks(LASTS_S),
        "min_ticks": 0.5 * recent * BLOCK_TICKS,
        "A": over(closed_loop(d.Phi, d.K, d.H)),
        "B": over(d.Phi @ d.K),
        "H": over(d.H),
        "W": over(d.whiten),
        "speed_low_m_s": float(d.speeds_m_s[0]),
        "speed_high_m_s": float(d.speeds_m_s[-1]),
        "noise_power": over(d.noise_power),
        "noise_rms": d.noise_rms,
        "lowpass_sections": len(d.lowpass),
        "highpass_sections": len(d.highpass),
        "lowpass": d.lowpass,
        "highpass": d.highpass,
        "sets": np.array([len(s.centres) for s in d.sets], dtype=np.int32),
        "centres": tuple(s.centres for s in d.sets),
        "rules": len(d.rules),
        "powers": len(d.polynomial),
        "rule_sets": d.rules.astype(np.int32),
        "consequents": consequents(d),
        "low": d.low,
        "high": d.high,
        "polynomial": d.polynomial,
        "adhesion_low_pct": d.adhesion_range_pct[0],
        "adhesion_high_pct": d.adhesion_range_pct[1],
        "saturated_share": d.saturated_share,
        "beyond": d.beyond,
        "changes": over(d.changes, d.change_speeds_m_s),
        "widening": None if interval is None else over(interval.factors.T, np.log(interval.speeds_m_s)),
        "health": None if d.health is None else health_members(d.health),
        "bands": band_filters(d.tick_s),
        "wheelbase_m": d.wheelbase_m,
        "is_bogie": int(d.is_bogie),
        "longest_wheelbase_ticks": round(wheelbase / SLOWEST_M_S),
    }


def health_members(h: HealthModel) -> dict[str, Member]:
    """Every member of `wrcd_health_table`."""
    return {
        "hidden_units": len(h.hidden_bias),
        "middle": h.middle,
        "scale": h.scale,
        "hidden": h.hidden,
        "hidden_bias": h.hidden_bias,
        "out": h.out,
        "out_bias": h.out_bias,
        "temper": h.temper,
        "log_prior": h.log_prior,
        "kept": h.kept,
        "hazard": h.hazard,
    }
