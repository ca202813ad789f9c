"""`wrcd replay`: a log, or several, through the very core that runs live. The same log gives the same bytes."""

import contextlib
import io
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

from wrcd.bus.frame import counted_ids, id_text
from wrcd.config.config import load_config
from wrcd.core.core import Core
from wrcd.core.reports import Made
from wrcd.errors import InputError, Status
from wrcd.logs.columns import Stretch
from wrcd.logs.exports import gathering_for
from wrcd.logs.feed import WHOLE, Part, Selection, Survey, check_since, check_time, made_of_log, survey
from wrcd.logs.reader import LogReader
from wrcd.logs.replay_outputs import SCREEN, Outputs, Writing, check_outputs
from wrcd.recorder.kept import take_file


@dataclass(frozen=True, slots=True)
class ReplayInputs:
    """The files by which logs are estimated. configuration: None for the default one; design: None for its own; state:
    what slides had revealed before, None for nothing."""

    configuration: Path | None = None
    design: Path | None = None
    state: Path | None = None


def replay(
    log: Path, inputs: ReplayInputs, outputs: Outputs, *, explained: bool = False, selection: Selection = WHOLE
) -> int:
    """Run a log and write what was asked for; a summary goes to standard error. explained: the CSV's rows say which
    model and which rule decided.

    Returns the exit status: STOPPED for a log that could not be read to its end, NOT_THERE where no frame is an input.
    Outputs of a log that turns out not to be readable at all are removed again.
    """
    check_outputs([outputs], [log], asdict(inputs))
    if outputs.events == SCREEN and explained and outputs.rows is None:
        raise InputError("and the rows of --explain are both for the screen", key="--events", hint="name a file")
    config = load_config(inputs.configuration, design_file=inputs.design)
    selection.check(config)
    gathered = gathering_for({"mf4": outputs.mf4, "mcap": outputs.mcap}, config)
    core = Core(config, samples=None if gathered is None else gathered.accepted)
    if inputs.state is not None:
        take_file(core.estimator, inputs.state)
    # a pipe cannot be read twice
    found = survey(log, config, selection.channel) if log.is_file() or not log.exists() else Survey()
    part = Part(selection, found, config)
    if part.end_us is not None and part.end_us <= found.first_us:
        check_time(log, selection, part)
    check_since(log, selection, found.first_us)
    run = ReplayRun(log, core, selection.channel)
    try:
        if gathered is not None:
            gathered.begin(core, part, run.reader, found.first_us)
        with Writing(outputs, core, config, explained, part, gathered) as writing:
            writing.write(run.made(part))
        if not writing.sent:
            check_time(log, selection, part)
    except InputError:
        outputs.remove()
        raise
    run.tell(found, writing.sent)
    for failure in () if gathered is None else gathered.failed:
        print(f"wrcd: error: {failure}", file=sys.stderr)
    return max(run.status, Status.STOPPED) if gathered is not None and gathered.failed else run.status


