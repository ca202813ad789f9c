"""What a log comes to, in sentences: the most important first."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from wrcd.core.causes import Cause, Validity
from wrcd.logs.daemon import daemon_findings
from wrcd.logs.story_events import UNBOUNDED_PP
from wrcd.logs.story_records import (
    Event,
    Fall,
    Finding,
    Story,
    StoryAxle,
    at,
    causes,
    lasting,
    percent,
    seconds,
    total_s,
)
from wrcd.logs.truth import accuracy

LEVELS = ("bad", "warning", "note", "good")
GOOD_HELD = 0.85  # of frames, whose interval of nine in ten holds the truth
MAX_FALLS = 8  # that are reported of an axle; the story has them all
MAX_OUTAGES, MIN_OUTAGE_S = 3, 0.5  # that are reported of an axle
MAX_WARM_UPS, MIN_SHARE = 2.0, 0.5  # windows that a start may take in a short log, and what it must leave
GOOD_SHARE = 0.9  # Valid: less is a warning


def judged(story: Story) -> Story:
    """The same story with its verdict. Within a level: of all axles first, then by axle and time."""
    findings = [*_axles(story), *_gaps(story), *daemon_findings(story)]
    if not story.axles:
        findings.append(Finding("bad", "No axle has a frame of wrcd: nothing was estimated."))
    order = sorted(findings, key=lambda f: LEVELS.index(f.level))
    return replace(story, verdict=tuple(order))


def _axles(story: Story) -> Iterator[Finding]:
    never = [a for a in story.axles if not a.spells.lasted_s(Validity.VALID)]
    if never and len(never) == len(story.axles):
        if story.end_us == story.begin_us:
            yield Finding("bad", "All frames of the log are of one moment: there is nothing to tell of.")
            return
        span = seconds((story.end_us - story.begin_us - story.gaps.total_us) * 1e-6)
        whose = "The axle" if len(never) == 1 else "No axle"
        was = "was never" if len(never) == 1 else "was ever"
        yield Finding("bad", f"{whose} {was} Valid in {span} of log: not one value was to be used.")
    for axle in story.axles:
        if not axle.spells.lasted_s(Validity.VALID) and axle.events:
            yield _never_valid(story, axle)
    for axle in story.axles:
        yield from _falls(story, axle)
        if axle.spells.lasted_s(Validity.VALID):
            yield _share(story, axle)
        yield from _outages(story, axle)
        yield from _contradictions(story, axle)
        yield from _truth(story, axle)


def _gaps(story: Story) -> Iterator[Finding]:
    """Where the log has no frame at all."""
    begin_us, end_us = story.gaps.begin_us.tolist(), story.gaps.end_us.tolist()
    if not begin_us:
        return
    k = max(range(len(begin_us)), key=lambda k: end_us[k] - begin_us[k])
    longest = seconds((end_us[k] - begin_us[k]) * 1e-6)
    times = "a gap" if len(begin_us) == 1 else f"{len(begin_us)} gaps, {seconds(story.gaps.total_us * 1e-6)} in all"
    which = f"{'the longest ' * (len(begin_us) > 1)}from {at(story, begin_us[k])} on"
    yield Finding(
        "note", f"The log has {times}, {which} ({longest}): no frame at all, and no part of any share.",
        0, begin_us[k], end_us[k],
    )  # fmt: skip


def _never_valid(story: Story, axle: StoryAxle) -> Finding:
    """The cause that lasted longest says why."""
    lasted: dict[tuple[Cause, str], float] = {}
    known = axle.spells.events
    for e in known:
        key = e.cause, "" if e.cause else e.detail
        lasted[key] = lasted.get(key, 0.0) + e.duration_s
    main = max(lasted, key=lambda key: lasted[key])
    first = next(e for e in known if (e.cause, "" if e.cause else e.detail) == main)
    label = f"{first.cause.label}, " if first.cause else ""
    return Finding(
        "bad",
        f"Axle {axle.number} was never Valid: {first.because} ({label}from {at(story, first.begin_us)} on, "
        f"{seconds(lasted[main])} in all); all causes: {causes(known)}.",
        axle.number, first.begin_us, story.end_us,
    )  # fmt: skip


def _falls(story: Story, axle: StoryAxle) -> Iterator[Finding]:
    own = [f for f in story.falls if f.axle == axle.number]
    for fall, following in list(zip(own, [*own[1:], None][: len(own)], strict=True))[:MAX_FALLS]:
        yield _fall(story, axle, fall, story.end_us if following is None else following.begin_us)
    if len(own) > MAX_FALLS:
        yield Finding(
            "note", f"Axle {axle.number}: {len(own) - MAX_FALLS} more falls and rises of MuAvailable.", axle.number
        )


def _fall(story: Story, axle: StoryAxle, fall: Fall, until_us: int) -> Finding:
    a = axle.adhesion
    rows = slice(*np.searchsorted(a.time_us, (fall.end_us, until_us)))
    half = a.high_pct[rows] - a.available_pct[rows]
    bound = f"interval ±{np.nanmedian(half):.2g} pp" if np.isfinite(half).any() else "no interval stated"
    rest = [
        (validity, lasting(axle.events, validity, fall.begin_us, until_us))
        for validity in (Validity.DEGRADED, Validity.NOT_AVAILABLE)
    ]
    but = " and ".join(f"{seconds(total_s(e))} of {v.value} ({causes(e)})" for v, e in rest if e)
    end = "to the end of the log" if until_us == story.end_us else ""
    lasted = f"for {seconds((until_us - fall.end_us) * 1e-6)}{f', {end}' if end else ''}"
    return Finding(
        "warning" if fall.is_down else "note",
        f"Axle {axle.number}: available adhesion {fall.verb} from {percent(fall.before_pct)} to "
        f"{percent(fall.after_pct)} % at {at(story, fall.begin_us)}, within "
        f"{seconds((fall.end_us - fall.begin_us) * 1e-6)}, {lasted}; {bound}; Valid throughout"
        + (f" but for {but}." if but else "."),
        axle.number, fall.begin_us, until_us,
    )  # fmt: skip


def _outages(story: Story, axle: StoryAxle) -> Iterator[Finding]:
    """The longest times between two Valid ones, but those that a fall tells of."""
    own = [f for f in story.falls if f.axle == axle.number]
    runs = [
        run
        for run in axle.not_valid_runs()[1 if _begins_not_valid(axle) else 0 :]
        if total_s(run) >= MIN_OUTAGE_S
        and not any(f.begin_us <= run[-1].end_us and f.end_us >= run[0].begin_us for f in own)
    ]
    if not axle.spells.lasted_s(Validity.VALID):
        return
    longest = sorted(runs, key=lambda run: -total_s(run))[:MAX_OUTAGES]
    for run in sorted(longest, key=lambda run: run[0].begin_us):
        begin, end = at(story, run[0].begin_us).removesuffix(" s"), at(story, run[-1].end_us)
        yield Finding(
            "warning",
            f"Axle {axle.number} was not Valid from {begin} to {end} ({seconds(total_s(run))}): {_began(run).because} "
            f"({causes(run)}).",
            axle.number, run[0].begin_us, run[-1].end_us,
        )  # fmt: skip
    if len(runs) > MAX_OUTAGES:
        more = len(runs) - MAX_OUTAGES
        yield Finding(
            "note", f"Axle {axle.number}: {more} more times of {MIN_OUTAGE_S:g} s or longer not Valid.", axle.number
        )


def _began(run: list[Event]) -> Event:
    """What a time not Valid is from: the longest cause before the window began to fill again."""
    before = list(itertools.takewhile(lambda e: e.cause is not Cause.WARMING_UP, run))
    return max(before or run, key=lambda e: e.duration_s)


def _begins_not_valid(axle: StoryAxle) -> bool:
    return bool(axle.events) and axle.events[0].validity is not Validity.VALID


def _share(story: Story, axle: StoryAxle) -> Finding:
    share = axle.spells.share(Validity.VALID)
    parts = []
    for validity in (Validity.DEGRADED, Validity.NOT_AVAILABLE):
        lasted = [e for e in axle.spells.events if e.validity is validity]
        if lasted:
            parts.append(f"{validity.value} {seconds(total_s(lasted))} ({causes(lasted)})")
    odd = [e for e in axle.spells.events if e.validity is not Validity.VALID and e.cause is not Cause.WARMING_UP]
    warm_up_s = total_s(e for e in axle.events if e.cause is Cause.WARMING_UP)
    short = warm_up_s <= MAX_WARM_UPS * story.config.design.window_s and share >= MIN_SHARE
    good = share >= GOOD_SHARE or (short and not odd)
    level = "good" if good and not odd else "note" if good or not odd else "warning"
    return Finding(
        level,
        f"Axle {axle.number} was Valid for {100 * share:.1f} % of {seconds(axle.spells.known_s)}"
        + (f"; {'; '.join(parts)}." if parts else "."),
        axle.number,
    )


def _contradictions(story: Story, axle: StoryAxle) -> Iterator[Finding]:
    """More in use than the estimate allows: Detail's cause says it to the event."""
    events = [e for e in axle.events if e.cause in (Cause.CONTRADICTION, Cause.TORQUES_CONTRADICT)]
    for cause in dict.fromkeys(e.cause for e in events):
        of = [e for e in events if e.cause is cause]
        yield Finding(
            "warning",
            f"Axle {axle.number}: {cause.words}: {len(of)} time{'s' * (len(of) > 1)}, {seconds(total_s(of))} in all, "
            f"first at {at(story, of[0].begin_us)} ({of[0].name}).",
            axle.number, of[0].begin_us, of[-1].end_us,
        )  # fmt: skip


