"""Two sides of a report in figures, axle by axle."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wrcd.core.causes import Validity
from wrcd.tools.story.accuracy import accuracy
from wrcd.tools.story.compare import AxleComparison, compare
from wrcd.tools.story.events import VALID_PLACE
from wrcd.tools.story.records import Adhesion, Axle, Numbers, Story
from wrcd.tools.story.words import at


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
    ours, theirs = ({a.number: a for a in s.axles} for s in (story, against))
    both = compare(story, against).axles
    return [d for c in both for d in _axle(story, ours[c.number], theirs[c.number], c)]


def _axle(story: Story, a: Axle, b: Axle, c: AxleComparison) -> Iterator[Difference]:
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
        yield Difference(n, "mean absolute error against the truth", "pp", _error(a), _error(b), 2)
    yield Difference(n, "SampleAge, 99 % of frames below", "ms", _age(a.adhesion), _age(b.adhesion), 0)
    nothing = float("nan")
    yield Difference(
        n, "available, mean distance of the two where both are Valid", "pp", nothing, c.mean_absolute_pp, 2
    )
    where = f", at {at(story, c.worst_at_us)}" if c.both_valid else ""
    yield Difference(n, f"available, largest distance{where}", "pp", nothing, abs(c.worst_pp), 2)


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
    found: Numbers = a.available_pct[(a.validity == VALID_PLACE) & np.isfinite(a.available_pct)]
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
    found = accuracy(axle)
    return float("nan") if found is None else found.mean_absolute_pp
