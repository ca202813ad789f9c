"""A design as the table that the C estimator reads: member by member of `wrcd_design`, in the header's order."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from wrcd.estimator.design import Design, FloatArray, closed_loop
from wrcd.estimator.paper.fuzzy import Fuzzy
from wrcd.estimator.paper.window import Lengths
from wrcd.estimator.trust.pair import SLOWEST_M_S, band_filters


class OverSpeed(NamedTuple):
    """A `wrcd_speed_table`: rows (v, width) over growing speeds (v,)."""

    speeds_m_s: FloatArray
    rows: FloatArray


Member = float | int | OverSpeed | np.ndarray | tuple[np.ndarray, ...] | Mapping[str, "Member"] | None
IN_PLACE = ("noise_rms", "sets")  # short arrays that stand in the table; of others it has the address


LIMITS = {
    "states": 16, "rules": 254, "powers": 12, "lowpass_sections": 8, "highpass_sections": 8, "sets": 16,
    "hidden_units": 128,
}  # fmt: skip


def beyond_limits(of: Mapping[str, Member]) -> str | None:
    """What of a table is more than the C estimator takes; None: nothing."""
    for name, most in LIMITS.items():
        value = of.get(name, 0)
        if isinstance(value, np.ndarray):
            value = int(value.max())
        if isinstance(value, int) and value > most:
            return f"{value} {name.replace('_', ' ')}, at most {most}"
    health = of.get("health")
    return beyond_limits(health) if isinstance(health, Mapping) else None


def members(d: Design) -> dict[str, Member]:
    """Every member of `wrcd_design`; `health` is a `wrcd_health_table`, or None."""

    def over(table: FloatArray, speeds_m_s: FloatArray = d.speeds_m_s) -> OverSpeed:
        return OverSpeed(np.ascontiguousarray(speeds_m_s), np.ascontiguousarray(table.reshape(len(table), -1)))

    lengths = Lengths(d)
    interval, wheelbase = d.interval, d.wheelbase_m / d.tick_s
    return {
        "tick_s": d.tick_s,
        "is_paper": int(d.form == "paper"),
        "states": d.states,
        "window_ticks": d.window_ticks,
        "usual": lengths.usual,
        "longest": lengths.longest,
        "recent": lengths.recent,
        "now": lengths.now,
        "step": lengths.step,
        "min_ticks": lengths.min_ticks,
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
        "consequents": Fuzzy(d).consequents,
        "low": d.low,
        "high": d.high,
        "polynomial": d.polynomial,
        "adhesion_low_pct": d.adhesion_range_pct[0],
        "adhesion_high_pct": d.adhesion_range_pct[1],
        "saturated_share": d.saturated_share,
        "beyond": d.beyond,
        "changes": over(d.changes, d.change_speeds_m_s),
        "widening": None if interval is None else over(interval.factors.T, np.log(interval.speeds_m_s)),
        "health": _health(d),
        "bands": band_filters(d.tick_s),
        "wheelbase_m": d.wheelbase_m,
        "longest_wheelbase_ticks": round(wheelbase / SLOWEST_M_S),
    }


def _health(d: Design) -> dict[str, Member] | None:
    h = d.health
    if h is None:
        return None
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
