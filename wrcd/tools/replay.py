"""`wrcd replay`: a log through the very core that runs live. The same log gives the same bytes."""

import contextlib
import csv
import sys
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

from wrcd.bus.codec import message_key, position
from wrcd.bus.columns import MIN_ROWS, Columns, Stretch
from wrcd.bus.dbc import Message, find_message, find_signal
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, format_line, read_log, read_stretches
from wrcd.bus.log_order import TimeOrder, on_channel
from wrcd.bus.positions import Position
from wrcd.bus.signals import Output, OutputSignal
from wrcd.config import load_config
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.core.core import FORWARD_STEP_US, Core
from wrcd.core.counts import Counts
from wrcd.core.messages import Outgoing
from wrcd.errors import InputError, Status, create
from wrcd.estimator.design import Design
from wrcd.estimator.records import Estimate
from wrcd.recorder.resume import Saved, load, replay_events, state_file
from wrcd.tools.events import SCREEN, EventRows
from wrcd.tools.explain import sentence
from wrcd.tools.progress import Progress
from wrcd.tools.selection import WHOLE, Part, Selection, Survey, survey

# A log has no clock to tell a silence from a step of time by. A gap of up to so long between its lines, whoever's they
# are, is a silence, and its slots are made; a longer one is a step. What comes after it is the same either way.
MAX_SILENCE_US = 60_000_000
MAX_GAP_US = 500_000  # between frames of a stretch that is read by columns: far from any silence

Item = TypeVar("Item", Stretch | tuple[Frame, str], tuple[Frame, str])

COLUMNS = (
    "time_s", "axle", "validity", "mu_available_pct", "mu_used_pct", "contact_state", "surface", "confidence",
    "sample_age_ms", "cause",
)  # fmt: skip
REASONS = ("winning_model", "dominant_rule", "rule_share")  # with --explain
# the signals of the columns behind the axle; the last column, the cause of not being Valid, is in words
SIGNALS = ("Validity", "MuAvailable", "MuUsed", "ContactState", "Surface", "Confidence", "SampleAge")


def replay(
    log: Path,
    config_file: Path | None,
    output: Path | None,
    table: Path | None,
    explained: bool = False,
    changes: Path | None = None,
    *,
    selection: Selection = WHOLE,
) -> int:
    """Run a log and write what was asked for; a summary goes to standard error. explained: the CSV's rows say which
    model and which rule decided.

    Returns the exit status: STOPPED for a log that could not be read to its end, NOT_THERE where no frame is an input.
    Outputs of a log that turns out not to be readable at all are removed again.
    """
    for out in (output, table, changes):
        if out is not None and out.exists() and log.exists() and out.samefile(log):
            raise InputError("is the log itself; it would be lost", file=out, hint="give another file")
    if changes == SCREEN and explained and table is None:
        raise InputError("and the rows of --explain are both for the screen", key="--events", hint="name a file")
    config = load_config(config_file)
    selection.check(config)
    core = Core(config)
    saved = resume(core, log)
    # a pipe cannot be read twice; a state may tell of an axle whose frames lie before the log
    looked = survey(log, config, selection.channel) if log.is_file() or not log.exists() else Survey()
    found = looked if saved is None else replace(looked, without_frame=frozenset())
    part = Part(selection, found, config)
    before = Counts(core.counts.accepted, core.counts.rejected.copy(), ticks=core.counts.ticks)
    damage, order = Damage(), TimeOrder(log)
    sent = 0
    try:
        with contextlib.ExitStack() as files:
            frames_out = files.enter_context(create(output)) if output else None
            events = _events(files, changes, core, part)
            rows = _rows(files, table, (output is None and events is None) or explained, config, explained, part)
            if saved is None:
                items = order.put(on_channel(read_stretches(log, damage), selection.channel, log))
                made = outgoing_of_stretches(core, progress(part.read(items), log))
            else:
                made = outgoing(core, progress(on_channel(read_log(log, damage), selection.channel, log), log), saved)
            for o, channel in made:
                if part.wants(o):
                    sent += 1
                    if frames_out:
                        frames_out.write(format_line(o.frame, channel) + "\n")
                    if rows:
                        rows.write(o)
                if events:
                    events.look()
            if events:
                events.look()
    except InputError:
        for out in (output, table, changes):
            if out is not None and out.is_file():
                out.unlink()
        raise
    said = [*damage.warnings(log), *order.warnings()]
    if saved is not None and damage.read != saved.lines:
        said.append(
            f"{log}: has {damage.read} frames, {saved.lines} when it was recorded: from where they differ on, so may "
            "what is made of them"
        )
    accepted, rejected = core.counts.accepted - before.accepted, core.counts.rejected - before.rejected
    if accepted and found.without_frame:
        axles = ", ".join(map(str, sorted(found.without_frame)))
        said.append(f"{log}: has no frame of axle {axles}; no rows of it")
    for warning in said:
        print(f"wrcd: warning: {warning}", file=sys.stderr)
    if not accepted:
        print(
            f"wrcd: error: {log}: none of its {damage.read} frames is a usable input of this configuration",
            file=sys.stderr,
        )
    print(
        f"wrcd: {damage.read} frames read, {accepted} accepted, rejected: {Counts(rejected=rejected).rejections}; "
        f"{core.counts.ticks - before.ticks} ticks, {sent} frames made",
        file=sys.stderr,
    )
    return Status.NOT_THERE if not accepted else Status.DONE if damage.whole else Status.STOPPED


