"""What a search may move of a brief, by groups, and the way from a brief to the vector of a search and back.

A number of the vector is a distance on a scale on which a step means about as much for every parameter: decades of a
process noise, of a weight over what is left of it; for the rest, decades over the parameter's `unit`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim_ecu.design.brief import moved
from sim_ecu.design.cases import FloatArray
from sim_ecu.design.linear import Point
from sim_ecu.design.make import Brief
from wrcd.core.terms import MODELS
from wrcd.errors import InputError

# Groups in the order of the vector. What windows and the number of rules are worth (a longer window: less error, a
# later answer) recorded conditions do not show: a search leaves them.
GROUPS = ("noise", "weights", "points", "band")
NOISES, WEIGHTS = (-6.0, 2.0), (-3.0, 3.0)  # log10 of a process noise, of one channel's weight over the other's
CREEPS, BANDS_HZ = (0.002, 4.0), (6.0, 30.0)
DIGITS = 3  # of what is found: as a person writes it


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a brief that is searched. low, high: of its log10. unit: decades that count as one in a vector."""

    low: float
    high: float
    unit: float
    get: Callable[[Brief], float]
    put: Callable[[Brief, float], Brief]  # a brief with another one


def parameters(brief: Brief, groups: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the groups' parameters, in the order of GROUPS. Raises InputError for a group that the form lacks."""
    for group in groups:
        if group not in GROUPS:
            raise InputError(f"there is no {group!r} to search", key="--search", hint=f"known: {', '.join(GROUPS)}")
        if group not in groups_of(brief.form):
            raise InputError(f"the paper's form has no {group}", key="--search", hint="leave it out")
    return tuple(p for group in GROUPS if group in groups for p in _of_group(group))


def groups_of(form: str) -> tuple[str, ...]:
    """Groups that a form can be searched over."""
    return tuple(g for g in GROUPS if form != "paper" or g not in ("weights", "band"))


def vector(brief: Brief, over: Sequence[Parameter]) -> FloatArray:
    """Return a brief's values of these parameters (n,)."""
    return np.array([np.log10(p.get(brief)) / p.unit for p in over])


def brief_at(brief: Brief, over: Sequence[Parameter], x: FloatArray) -> Brief:
    """Return the brief with a vector's values (n,), within the parameters' bounds."""
    for p, value in zip(over, x.tolist(), strict=True):
        brief = p.put(brief, 10.0 ** min(max(value * p.unit, p.low), p.high))
    return brief


def short(value: float) -> float:
    """Rounded as a person writes it."""
    return float(f"{value:.{DIGITS}g}")


def _of_group(group: str) -> list[Parameter]:
    models = range(MODELS)
    match group:
        case "noise":  # of y_t', yaw and lateral acceleration
            return [_of_model(m, NOISES, 1.0, *_noise(k)) for m in models for k in range(3)]
        case "weights":
            return [_of_model(m, WEIGHTS, 1.0, _weight, _with_weight) for m in models]
        case "points":
            ends = np.log10(CREEPS).tolist()
            return [_of_model(m, ends, 0.5, lambda p: p.creep_of_peak, lambda p, x: moved(p, p.curve, short(x)))
                    for m in models]  # fmt: skip
        case _:
            low, high = np.log10(BANDS_HZ).tolist()
            return [Parameter(low, high, 0.3, lambda b: b.band_hz, lambda b, x: replace(b, band_hz=short(x)))]


def _of_model(
    m: int, ends: Sequence[float], unit: float, get: Callable[[Point], float], put: Callable[[Point, float], Point]
) -> Parameter:
    def with_other(b: Brief, value: float) -> Brief:
        return replace(b, points=(*b.points[:m], put(b.points[m], value), *b.points[m + 1 :]))

    return Parameter(ends[0], ends[1], unit, lambda b: get(b.points[m]), with_other)


def _noise(k: int) -> tuple[Callable[[Point], float], Callable[[Point, float], Point]]:
    def put(p: Point, value: float) -> Point:
        noise = [*p.noise]
        noise[k] = short(value)
        return replace(p, noise=(noise[0], noise[1], noise[2]))

    return lambda p: p.noise[k], put


def _weight(p: Point) -> float:
    return p.yaw_rate_weight / (2.0 - p.yaw_rate_weight)


def _with_weight(p: Point, value: float) -> Point:
    return replace(p, yaw_rate_weight=float(f"{2.0 / (1.0 + 1.0 / value):.4g}"))
