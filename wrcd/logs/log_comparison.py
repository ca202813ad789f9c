"""Two stories beside each other: two logs, or one log with two designs or configurations."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.logs.story_events import VALID_PLACE
from wrcd.logs.story_records import Fall, Finding, Story, StoryAxle, Times, at, percent, seconds

MAX_APART_US = 10_000  # of slots, half of Adhesion's cycle
MAX_DELAY_US = 5_000_000  # between a fall in one and the same in the other
LEAST_PP = 0.05  # a mean difference below the last digit that is shown is none


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
    both_valid: int  # slots that both have, after their beginnings, and call Valid
    mean_pp: float  # difference of MuAvailable in them
    mean_absolute_pp: float
    worst_pp: float  # the largest, with its sign
    worst_at_us: int  # in the first
    valid_shares: tuple[float, float]  # of the time, 0 … 1, in the first and the other
    delays: tuple[Delay, ...]
    only_other: tuple[Fall, ...]  # falls that the first has not


def with_design(config: Config, file: Path) -> Config:
    """A configuration with another design. Raises InputError for a file that is none."""
    from wrcd.core.design import load_design

    return replace(config, design=load_design(file), design_file=file)


def compare(first: Story, other: Story) -> tuple[AxleComparison, ...]:
    """Compare the axles that both have slot by slot: those of one log at the same time, of two at the same time after
    their beginnings."""
    shift_us = 0 if first.log.resolve() == other.log.resolve() else first.begin_us - other.begin_us
    theirs = {a.number: a for a in other.axles}
    return tuple(_axle(first, other, a, theirs[a.number], shift_us) for a in first.axles if a.number in theirs)


def _axle(first: Story, other: Story, ours: StoryAxle, theirs: StoryAxle, shift_us: int) -> AxleComparison:
    a, b = ours.adhesion, theirs.adhesion
    rows, other_rows = _slots(a.time_us, b.time_us + shift_us)
    difference = b.available_pct[other_rows].astype(np.float64) - a.available_pct[rows].astype(np.float64)
    both = (a.validity[rows] == VALID_PLACE) & (b.validity[other_rows] == VALID_PLACE) & np.isfinite(difference)
    difference, time_us = difference[both], a.time_us[rows[both]]
    mean, mean_absolute, worst, at_us = float("nan"), float("nan"), float("nan"), 0
    if len(difference):
        mean, mean_absolute = float(difference.mean()), float(np.abs(difference).mean())
        place = int(np.abs(difference).argmax())
        worst, at_us = float(difference[place]), int(time_us[place])
    shares = ours.spells.share(Validity.VALID), theirs.spells.share(Validity.VALID)
    delays, only_other = _delays(first, other, ours.number, shift_us)
    return AxleComparison(ours.number, len(difference), mean, mean_absolute, worst, at_us, shares, delays, only_other)


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


def _delays(first: Story, other: Story, axle: int, shift_us: int) -> tuple[tuple[Delay, ...], tuple[Fall, ...]]:
    """Falls of the first with those of the other that go the same way nearest to them."""
    rest = [f for f in other.falls if f.axle == axle]
    out = []
    for fall in (f for f in first.falls if f.axle == axle):
        apart_us = {k: f.end_us + shift_us - fall.end_us for k, f in enumerate(rest) if f.is_down is fall.is_down}
        k = min(apart_us, key=lambda k: abs(apart_us[k]), default=None)
        if k is None or abs(apart_us[k]) > MAX_DELAY_US:
            out.append(Delay(fall, None, float("nan")))
        else:
            out.append(Delay(fall, rest.pop(k), apart_us[k] * 1e-6))
    return tuple(out), tuple(rest)


def sentences(first: Story, other: Story) -> Iterator[Finding]:
    """What differs, in sentences; a difference is the other's value less the first's."""
    ours, theirs = ([a.number for a in story.axles] for story in (first, other))
    for whose, numbers in (
        ("the first", [n for n in ours if n not in theirs]), ("the other", [n for n in theirs if n not in ours])
    ):  # fmt: skip
        if numbers:
            yield Finding("note", f"Only {whose} has axle{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}.")
    for a in compare(first, other):
        text = f"Axle {a.number}: Valid for {100 * a.valid_shares[0]:.1f} % here, {100 * a.valid_shares[1]:.1f} % there"
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
    return f"{f.verb} from {percent(f.before_pct)} to {percent(f.after_pct)} % at {at(story, f.begin_us)}"