def resume(core: Core, log: Path) -> Saved | None:
    """Put the state that lies beside a recorder's log into a core, and say so. Raises InputError if it does not fit."""
    path = state_file(log)
    if not path.exists() or not log.exists():
        return None
    saved = load(path, core)
    print(f"wrcd: goes on from {path.name}", file=sys.stderr)
    return saved


def outgoing(core: Core, frames: Iterable[tuple[Frame, str]], saved: Saved | None) -> Iterator[tuple[Outgoing, str]]:
    """What the core makes of a log's frames, and the channel. What the loop did between them is done again; where the
    log does not come from a recorder and nothing tells of it, its lines are the clock."""
    events = deque(saved.events if saved is not None else ())
    lines, channel = 0, ""
    for lines, (frame, channel) in enumerate(frames):
        before = replay_events(core, events, lines) if saved is not None else silence(core, frame.stamp_us)
        for o in (*before, *core.feed(frame)):
            yield o, channel
    for o in replay_events(core, events, lines + 1):
        yield o, channel


def outgoing_of_stretches(core: Core, items: Iterable[Stretch | tuple[Frame, str]]) -> Iterator[tuple[Outgoing, str]]:
    """The same of a log that does not come from a recorder, by columns where it is regular."""
    columns = Columns(core.receiver, core.check_all)
    for item in items:
        if isinstance(item, tuple):
            yield from outgoing(core, (item,), None)
        elif not _goes_on(core, item):
            yield from outgoing(core, ((frame, item.channel) for frame in item.frames()), None)
        else:
            core.hold()
            for place, stamp_us, reader, samples, checked in columns.read(item):
                if checked and samples is not None:
                    made = core.feed_checked(samples, stamp_us)
                else:
                    made = core.feed_read(reader, samples or item.frame(place), stamp_us)
                for o in made:
                    yield o, item.channel
            for o in core.release():
                yield o, item.channel


def _goes_on(core: Core, s: Stretch) -> bool:
    """Whether a stretch is worth it, and no frame of it is a step of time or the end of a silence, for mapped frames
    and others alike."""
    if len(s) < MIN_ROWS:  # as between frames that are not plain
        return False
    mapped = np.flatnonzero(np.isin(s.keys, core.receiver.keys))
    if not len(mapped) or not core.goes_on_from(int(s.stamps_us[mapped[0]])):
        return False
    gaps = np.diff(s.stamps_us[mapped], append=s.stamps_us[-1])
    return bool((gaps >= 0).all() and (gaps < MAX_GAP_US).all() and (np.diff(s.stamps_us) >= 0).all())


def silence(core: Core, stamp_us: int) -> list[Outgoing]:
    """Take a core through the silence before a stamp, if it is one, as a clock does: by a second at once at most."""
    out: list[Outgoing] = []
    if core.time_us is not None and stamp_us - core.time_us <= MAX_SILENCE_US:
        while stamp_us - core.time_us > FORWARD_STEP_US:
            out += core.advance(core.time_us + FORWARD_STEP_US)
    return out


def progress(items: Iterator[Item], log: Path) -> Iterator[Item]:
    """The same frames, or stretches of them; on a terminal a line tells how far the log has come."""
    shown = Progress()
    first = None
    for number, item in enumerate(items):
        many = isinstance(item, Stretch)
        if many or number % 1000 == 0:
            stamp_us = int(item.stamps_us[-1]) if isinstance(item, Stretch) else item[0].stamp_us
            first = stamp_us if first is None else first
            shown.at(f"{log.name}: {(stamp_us - first) * 1e-6:.0f} s of log")
        yield item
    shown.end()


