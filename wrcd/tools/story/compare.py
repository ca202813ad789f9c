"""Two stories beside each other: two logs, or one log with two designs or configurations."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.tools.story.events import VALID_PLACE, VALIDITIES
from wrcd.tools.story.records import Axle, Fall, Finding, Story, Times
from wrcd.tools.story.words import at, percent, seconds

MAX_APART_US = 10_000  # of slots, half of Adhesion's cycle
MAX_DELAY_US = 5_000_000  # between a fall in one and the same in the other
LEAST_PP = 0.05  # a mean difference below the last digit that is told is none


@dataclass(frozen=True, slots=True)
class Delay:
    """A fall of one story, and when the other has it; None: it has none there. Times are those of the levels after."""

    fall: Fall
    other: Fall | None
    delay_s: float  # of the other behind the first, NaN without it


@dataclass(frozen=True, slots=True)
class AxleComparison:
    """One axle in both stories: what the other has, less what the first has. NaN: there is nothing to compare."""

    number: int
    slots: int  # that both have, after their beginnings
    both_valid: int
    time_us: Times  # of the first, (both_valid,)
    difference_pp: NDArray[np.float64]  # of MuAvailable, (both_valid,)
    mean_pp: float
    mean_absolute_pp: float
    worst_pp: float  # the largest, with its sign
    worst_at_us: int  # in the first
    other_validity: int  # slots whose Validity differs
    shares: tuple[tuple[Validity, float, float], ...]  # of the time, 0 … 1, in the first and the other
    causes_s: tuple[tuple[Cause, float, float], ...]  # how long each lasted in the first and the other
    events: tuple[int, int]
    delays: tuple[Delay, ...]
    only_other: tuple[Fall, ...]  # falls that the first has not


@dataclass(frozen=True, slots=True)
class Comparison:
    """All axles that both have."""

    axles: tuple[AxleComparison, ...]
    only_first: tuple[int, ...]
    only_other: tuple[int, ...]
    same_log: bool


def with_design(config: Config, file: Path) -> Config:
    """A configuration with another design. Raises InputError for a file that is none."""
    from wrcd.estimator.design import load_design

    return replace(config, design=load_design(file), design_file=file)


def compare(first: Story, other: Story) -> Comparison:
    """Compare slot by slot: those of one log at the same time, of two at the same time after their beginnings."""
    same_log = first.log.resolve() == other.log.resolve()
    shift_us = 0 if same_log else first.begin_us - other.begin_us
    ours, theirs = {a.number: a for a in first.axles}, {a.number: a for a in other.axles}
    both = [n for n in ours if n in theirs]
    return Comparison(
        tuple(_axle(first, other, ours[n], theirs[n], shift_us) for n in both),
        tuple(n for n in ours if n not in theirs),
        tuple(n for n in theirs if n not in ours),
        same_log,
    )


def _axle(first: Story, other: Story, ours: Axle, theirs: Axle, shift_us: int) -> AxleComparison:
    a, b = ours.adhesion, theirs.adhesion
    rows, other_rows = _slots(a.time_us, b.time_us + shift_us)
    differ = a.validity[rows] != b.validity[other_rows]
    valid = (a.validity[rows] == VALID_PLACE) & (b.validity[other_rows] == VALID_PLACE)
    mine, its = a.available_pct[rows[valid]].astype(np.float64), b.available_pct[other_rows[valid]].astype(np.float64)
    known = np.isfinite(mine) & np.isfinite(its)
    difference, time_us = (its - mine)[known], a.time_us[rows[valid]][known]
    worst = int(np.abs(difference).argmax()) if len(difference) else 0
    delays, only_other = _delays(first, other, ours.number, shift_us)
    return AxleComparison(
        ours.number, len(rows), len(difference), time_us, difference,
        float(difference.mean()) if len(difference) else float("nan"),
        float(np.abs(difference).mean()) if len(difference) else float("nan"),
        float(difference[worst]) if len(difference) else float("nan"),
        int(time_us[worst]) if len(difference) else 0,
        int(differ.sum()),
        tuple((v, _share(ours, v), _share(theirs, v)) for v in VALIDITIES),
        tuple((c, _lasted(ours, c), _lasted(theirs, c)) for c in _causes(ours, theirs)),
        (len(ours.events), len(theirs.events)),
        delays, only_other,
    )  # fmt: skip


def _slots(a: Times, b: Times) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of both that are of one slot."""
    if not len(a) or not len(b):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    after = np.searchsorted(b, a).clip(0, len(b) - 1)
    before = (after - 1).clip(0)
    near = np.where(np.abs(b[before] - a) < np.abs(b[after] - a), before, after)
    rows = np.flatnonzero(np.abs(b[near] - a) <= MAX_APART_US)
    _, once = np.unique(near[rows], return_index=True)
    return rows[once].astype(np.int64), near[rows[once]].astype(np.int64)


