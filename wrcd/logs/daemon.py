"""What a story's frames say of the daemon, the link and the bus, as findings."""

from collections.abc import Iterator

import numpy as np

from wrcd.bus.dbc import find_message
from wrcd.bus.positions import message_key
from wrcd.bus.reasons import Reason
from wrcd.core.vocabulary import FITS, words_of
from wrcd.logs.statistics import added, restarts
from wrcd.logs.story_events import STALE_AFTER
from wrcd.logs.story_records import Finding, Series, Story, at, seconds

FULL = 15  # of a count in WrcdRejects: so many or more
HIGH_LOAD_PCT = 80.0
MAX_CLOCK_STEPS = 5  # that are reported one by one
STATUS_COUNTS = (
    ("Overruns", "frames left out because the loop came too late for their slot"),
    ("ReceiveDrops", "frames that the kernel dropped because the receive buffer was full"),
    ("Reopens", "the bus opened again after its device had gone"),
)
LINK_COUNTS = (
    ("ErrorFrames", "error frames that the controller reported"),
    ("BusOffs", "the controller went bus-off"),
    ("Unsent", "frames that could not be sent and were dropped"),
    ("TimeSteps", "steps of the clock"),
    ("LateFrames", "frames that came after their tick was closed"),
    ("Outliers", "measurements left out as outliers"),
    ("Restarts", "axles started anew"),
)
STATES = (
    ("status_message", "State", "daemon", ("Running",)), ("link_message", "LinkState", "link", ("Up",)),
    ("status_message", "DesignFit", "design's fit", FITS[:-1]),
)  # fmt: skip
NOTES = frozenset({"Outliers", "LateFrames"})


def daemon_findings(story: Story) -> Iterator[Finding]:
    """Of what the daemon and the bus had to bear."""
    yield from _clock(story)
    yield from _design(story)
    yield from _state(story)
    yield from _restarts(story)
    yield from _counts(story, story.status, "status_message", STATUS_COUNTS)
    yield from _counts(story, story.link, "link_message", LINK_COUNTS)
    yield from _rejects(story)
    yield from _gaps(story)
    yield from _protection(story)
    yield from _bus(story)


def _first(story: Story, level: str, text: str, first_us: int) -> Finding:
    """What was, and when first."""
    return Finding(level, f"{text}, first at {at(story, first_us)}.", 0, first_us)


def _clock(story: Story) -> Iterator[Finding]:
    for step in story.clock_steps[:MAX_CLOCK_STEPS]:
        yield Finding(
            "warning",
            f"The log's clock was set back by {seconds(step.back_us * 1e-6)} at {at(story, step.at_us)}: times here go "
            "on from there, estimates begin anew.",
            0, step.at_us,
        )  # fmt: skip
    if len(story.clock_steps) > MAX_CLOCK_STEPS:
        yield Finding("note", f"Its clock was set back {len(story.clock_steps) - MAX_CLOCK_STEPS} more times.")


def _restarts(story: Story) -> Iterator[Finding]:
    found = [
        int(t)
        for series, key in ((story.status, "status_message"), (story.link, "link_message"))
        if series is not None
        for t in series.time_us[restarts(series, key)]
    ]
    if found:
        yield _first(story, "warning", "The daemon was restarted: its counts began anew", min(found))


def increase(series: Series, name: str, key: str) -> tuple[int, int]:
    """By how much a wrapping count of a message grew over a log, and when it first did (0: never)."""
    steps = added(series, key).get(name)
    if steps is None or len(steps) < 2 or not np.isfinite(steps).all():
        return 0, 0
    grown = np.flatnonzero(steps)
    return int(steps.sum()), int(series.time_us[grown[0]]) if len(grown) else 0


def _design(story: Story) -> Iterator[Finding]:
    checksums = story.status.values.get("DesignChecksum") if story.status is not None else None
    if checksums is None or not np.isfinite(checksums).any():
        return
    ours = int(story.config.design.checksum[:4], 16)
    other = sorted({int(x) for x in checksums[np.isfinite(checksums)].tolist()} - {ours})
    if other:
        yield Finding(
            "warning",
            f"The daemon says that it ran the design {', '.join(f'{x:04x}' for x in other)}…, the configuration's is "
            f"{ours:04x}…: rules and models here may not be those that decided. Give the --config that it ran with.",
        )


def _state(story: Story) -> Iterator[Finding]:
    for key, name, what, good in STATES:
        series = story.link if key == "link_message" else story.status
        if series is None or (values := series.values.get(name)) is None:
            continue
        for place, word in enumerate(words_of(key, name)):
            rows = np.flatnonzero(values == place)
            if word not in good and len(rows):
                text, level = f"The {what} was {word} in {len(rows)} frames", "note" if word == "Stopping" else "bad"
                yield _first(story, level, text, int(series.time_us[rows[0]]))