def _truth(story: Story, axle: StoryAxle) -> Iterator[Finding]:
    if axle.truth is None:
        return
    found = accuracy(axle)
    if found is None:
        yield Finding(
            "note", f"Axle {axle.number}: the truth is known, but no Valid frame to compare it with.", axle.number
        )
        return
    held = (
        f"the interval held the truth in {100 * found.held_share:.1f} % of {found.bounded} frames"
        if found.bounded
        else "no frame stated an interval"
    )
    good = found.bounded and not found.lie_s and found.held_share >= GOOD_HELD
    bare = not found.bounded and found.mean_error_pp > UNBOUNDED_PP
    yield Finding(
        "good" if good else "warning" if bare else "note",
        f"Axle {axle.number} against the truth, while Valid: mean error {found.mean_error_pp:+.1f} pp, mean absolute "
        f"error {found.mean_absolute_pp:.1f} pp; {held}.",
        axle.number,
    )
    if found.worst_pp > 0 and (found.lie_s or bare):
        lay = f"; the whole interval lay above the truth for {seconds(found.lie_s)} in all" if found.lie_s else ""
        yield Finding(
            "warning",
            f"Axle {axle.number}: worst Valid claim {percent(found.worst_said_pct)} % where "
            f"{percent(found.worst_truth_pct)} % was there, at {at(story, found.worst_at_us)}{lay}.",
            axle.number, found.worst_at_us,
        )  # fmt: skip
