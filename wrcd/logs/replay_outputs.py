"""The files that commands on a log write: checked before the first byte, removed again if nothing comes of them."""

import contextlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import IO, Any, Self

import numpy as np

from wrcd.bus.candump import format_lines
from wrcd.bus.dbc import Message, find_message, find_signal
from wrcd.bus.positions import Position, message_key, position
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import COLUMNS as EVENT_COLUMNS
from wrcd.core.events import csv_line, csv_time
from wrcd.core.reports import Made
from wrcd.errors import InputError, create
from wrcd.logs.exports import GatherExports
from wrcd.logs.feed import Part
from wrcd.logs.rule_sentences import rule_words
from wrcd.logs.story_events import NewChanges

OPTIONS = {"-o": ".log", "--csv": ".csv", "--events": ".events.csv", "--mf4": ".mf4", "--mcap": ".mcap"}  # and suffixes
SCREEN = Path("-")  # stands for standard output
START_BYTES = 4096  # of a file that is asked whose it is


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where what comes of a log is written, of several logs the folders; None: nowhere. events may be SCREEN."""

    frames: Path | None = None  # -o
    rows: Path | None = None  # --csv
    events: Path | None = None  # --events
    mf4: Path | None = None  # --mf4
    mcap: Path | None = None  # --mcap

    @property
    def files(self) -> list[tuple[str, Path]]:
        """Options and their files."""
        named = zip(OPTIONS, (self.frames, self.rows, self.events, self.mf4, self.mcap), strict=True)
        return [(key, file) for key, file in named if file is not None and not (key == "--events" and file == SCREEN)]

    def within(self, name: str) -> "Outputs":
        """The files of a log of this name in these folders."""
        folders = (self.frames, self.rows, self.events, self.mf4, self.mcap)
        return Outputs(*(f and f / (name + suffix) for f, suffix in zip(folders, OPTIONS.values(), strict=True)))

    def remove(self) -> None:
        """Take back what was begun."""
        for _, file in self.files:
            if file.is_file():
                file.unlink()


def check_outputs(outputs: Sequence[Outputs], logs: Sequence[Path], others: Mapping[str, Path | None]) -> None:
    """Raises InputError for an output that would overwrite an input, or that is named twice, however it is spelt.

    others: inputs beside the logs, by what each is.
    """
    files = [(key, file) for o in outputs for key, file in o.files]
    for number, (key, file) in enumerate(files):
        if any(_same(file, log) for log in logs):
            raise InputError("is the log itself; it would be lost", file=file, hint="give another file")
        for what, other in others.items():
            if other is not None and _same(file, other):
                raise InputError(f"is the {what} itself; it would be lost", file=file, hint="give another file")
        for other_key, other in files[:number]:
            if _same(file, other):
                raise InputError(
                    f"is one file for {other_key} and {key}; one would overwrite the other",
                    file=file,
                    hint="give each a file of its own",
                )


def _same(one: Path, other: Path) -> bool:
    """Whether two paths are one file, there or still to be made. A device or a pipe may take two outputs."""
    try:
        if one.exists() and other.exists():
            return one.is_file() and one.samefile(other)
        return one.resolve() == other.resolve()
    except (OSError, RuntimeError):  # a link to itself: making the file will tell
        return False


class Writing:
    """Outputs as they are written. A context manager: its end closes them."""

    def __init__(
        self,
        outputs: Outputs,
        core: Core,
        config: Config,
        explained: bool,
        part: Part,
        gathered: GatherExports | None = None,
    ) -> None:
        self.sent = 0  # frames within the part
        self._part, self._gathered = part, gathered
        with contextlib.ExitStack() as files:
            self._frames = files.enter_context(create(outputs.frames)) if outputs.frames else None
            self._events: IO[str] | None = None
            if outputs.events is not None:
                to_screen = outputs.events == SCREEN
                self._events = sys.stdout if to_screen else files.enter_context(create(outputs.events))
                self._events.write(csv_line(EVENT_COLUMNS))
            self._new_changes = NewChanges(core)
            self._rows: AdhesionRows | None = None
            if outputs.rows is not None:
                self._rows = AdhesionRows(files.enter_context(create(outputs.rows)), config, explained, part)
            elif explained or not (outputs.files or outputs.events):
                self._rows = AdhesionRows(sys.stdout, config, explained, part)
            if gathered is not None:
                files.callback(gathered.close)
            self._files = files.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    def write(self, parts: Iterator[tuple[Made, str]]) -> None:
        """Write what of the frames made, and of the changes behind them, is wanted."""
        for part, channel in parts:
            made = self._part.wanted(part)
            self.sent += len(made)
            if self._frames:
                self._frames.write(format_lines(made.frames, channel))
            if self._rows:
                self._rows.write(made)
            if self._gathered:
                self._gathered.sent(made)
            self._look()
        self._look()

    def _look(self) -> None:
        if self._events:
            for c in self._new_changes.take():
                if c.axle in self._part.axles and self._part.wants_at(c.time_us):
                    self._events.write(replace(c, time_us=c.time_us - self._part.origin_us).csv_line)
        if self._gathered:
            self._gathered.look()


COLUMNS = (
    "time_s", "axle", "validity", "mu_available_pct", "mu_used_pct", "contact_state", "surface", "confidence",
    "sample_age_ms", "cause", "half_width_pp", "low_pct", "high_pct",
)  # fmt: skip
REASONS = ("winning_model", "dominant_rule", "rule_share")  # with --explain
# the signals of the columns behind the axle; the columns after them are the core's, whatever a frame carries
SIGNALS = ("Validity", "MuAvailable", "MuUsed", "ContactState", "Surface", "Confidence", "SampleAge")


def quoted(text: str) -> str:
    """A cell of CSV, one of several."""
    return csv_line((text, ""))[:-2]


_CAUSES = tuple(quoted(cause.words) for cause in Cause)  # by their number


class AdhesionRows:
    """The CSV: what the Adhesion frames say, in the words of the DBC's value tables."""

    def __init__(self, file: IO[str], config: Config, explained: bool, part: Part) -> None:
        self._file = file
        self._file.write(csv_line((*COLUMNS, *REASONS) if explained else COLUMNS))
        self._design, self._explained = config.design, explained
        self._rule_words = cache(partial(rule_words, config.design))
        self._origin_us = part.origin_us
        self._messages: dict[int, tuple[Cells, int]] = {}  # by Frame.key
        for a in config.axles:
            if a.number in part.axles:
                message = find_message(config.database, a.adhesion.message)
                self._messages[message_key(message)] = Cells(message, a.adhesion), a.number

    def write(self, made: Made) -> None:
        """One row for an Adhesion frame, nothing for others."""
        frames = made.frames[np.isin(made.frames["word"], list(self._messages))]
        stamps_us, of = frames["stamp_us"].tolist(), frames["report"]
        stamps = {us: csv_time(us - self._origin_us) for us in set(stamps_us)}
        rows = [""] * len(frames)
        for word, (cells, number) in self._messages.items():
            places = np.flatnonzero(frames["word"] == word)
            for at, row in zip(places.tolist(), cells.of(frames["data"][places]), strict=True):
                rows[at] = f"{stamps[stamps_us[at]]},{number},{row}"
        estimates, causes = made.reports["estimate"], frames["cause"].tolist()
        intervals = _intervals(*(x[of] for x in (
            made.reports["has_estimate"], estimates["mu_available_pct"], estimates["half_width_pp"]
        )))  # fmt: skip
        rows = [f"{row},{_CAUSES[cause]},{i}\n" for row, cause, i in zip(rows, causes, intervals, strict=True)]
        if self._explained:
            known = made.reports["has_estimate"][of].tolist()
            why = (estimate if is_known else None for is_known, estimate in zip(known, estimates[of], strict=True))
            rows = [f"{row[:-1]},{csv_line(self._reasons(w))}" for row, w in zip(rows, why, strict=True)]
        self._file.write("".join(rows))

    def _reasons(self, why: Any) -> list[str]:
        """The model that fits best against its own range, the rule that weighs most, and its share."""
        if why is None:
            return ["", "", ""]
        winner, rule = int(why["winner"]), int(why["rule"])
        model = f"{winner}: {self._design.model_names[winner - 1]}" if winner else ""
        return [model, f"{rule}: {self._rule_words(rule)}" if rule else "", f"{why['rule_share']:.2f}"]


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
        words = {raw & at.mask: quoted(word) for word, raw in (sent.words or {}).items()}
        return words if sent.not_available is None else {sent.not_available & at.mask: "", **words}

    def of(self, data: Any) -> Iterator[str]:
        """Of each frame the cells of SIGNALS, empty for those that the message lacks. data: its eight bytes."""
        length, out = self._message.length, [[""] * len(data)] * len(SIGNALS)
        numbers = {"little": data.view("<u8")[:, 0], "big": data.view(">u8")[:, 0] >> 8 * (8 - length)}
        for signal, at, texts, column in zip(self._known, self._positions, self._texts, self._columns, strict=True):
            raw = (numbers[at.order] >> at.shift & at.mask).tolist()
            for new in set(raw).difference(texts):  # of a set less keys each key is looked at
                decoded: Any = self._message.decode(data[raw.index(new)].tobytes()[:length])
                texts[new] = quoted(_cell(decoded.get(signal.name), signal.factor, SIGNALS[column]))
            out[column] = [texts[number] for number in raw]
        return map(",".join, zip(*out, strict=True))