def _counts(story: Story, series: Series | None, key: str, counts: tuple[tuple[str, str], ...]) -> Iterator[Finding]:
    if series is None:
        return
    for name, words in counts:
        grown, first_us = increase(series, name, key)
        if grown:
            yield _first(story, "note" if name in NOTES else "warning", f"{name}: {grown} ({words})", first_us)


def _rejects(story: Story) -> Iterator[Finding]:
    counts: dict[str, tuple[int, bool, int]] = {}  # by reason: how many, whether there may be more, when first
    for reason in (*(f"Rejected{r.label}" for r in Reason), "ForeignFrames"):
        values = story.rejects.values.get(reason) if story.rejects is not None else None
        if story.rejects is None or values is None or not np.nansum(values):
            continue
        first_us = int(story.rejects.time_us[np.flatnonzero(np.nan_to_num(values))[0]])
        counts[reason.removeprefix("Rejected")] = int(np.nansum(values)), bool((values >= FULL).any()), first_us
    foreign = counts.pop("ForeignFrames", None)
    if foreign is not None:
        count, more, first_us = foreign
        text = f"{count}{' or more' * more} frames came under wrcd's own ids: perhaps another wrcd"
        yield _first(story, "bad", text, first_us)
    if counts:
        parts = ", ".join(f"{count}{' or more' * more} {reason}" for reason, (count, more, _) in counts.items())
        first_us = min(first for _, _, first in counts.values())
        yield Finding("note", f"Input frames refused: {parts}; first at {at(story, first_us)}.", 0, first_us)


def _gaps(story: Story) -> Iterator[Finding]:
    cycles = {a.number: a.adhesion.cycle_us for a in story.config.axles}
    for axle in story.axles:
        silent_ms = STALE_AFTER * cycles[axle.number] / 1000  # what a receiver takes for a time-out
        steps_ms = np.diff(story.gaps.taken_out(axle.adhesion.time_us)) / 1000
        gaps = np.flatnonzero(steps_ms > silent_ms)
        if len(gaps):
            widest = int(gaps[steps_ms[gaps].argmax()])
            at_us = int(axle.adhesion.time_us[widest])
            yield Finding(
                "warning",
                f"Axle {axle.number}: {len(gaps)} gap{'s' * (len(gaps) > 1)} of more than {silent_ms:.0f} ms between "
                f"wrcd's own frames, the longest {seconds(steps_ms[widest] / 1000)} at {at(story, at_us)}: a receiver "
                "takes that for NotAvailable.",
                axle.number, at_us, at_us + int(1000 * steps_ms[widest]),
            )  # fmt: skip


def _protection(story: Story) -> Iterator[Finding]:
    wrong = [m for m in story.bus.messages if m.wrong_e2e > 0]
    for m in sorted(wrong, key=lambda m: -m.wrong_e2e)[:5]:
        yield Finding(
            "warning" if m.role == "output" else "note",
            f"{m.name}: {m.wrong_e2e} of {m.frames} frames have a length or an E2E CRC that does not fit.",
        )
    if len(wrong) > 5:
        yield Finding("note", f"{len(wrong) - 5} more messages have such frames; the bus statistics name them.")


def _bus(story: Story) -> Iterator[Finding]:
    timeouts: dict[int, float] = {}
    for i in story.config.inputs:
        key = message_key(find_message(story.config.database, i.source.message))
        timeouts[key] = min(i.timeout_us / 1000, timeouts.get(key, float("inf")))
    late = [m for m in story.bus.messages if m.role == "input" and m.longest_gap_ms > timeouts.get(m.key, float("inf"))]
    for m in sorted(late, key=lambda m: -m.longest_gap_ms)[:5]:
        yield Finding(
            "note",
            f"{m.name}: the longest gap, {seconds(m.longest_gap_ms / 1000)} at {at(story, m.longest_gap_at_us)}, is "
            f"past its time-out of {timeouts[m.key]:g} ms.",
            0, m.longest_gap_at_us,
        )  # fmt: skip
    if len(story.bus.error_frames):
        text = f"{len(story.bus.error_frames)} error frames on the bus"
        yield _first(story, "warning", text, int(story.bus.error_frames[0]))
    if len(story.bus.load_pct) and story.bus.load_pct.max() > HIGH_LOAD_PCT:
        most = int(story.bus.load_pct.argmax())
        at_us = int(story.bus.time_us[most])
        yield Finding(
            "warning",
            f"Bus load up to {story.bus.load_pct[most]:.0f} % at {at(story, at_us)}, at an assumed "
            f"{story.bus.bit_rate / 1000:g} kbit/s.",
            0, at_us,
        )  # fmt: skip
