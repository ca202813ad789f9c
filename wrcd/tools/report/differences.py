"""Two sides of a report in figures, axle by axle."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wrcd.core.causes import Validity
from wrcd.tools.story.records import Adhesion, Axle, Numbers, Story, Times

SAME_US = 50_000  # frames of two logs are compared where they are no further apart
PLACE = 1  # of Valid in the vocabulary


@dataclass(frozen=True, slots=True)
class Difference:
    """A line of the table. NaN: there is none."""

    axle: int
    what: str
    unit: str
    here: float
    there: float
    digits: int = 1


def differences(story: Story, against: Story) -> list[Difference]:
    """Of axles that both have."""
    others = {a.number: a for a in against.axles}
    return [d for a in story.axles if a.number in others for d in _axle(story, a, against, others[a.number])]


def _axle(story: Story, a: Axle, against: Story, b: Axle) -> Iterator[Difference]:
    n = a.number
    yield Difference(n, "frames", "", len(a.adhesion.time_us), len(b.adhesion.time_us), 0)
    for v in (Validity.VALID, Validity.DEGRADED, Validity.NOT_AVAILABLE):
        yield Difference(n, v.value, "% of the time", _share(a, v), _share(b, v))
    yield Difference(n, "changes of Validity or cause", "", max(len(a.events) - 1, 0), max(len(b.events) - 1, 0), 0)
    yield Difference(n, "longest not Valid", "s", _longest(a), _longest(b), 2)
    yield Difference(n, "available, median where Valid", "%", _median(a.adhesion), _median(b.adhesion), 2)
    yield Difference(n, "available, lowest where Valid", "%", _lowest(a.adhesion), _lowest(b.adhesion), 2)
    yield Difference(n, "half-width of the interval, median", "pp", _half(a.adhesion), _half(b.adhesion), 1)
    if a.truth is not None or b.truth is not None:
        yield Difference(n, "mean error against the truth", "pp", _error(a), _error(b), 2)
    yield Difference(n, "SampleAge, 99 % of frames below", "ms", _age(a.adhesion), _age(b.adhesion), 0)
    mean, most, at_s = _apart(story, a.adhesion, against, b.adhesion)
    yield Difference(n, "available, mean distance of the two where both are Valid", "pp", float("nan"), mean, 2)
    yield Difference(n, f"available, largest distance, at {at_s:.2f} s", "pp", float("nan"), most, 2)


def _share(axle: Axle, validity: Validity) -> float:
    total = sum(e.duration_s for e in axle.events)
    return 100.0 * sum(e.duration_s for e in axle.events if e.validity is validity) / total if total else float("nan")


def _longest(axle: Axle) -> float:
    longest = run = 0.0
    for e in axle.events:
        run = 0.0 if e.validity is Validity.VALID else run + e.duration_s
        longest = max(longest, run)
    return longest


def _valid(a: Adhesion) -> Numbers:
    found: Numbers = a.available_pct[(a.validity == PLACE) & np.isfinite(a.available_pct)]
    return found


def _median(a: Adhesion) -> float:
    valid = _valid(a)
    return float(np.median(valid)) if len(valid) else float("nan")


def _lowest(a: Adhesion) -> float:
    valid = _valid(a)
    return float(valid.min()) if len(valid) else float("nan")


def _half(a: Adhesion) -> float:
    half = a.high_pct - a.available_pct
    half = half[np.isfinite(half)]
    return float(np.median(half)) if len(half) else float("nan")


def _age(a: Adhesion) -> float:
    ages = a.age_ms[np.isfinite(a.age_ms)]
    return float(np.quantile(ages, 0.99)) if len(ages) else float("nan")


def _error(axle: Axle) -> float:
    """Mean distance of Valid frames from the truth of that moment."""
    if axle.truth is None or not len(axle.truth.time_us):
        return float("nan")
    a = axle.adhesion
    place, near = _nearest(axle.truth.time_us, a.time_us)
    ok = near & (a.validity == PLACE)
    error = np.abs(a.available_pct[ok] - axle.truth.available_pct[place[ok]])
    error = error[np.isfinite(error)]
    return float(error.mean()) if len(error) else float("nan")


def _nearest(times_us: Times, at_us: Times) -> tuple[Times, np.ndarray[tuple[int], np.dtype[np.bool_]]]:
    """Rows nearest to times, and whether they are near."""
    right = np.clip(np.searchsorted(times_us, at_us), 0, len(times_us) - 1)
    left = np.maximum(right - 1, 0)
    place = np.where(at_us - times_us[left] < times_us[right] - at_us, left, right)
    return place, np.abs(times_us[place] - at_us) <= SAME_US


def _apart(story: Story, a: Adhesion, against: Story, b: Adhesion) -> tuple[float, float, float]:
    """Mean and largest distance of two estimates at the same time since the beginning, and where it is largest."""
    nothing = (float("nan"), float("nan"), float("nan"))
    if not len(a.time_us) or not len(b.time_us):
        return nothing
    place, near = _nearest(b.time_us - against.begin_us, a.time_us - story.begin_us)
    both = near & (a.validity == PLACE) & (b.validity[place] == PLACE)
    apart = np.where(both, np.abs(a.available_pct - b.available_pct[place]), np.nan)
    if not np.isfinite(apart).any():
        return nothing
    worst = int(np.nanargmax(apart))
    return float(np.nanmean(apart)), float(apart[worst]), (int(a.time_us[worst]) - story.begin_us) / 1e6
