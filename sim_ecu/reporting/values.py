"""Values as they are shown: numbers, shares, durations and figures with their intervals."""

import math
from dataclasses import asdict, dataclass, is_dataclass
from typing import Any, TypeAlias

UNKNOWN = "–"
# the verdicts on a goal
MET, MET_CHANCE = "met", "met, within chance"
MISSED, CHANCE, TOO_FEW = "MISSED", "missed, within chance", "too few to judge"


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure, the ends of its 90 % interval (NaN: too few runs), and how much it is made of."""

    value: float
    low: float
    high: float
    runs: int
    count: int  # frames, or drops, or axles

    def below(self, other: "Figure") -> bool:
        """Return whether it lies below another one, and the intervals do not overlap."""
        return self.high < other.low


@dataclass(frozen=True, slots=True)
class Rounded:
    """A figure or a number that is shown with so many digits behind the point."""

    value: Figure | float
    digits: int


@dataclass(frozen=True, slots=True)
class Share:
    """A share (0 to 1), shown in percent."""

    value: Figure | float


Value: TypeAlias = str | int | float | Figure | Rounded | Share


def text(value: Value) -> str:
    """Return a value as a reader sees it: two digits unless it says otherwise, a dash where nothing is known."""
    match value:
        case str():
            return value
        case bool() | int():
            return str(value)
        case Share():
            return share(value.value)
        case Rounded():
            return number(value.value, value.digits)
        case _:
            return number(value)


def number(value: Figure | float, digits: int = 2) -> str:
    """Return a number, of a figure with its interval."""
    if isinstance(value, Figure):
        if not math.isnan(value.value) and not math.isnan(value.low):
            return f"{value.value:.{digits}f} ({value.low:.{digits}f}–{value.high:.{digits}f})"
        value = value.value
    return UNKNOWN if math.isnan(value) else f"{value:.{digits}f}"


def share(value: Figure | float) -> str:
    """Return a share in percent, of a figure with its interval."""
    if isinstance(value, Figure):
        value = Figure(100 * value.value, 100 * value.low, 100 * value.high, value.runs, value.count)
    else:
        value = 100 * value
    shown = number(value, 1)
    return shown if shown == UNKNOWN else f"{shown} %"


def plain(x: Any) -> Any:
    """Return what JSON can hold: figures and other records as tables, what is no finite number as null."""
    if is_dataclass(x) and not isinstance(x, type):
        return plain(asdict(x))
    if isinstance(x, dict):
        return {str(k): plain(v) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [plain(v) for v in x]
    if isinstance(x, float) and not math.isfinite(x):
        return None
    return x
