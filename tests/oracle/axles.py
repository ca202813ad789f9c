"""The oracle of wrcd/core/c/axles.c: words of axles on one rail, fused by numpy."""

from dataclasses import dataclass

import numpy as np

from wrcd.core.design import BoolArray, FloatArray

LATE_S, LEAST_SPREAD, DISAGREE, WORSE, SIGMAS = 0.3, 0.03, 2.5, 1.0, 1.645


@dataclass(frozen=True, slots=True)
class Alone:
    """What n axles say alone. place_m: forward in the direction of travel; since_m: the way since a word began; speaks:
    whether it is Valid."""

    mu_pct: FloatArray
    half_width_pp: FloatArray
    used_pct: FloatArray
    reaches_pct: FloatArray
    saturated: BoolArray
    speaks: BoolArray
    place_m: FloatArray
    since_m: FloatArray
    speed_m_s: float


@dataclass(frozen=True, slots=True)
class Fused:
    """The same axles together. axles: how many stand behind each; most_used: the place of the axle that uses most."""

    mu_pct: FloatArray
    half_width_pp: FloatArray
    axles: FloatArray
    most_used: FloatArray


def fused(a: Alone) -> Fused:
    """Fuse the words. What does not speak stays as it is."""
    n, late_m = len(a.mu_pct), LATE_S * a.speed_m_s
    log, spread = np.log(a.mu_pct), np.maximum(a.half_width_pp / a.mu_pct, LEAST_SPREAD)
    began_m = a.place_m - a.since_m
    out = Fused(a.mu_pct.copy(), a.half_width_pp.copy(), np.ones(n), np.arange(n, dtype=np.float64))
    for axle in np.flatnonzero(a.speaks).tolist():
        own = np.arange(n) == axle
        here = own if a.saturated[axle] else np.array(
            [a.speaks[k] and (k == axle or not _breaks(a, began_m, axle, k, late_m)) for k in range(n)]
        )  # fmt: skip
        ahead = here & (a.place_m > a.place_m[axle])
        newer = ahead & (began_m > began_m[axle]) & (began_m <= a.place_m[axle] + late_m)
        by = own
        if newer.any():
            x, s = _mean(log, spread, newer.astype(float))
            if SIGMAS * (log[axle] - x) / np.hypot(spread[axle], s) > WORSE:
                by = newer
        x, s = _mean(log, spread, by.astype(float))
        apart = SIGMAS * np.abs(log - x) / np.hypot(spread, s)
        counts = np.maximum(by, here * np.clip(DISAGREE - apart, 0.0, 1.0))
        of = counts > 0.0
        others = of & ahead
        who = np.append(axle, np.flatnonzero(others))
        out.axles[axle], out.most_used[axle] = of.sum(), who[np.argmax(a.used_pct[who])]
        if by is own and of.sum() == 1:
            continue
        x, s = _mean(log, spread, counts)
        word, bound = np.exp(x), a.used_pct[axle]
        if by is own:
            bound = a.used_pct[who].max()
        mu = min(max(word, bound), 100.0)
        low = min(word, a.reaches_pct[axle]) if by is own else word
        out.mu_pct[axle], out.half_width_pp[axle] = mu, max(s * mu, mu - low)
    return out


def _breaks(a: Alone, began_m: FloatArray, one: int, other: int, late_m: float) -> bool:
    """Whether a memory began between two axles, or the one ahead or one between them cleans the rail."""
    low, high = sorted((a.place_m[one], a.place_m[other]))
    began, cleaning = began_m[a.speaks], a.place_m[a.speaks & a.saturated]
    begins = (began > low + late_m) & (began <= high)
    return bool(begins.any() or ((cleaning > low) & (cleaning <= high)).any())


def _mean(log: FloatArray, spread: FloatArray, counts: FloatArray) -> tuple[float, float]:
    weights = np.where(counts > 0.0, counts * spread**-2.0, 0.0)
    of = weights > 0.0
    return float(np.average(log[of], weights=weights[of])), float(np.average(spread[of], weights=weights[of]))