def _cell(value: Any, factor: float, of: str) -> str:
    if value is None:
        return ""
    if hasattr(value, "name"):
        # a name beside a percentage (65535) says that there is none; a class is its name
        return "" if of in ("MuAvailable", "MuUsed") else str(value.name)
    if factor != 1.0:
        value /= factor
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _intervals(is_known: Any, mu: Any, half: Any) -> Iterator[str]:
    """The 90 % intervals that were estimated: half-width in percentage points, ends in percent."""
    ends = zip(half.tolist(), np.maximum(mu - half, 0.0).tolist(), (mu + half).tolist(), strict=True)
    known = ((is_known != 0) & np.isfinite(half)).tolist()
    return (f"{h:.2f},{low:.2f},{high:.2f}" if k else ",," for k, (h, low, high) in zip(known, ends, strict=True))


def check_output(output: Path, inputs: Sequence[Path | None], key: str = "-o") -> None:
    """Raises InputError for an output that is one of the inputs, or whose folder is not there."""
    for read in inputs:
        if read is not None and _same(output, read):
            raise InputError("is read by this command; it would be lost", file=output, key=key, hint="give another")
    if output.is_dir():
        raise InputError("is a folder", file=output, key=key, hint="give a file's name")
    if not output.parent.is_dir():
        raise InputError("its folder is not there", file=output, key=key, hint=f"mkdir -p {output.parent}")


def check_overwrite(output: Path, mark: str, what: str) -> None:
    """Raises InputError for a file that is there, and that is not one of ours as its first bytes tell."""
    try:
        with output.open("rb") as file:
            start = file.read(START_BYTES)
    except FileNotFoundError:
        return
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=output, key="-o") from None
    if start and mark.encode() not in start:
        raise InputError(f"is there and is no {what}", file=output, key="-o", hint="another name, or --force")
