"""What a comparison of two fronts shows, in words: the figures and what chance leaves of them."""

import math

from sim_ecu.loop.fronts.front_figures import FrontComparison, FrontRatio
from sim_ecu.reporting.values import Figure, number

UNTOLD = "not to be told from these runs"


def says(law: str, c: FrontComparison) -> str:
    """Return what a comparison shows, as a sentence, also where it is nothing."""
    energy = _says("distance", "energy", c.energy, "is so short", "m", ("less", "more"))
    way = _says("energy", "distance", c.distance, "has so little energy", "kJ", ("shorter", "longer"))
    return f"{law.capitalize()}: {energy}; {way}."


def _says(equal: str, what: str, r: FrontRatio, beyond: str, unit: str, words: tuple[str, str]) -> str:
    if math.isnan(r.mean.value):
        return f"no stop without wrcd {beyond} ({span(r.other)} {unit} without, {span(r.one)} {unit} with)"
    return f"at equal {equal} the {what} with wrcd is {number(r.mean)} of the bare front's: {verdict(r.mean, words)}"


def verdict(f: Figure, words: tuple[str, str]) -> str:
    """Return whether a ratio is below or above 1 by more than chance, in words for below and above."""
    if math.isnan(f.value) or math.isnan(f.low):
        return UNTOLD
    return words[0] if f.high < 1.0 else words[1] if f.low > 1.0 else "no difference shown"


def span(ends: tuple[float, float]) -> str:
    """Return a range in words."""
    low, high = (number(x, 1) for x in ends)
    return low if low == high else f"{low} to {high}"