def _share(axle: Axle, validity: Validity) -> float:
    total = sum(e.duration_s for e in axle.events)
    return sum(e.duration_s for e in axle.events if e.validity is validity) / total if total else float("nan")


def _lasted(axle: Axle, cause: Cause) -> float:
    return sum(e.duration_s for e in axle.events if e.cause is cause)


def _causes(*axles: Axle) -> list[Cause]:
    return sorted({e.cause for axle in axles for e in axle.events if e.cause})


def _delays(first: Story, other: Story, axle: int, shift_us: int) -> tuple[tuple[Delay, ...], tuple[Fall, ...]]:
    """Falls of the first with those of the other that go the same way nearest to them."""
    rest = [f for f in other.falls if f.axle == axle]
    out = []
    for fall in (f for f in first.falls if f.axle == axle):
        down = fall.after_pct < fall.before_pct
        found = [
            f
            for f in rest
            if (f.after_pct < f.before_pct) is down and abs(f.end_us + shift_us - fall.end_us) <= MAX_DELAY_US
        ]
        match = min(found, key=lambda f: abs(f.end_us + shift_us - fall.end_us), default=None)
        if match is None:
            out.append(Delay(fall, None, float("nan")))
        else:
            rest.remove(match)
            out.append(Delay(fall, match, (match.end_us + shift_us - fall.end_us) * 1e-6))
    return tuple(out), tuple(rest)


def sentences(first: Story, other: Story) -> tuple[Finding, ...]:
    """What differs, in sentences; a difference is the other's value less the first's."""
    return tuple(_sentences(first, other, compare(first, other)))


def _sentences(first: Story, other: Story, c: Comparison) -> Iterator[Finding]:
    for numbers, whose in ((c.only_first, first), (c.only_other, other)):
        if numbers:
            plural = "s" * (len(numbers) > 1)
            where = "the first" if whose is first else "the other"
            yield Finding("note", f"Only {where} has axle{plural} {', '.join(map(str, numbers))}.")
    for a in c.axles:
        shares = {v: (x, y) for v, x, y in a.shares}[Validity.VALID]
        text = f"Axle {a.number}: Valid for {100 * shares[0]:.1f} % here, {100 * shares[1]:.1f} % there"
        if a.both_valid and a.mean_absolute_pp >= LEAST_PP:
            text += (
                f"; in {a.both_valid} slots that both call Valid MuAvailable there is {a.mean_pp:+.1f} pp on average, "
                f"{a.mean_absolute_pp:.1f} pp apart, most {a.worst_pp:+.1f} pp at {at(first, a.worst_at_us)}"
            )
        elif a.both_valid:
            worst = f", but {a.worst_pp:+.1f} pp at {at(first, a.worst_at_us)}" if abs(a.worst_pp) >= LEAST_PP else ""
            text += f"; the same MuAvailable in {a.both_valid} slots that both call Valid{worst}"
        else:
            text += "; no slot that both call Valid"
        yield Finding("note", text + ".", a.number)
        for d in a.delays:
            if d.other is None:
                yield Finding("warning", f"Axle {a.number}: {_fall(first, d.fall)} here, not there.", a.number)
            elif abs(d.delay_s) >= 0.02:
                later = "later" if d.delay_s > 0 else "earlier"
                text = f"Axle {a.number}: {_fall(first, d.fall)} here; there {seconds(abs(d.delay_s))} {later}."
                yield Finding("note", text, a.number, d.fall.begin_us, d.fall.end_us)
        for fall in a.only_other:
            yield Finding("warning", f"Axle {a.number}: {_fall(other, fall)} there, not here.", a.number)


def _fall(story: Story, f: Fall) -> str:
    verb = "fell" if f.after_pct < f.before_pct else "rose"
    return f"{verb} from {percent(f.before_pct)} to {percent(f.after_pct)} % at {at(story, f.begin_us)}"