class ReplayRun:
    """One log through a core, and what is reported of it at the end."""

    def __init__(self, log: Path, core: Core, channel: str | None) -> None:
        self._log, self._core, self._channel = log, core, channel
        self.reader = LogReader(log, channel, shows=True)

    def made(self, part: Part) -> Iterator[tuple[Made, str]]:
        """What the core makes of the log, as far as it is needed for a part, and the channel."""
        return made_of_log(self._core, self.reader, part.read)

    @property
    def status(self) -> Status:
        """The exit status of a log that was read."""
        if not self._core.counts.accepted:
            return Status.NOT_THERE
        return Status.DONE if self.reader.whole else Status.STOPPED

    def tell(self, found: Survey, sent: int) -> None:
        """Say on standard error what is odd in the log, and what it came to."""
        for warning in self._warnings(found):
            print(f"wrcd: warning: {warning}", file=sys.stderr)
        read, counts = self.reader.damage.read, self._core.counts
        if not counts.accepted:
            mapped = ", ".join(map(id_text, sorted(self._core.mapped.keys)))
            there = counted_ids(self._ids()) if self._log.is_file() else ""
            print(
                f"wrcd: error: {self._log}: none of its {read} frames is a usable input of this configuration: it maps "
                f"{mapped}{f'; the log has {there}' if there else ''}",
                file=sys.stderr,
            )
        print(
            f"wrcd: {read} frames read, {counts.accepted} accepted, rejected: {counts.rejections}; "
            f"{counts.ticks} ticks, {sent} frames made",
            file=sys.stderr,
        )

    def _ids(self) -> Counter[int]:
        """How many frames of each id the log has."""
        counts: Counter[int] = Counter()
        for item in LogReader(self._log, self._channel).written():
            counts.update(item.keys.tolist() if isinstance(item, Stretch) else [item[0].key])
        return counts

    def _warnings(self, found: Survey) -> Iterator[str]:
        yield from self._core.config.warnings
        yield from self.reader.warnings
        if self._core.counts.accepted and not self._core.counts.ticks:
            yield f"{self._log}: nothing is estimated: its frames lie within a tick; are their stamps differences?"
        if self._core.counts.accepted and found.without_frame:
            axles = ", ".join(map(str, sorted(found.without_frame)))
            yield f"{self._log}: has no frame of axle {axles}; no rows of it"


SUFFIXES = {".log", ".gz", ".blf", ".asc", ".trc", ".mf4", ".csv", ".db"}


def replays(
    logs: Sequence[Path], inputs: ReplayInputs, folders: Outputs, *, explained: bool, jobs: int,
    selection: Selection = WHOLE,
) -> int:  # fmt: skip
    """Replay logs into folders: NAME.log, NAME.csv, NAME.events.csv, NAME.mf4, NAME.mcap. What each reports is
    printed in their order.

    Returns the largest exit status. Raises InputError before the first log where the outputs cannot be.
    """
    if inputs.state is not None:
        raise InputError("is what one log begins with, not several", key="--state", hint="replay them one by one")
    if jobs < 1:
        raise InputError(f"takes 1 or more, not {jobs}", key="--jobs")
    if not folders.files:
        raise InputError(
            "are several logs",
            key="LOG",
            hint="name a folder for what comes of them: --csv DIR, --events DIR, --mf4 DIR, --mcap DIR or -o DIR",
        )
    if explained and folders.rows is None:
        raise InputError("needs a folder for the rows of several logs", key="--explain", hint="name it: --csv DIR")
    names = [_name(log) for log in logs]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise InputError(f"two logs are called {twice[0]}", key="LOG", hint="rename one, or replay it alone")
    outputs = [folders.within(name) for name in names]
    check_outputs(outputs, logs, asdict(inputs))
    for key, folder in folders.files:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise InputError(f"is no folder: {e.strerror}", file=folder, key=key) from None
    status = 0
    with ProcessPoolExecutor(min(jobs, len(logs)), mp_context=get_context("spawn")) as pool:
        runs = [pool.submit(_one, log, inputs, to, explained, selection) for log, to in zip(logs, outputs, strict=True)]
        for log, run in zip(logs, runs, strict=True):
            ended, lines = run.result()
            print(f"{log}:\n{lines.rstrip()}", file=sys.stderr)
            status = max(status, ended)
    return status


def _one(log: Path, inputs: ReplayInputs, to: Outputs, explained: bool, selection: Selection) -> tuple[int, str]:
    """One log in a process of its own: its exit status, and what it says."""
    lines = io.StringIO()
    with contextlib.redirect_stderr(lines):
        try:
            status = replay(log, inputs, to, explained=explained, selection=selection)
        except InputError as e:
            print(f"wrcd: error: {e}", file=lines)
            status = Status.BAD_INPUT
    return status, lines.getvalue()


def _name(log: Path) -> str:
    """A log's name without the suffixes that tell its format."""
    name = log.name
    while (suffix := Path(name).suffix) in SUFFIXES:
        name = name.removesuffix(suffix)
    return name
