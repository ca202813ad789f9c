"""The files that `wrcd replay` writes: checked before the first byte, removed again if nothing comes of them."""

import contextlib
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Self

from wrcd.bus.log import format_line
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing
from wrcd.errors import InputError, create
from wrcd.tools.events import SCREEN, EventRows
from wrcd.tools.rows import Rows
from wrcd.tools.selection import Part

if TYPE_CHECKING:
    from wrcd.tools.export.gather import Gather


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where what comes of a log is written; None: nowhere. events may be SCREEN."""

    frames: Path | None = None  # -o
    rows: Path | None = None  # --csv
    events: Path | None = None  # --events
    mf4: Path | None = None  # --mf4
    mcap: Path | None = None  # --mcap

    @property
    def files(self) -> list[tuple[str, Path]]:
        """Options and their files."""
        named = (
            ("-o", self.frames), ("--csv", self.rows), ("--events", self.events), ("--mf4", self.mf4),
            ("--mcap", self.mcap),
        )  # fmt: skip
        return [(key, file) for key, file in named if file is not None and not (key == "--events" and file == SCREEN)]

    def remove(self) -> None:
        """Take back what was begun."""
        for _, file in self.files:
            if file.is_file():
                file.unlink()


def check_outputs(outputs: Sequence[Outputs], logs: Sequence[Path], config_file: Path | None) -> None:
    """Raises InputError for an output that would overwrite an input, or that is named twice, however it is spelt."""
    files = [(key, file) for o in outputs for key, file in o.files]
    for number, (key, file) in enumerate(files):
        if any(_same(file, log) for log in logs):
            raise InputError("is the log itself; it would be lost", file=file, hint="give another file")
        if config_file is not None and _same(file, config_file):
            raise InputError("is the configuration itself; it would be lost", file=file, hint="give another file")
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
        gathered: "Gather | None" = None,
    ) -> None:
        self.sent = 0  # frames within the part
        self._part, self._gathered = part, gathered
        with contextlib.ExitStack() as files:
            self._frames = files.enter_context(create(outputs.frames)) if outputs.frames else None
            self._events: EventRows | None = None
            if outputs.events is not None:
                file: IO[str] = sys.stdout
                if outputs.events != SCREEN:
                    file = files.enter_context(create(outputs.events))
                self._events = EventRows(core, file, part.axles, part.begin_us, part.end_us, part.origin_us)
            self._rows: Rows | None = None
            if outputs.rows is not None:
                self._rows = Rows(files.enter_context(create(outputs.rows)), config, explained, part)
            elif explained or not (outputs.files or outputs.events):
                self._rows = Rows(sys.stdout, config, explained, part)
            if gathered is not None:
                files.callback(gathered.close)
            self._files = files.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    def write(self, made: Iterator[tuple[Outgoing, str]]) -> None:
        """Write what of the frames made, and of the changes behind them, is wanted."""
        for o, channel in made:
            if self._part.wants(o):
                self.sent += 1
                if self._frames:
                    self._frames.write(format_line(o.frame, channel) + "\n")
                if self._rows:
                    self._rows.write(o)
                if self._gathered:
                    self._gathered.sent(o)
            self._look()
        self._look()

    def _look(self) -> None:
        if self._events:
            self._events.look()
        if self._gathered:
            self._gathered.look()