class Rows:
    """The CSV: what the Adhesion frames say, in the words of the DBC's value tables."""

    def __init__(self, file: IO[str], config: Config, explained: bool, part: Part) -> None:
        self._writer = csv.writer(file, lineterminator="\n")
        self._writer.writerow((*COLUMNS, *REASONS) if explained else COLUMNS)
        self._design = config.design if explained else None
        self._place = {a.number: place for place, a in enumerate(config.axles)}
        self._origin_us = part.origin_us
        self._messages: dict[int, tuple[Cells, int]] = {}  # by Frame.key
        for a in config.axles:
            if a.number in part.axles:
                message = find_message(config.database, a.adhesion.message)
                self._messages[message_key(message)] = Cells(message, a.adhesion), a.number

    def write(self, o: Outgoing) -> None:
        """One row for an Adhesion frame, nothing for others."""
        frame, why = o.frame, o.why
        found = self._messages.get(frame.key)
        if found is None:
            return
        cells, number = found
        stamp = _seconds(frame.stamp_us - self._origin_us)
        row = [stamp, number, *cells.of(frame.data), o.cause.words]
        if self._design is not None:
            warm = row[2] != Validity.NOT_AVAILABLE
            row += _reasons(self._design, why, self._place[number]) if why and warm else ["", "", ""]
        self._writer.writerow(row)


def _seconds(us: int) -> str:
    """Microseconds as seconds, exactly."""
    return f"{'-' * (us < 0)}{abs(us) // 1_000_000}.{abs(us) % 1_000_000:06d}"


class Cells:
    """The text of each signal of a message: what cantools makes of a raw value is looked up from the second time on.
    Words that the configuration gives are ours again."""

    def __init__(self, message: Message, output: Output) -> None:
        self._message = message
        self._known = [s for name in SIGNALS if (s := output.signals.get(name)) is not None]
        self._positions = [position(find_signal(message, s.name), message.length) for s in self._known]
        self._texts = [self._words(s, at) for s, at in zip(self._known, self._positions, strict=True)]
        self._columns = [column for column, name in enumerate(SIGNALS) if name in output.signals]

    @staticmethod
    def _words(sent: OutputSignal, at: Position) -> dict[int, str]:
        """What is known beforehand, by raw value as it lies in the frame."""
        words = {raw & at.mask: word for word, raw in (sent.words or {}).items()}
        return words if sent.not_available is None else {sent.not_available & at.mask: "", **words}

    def of(self, data: bytes) -> list[str]:
        """One text for each of SIGNALS, empty for those that the message lacks."""
        numbers = {"little": int.from_bytes(data, "little"), "big": int.from_bytes(data, "big")}
        out = [""] * len(SIGNALS)
        decoded: Any = None
        for signal, at, texts, column in zip(self._known, self._positions, self._texts, self._columns, strict=True):
            raw = numbers[at.order] >> at.shift & at.mask
            text = texts.get(raw)
            if text is None:
                decoded = decoded or self._message.decode(data)
                text = texts[raw] = _cell(decoded.get(signal.name), signal.factor, SIGNALS[column])
            out[column] = text
        return out


def _cell(value: Any, factor: float, of: str) -> str:
    if value is None:
        return ""
    if hasattr(value, "name"):
        # a name beside a percentage (65535) says that there is none; a class is its name
        return "" if of in ("MuAvailable", "MuUsed") else str(value.name)
    if factor != 1.0:
        value /= factor
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _reasons(design: Design, why: Estimate, place: int) -> list[str]:
    """The model that fits best against its own range, the rule that weighs most, and its share."""
    winner, rule = int(why.winner[place]), int(why.rule[place])
    model = f"{winner}: {design.model_names[winner - 1]}" if winner else ""
    return [model, f"{rule}: {sentence(design, rule - 1)}" if rule else "", f"{why.rule_share[place]:.2f}"]


def _rows(
    files: contextlib.ExitStack, table: Path | None, to_screen: bool, config: Config, explained: bool, part: Part
) -> Rows | None:
    if table is not None:
        return Rows(files.enter_context(create(table)), config, explained, part)
    return Rows(sys.stdout, config, explained, part) if to_screen else None


def _events(files: contextlib.ExitStack, changes: Path | None, core: Core, part: Part) -> EventRows | None:
    if changes is None:
        return None
    file = sys.stdout if changes == SCREEN else files.enter_context(create(changes))
    return EventRows(core, file, part.axles, part.begin_us, part.end_us, part.origin_us)
