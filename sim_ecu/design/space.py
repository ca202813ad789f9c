"""What a search may move of a brief, by groups, and the way from a brief to the vector of a search and back.

A number of the vector is a distance on a scale on which a step means about as much for every parameter: decades of a
process noise, of a weight over what is left of it; for the rest, decades over the parameter's `unit`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sim_ecu.design.brief import moved
from sim_ecu.design.cases import FloatArray
from sim_ecu.design.make import Brief
from wrcd.errors import InputError
from wrcd.estimator.design import MODELS

# Groups in the order of the vector. Those of BY_RECORDINGS move the error on recorded conditions; what the others are
# worth (a longer window: less error, a later answer) shows on whole runs only.
BY_RECORDINGS = ("noise", "weights", "points", "band")
BY_RUNS = ("window", "rules")
GROUPS = (*BY_RECORDINGS, *BY_RUNS)
NOISES, WEIGHTS = (-6.0, 2.0), (-3.0, 3.0)  # log10 of a process noise, of one channel's weight over the other's
CREEPS, BANDS_HZ = (0.002, 4.0), (6.0, 30.0)
WINDOWS_S, LONGEST_S, RECENT_S, RULES = (0.4, 2.0), (0.4, 3.0), (0.06, 0.5), (20, 200)
DIGITS = 3  # of what is found: as a person writes it


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a brief that is searched. get: what is moved, as its log10; put: a brief with another one.

    low, high: of the log10. unit: decades that count as one in a vector.
    """

    name: str
    low: float
    high: float
    unit: float
    get: Callable[[Brief], float]
    put: Callable[[Brief, float], Brief]


def parameters(brief: Brief, groups: Sequence[str]) -> tuple[Parameter, ...]:
    """Of the groups, in the order of GROUPS. Raises InputError for a group that the brief's form does not have."""
    makers = {"noise": _noise, "weights": _weights, "points": _points, "band": _band, "window": _window,
              "rules": _rules}  # fmt: skip
    for group in groups:
        if group not in GROUPS:
            raise InputError(f"there is no {group!r} to search", key="--over", hint=f"known: {', '.join(GROUPS)}")
        if brief.form == "paper" and group in ("weights", "band"):
            raise InputError(f"the paper's form has no {group}", key="--over", hint="leave it out")
    return tuple(p for group in GROUPS if group in groups for p in makers[group](brief))


def groups_of(form: str) -> tuple[str, ...]:
    """Groups that a form can be searched over."""
    return tuple(g for g in GROUPS if form != "paper" or g not in ("weights", "band"))


def vector(brief: Brief, over: Sequence[Parameter]) -> FloatArray:
    """Where a brief lies (n,)."""
    return np.array([p.get(brief) / p.unit for p in over])


def brief_at(brief: Brief, over: Sequence[Parameter], x: FloatArray) -> Brief:
    """The brief with what a vector (n,) says, within the parameters' bounds, and its windows one within the other."""
    for p, value in zip(over, x.tolist(), strict=True):
        brief = p.put(brief, min(max(value * p.unit, p.low), p.high))
    longest = brief.window_s if brief.form == "paper" else max(brief.longest_s, brief.window_s)
    return replace(brief, longest_s=longest, recent_s=min(brief.recent_s, 0.5 * brief.window_s))


def short(value: float) -> float:
    """Rounded as a person writes it."""
    return float(f"{value:.{DIGITS}g}")


def _of_points(brief: Brief, m: int, **what: object) -> Brief:
    points = list(brief.points)
    points[m] = replace(points[m], **what)  # type: ignore[arg-type]  # the keys are those of a Point
    return replace(brief, points=tuple(points))


def _noise(brief: Brief) -> list[Parameter]:
    def get(m: int, k: int, b: Brief) -> float:
        return float(np.log10(b.points[m].noise[k]))

    def put(m: int, k: int, b: Brief, log10: float) -> Brief:
        noise = [*b.points[m].noise]
        noise[k] = short(10.0**log10)
        return _of_points(b, m, noise=tuple(noise))

    names = ("y_t'", "yaw", "lateral")
    return [
        Parameter(f"noise of {n}, model {m + 1}", *NOISES, 1.0, partial(get, m, k), partial(put, m, k))
        for m in range(MODELS)
        for k, n in enumerate(names)
    ]


def _weights(brief: Brief) -> list[Parameter]:
    def get(m: int, b: Brief) -> float:
        weight = b.points[m].yaw_rate_weight
        return float(np.log10(weight / (2.0 - weight)))

    def put(m: int, b: Brief, log10: float) -> Brief:
        return _of_points(b, m, yaw_rate_weight=float(f"{2.0 / (1.0 + 10.0**-log10):.4g}"))

    return [
        Parameter(f"weight of the yaw rate, model {m + 1}", *WEIGHTS, 1.0, partial(get, m), partial(put, m))
        for m in range(MODELS)
    ]


def _points(brief: Brief) -> list[Parameter]:
    def get(m: int, b: Brief) -> float:
        return float(np.log10(b.points[m].creep_of_peak))

    def put(m: int, b: Brief, log10: float) -> Brief:
        points = list(b.points)
        points[m] = moved(points[m], points[m].curve, short(10.0**log10))
        return replace(b, points=tuple(points))

    low, high = np.log10(CREEPS).tolist()
    return [
        Parameter(f"creep over the peak's, model {m + 1}", low, high, 0.5, partial(get, m), partial(put, m))
        for m in range(MODELS)
    ]


def _field(words: str, name: str, bounds: tuple[float, float], unit: float, whole: bool = False) -> Parameter:
    def get(b: Brief) -> float:
        return float(np.log10(getattr(b, name)))

    def put(b: Brief, log10: float) -> Brief:
        value = 10.0**log10
        return replace(b, **{name: round(value) if whole else short(value)})  # type: ignore[arg-type]  # numbers all

    low, high = np.log10(bounds).tolist()
    return Parameter(words, low, high, unit, get, put)


def _band(_: Brief) -> list[Parameter]:
    return [_field("upper end of the band, Hz", "band_hz", BANDS_HZ, 0.3)]


def _window(brief: Brief) -> list[Parameter]:
    usual = _field("window, s", "window_s", WINDOWS_S, 0.3)
    if brief.form == "paper":
        return [usual]
    return [
        usual,
        _field("longest window, s", "longest_s", LONGEST_S, 0.3),
        _field("newest part, s", "recent_s", RECENT_S, 0.3),
    ]


def _rules(_: Brief) -> list[Parameter]:
    return [_field("rules", "max_rules", RULES, 0.5, whole=True)]
