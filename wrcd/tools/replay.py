"""`wrcd replay`: a log through the very core that runs live. The same log gives the same bytes."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from wrcd.bus.log import Damage, read_log, read_stretches
from wrcd.bus.log_kind import check_log
from wrcd.bus.log_order import TimeOrder, on_channel
from wrcd.config import load_config
from wrcd.core.core import Core
from wrcd.core.counts import Counts
from wrcd.core.messages import Outgoing
from wrcd.errors import InputError, Status
from wrcd.recorder.resume import Saved, load, state_file
from wrcd.tools.events import SCREEN
from wrcd.tools.export.opening import about, gather
from wrcd.tools.feed import outgoing, outgoing_of_stretches, progress
from wrcd.tools.outputs import Outputs, Writing, check_outputs
from wrcd.tools.selection import WHOLE, Part, Selection, Survey, check_since, check_time, survey


def replay(
    log: Path,
    config_file: Path | None,
    output: Path | None,
    table: Path | None,
    explained: bool = False,
    changes: Path | None = None,
    *,
    selection: Selection = WHOLE,
    mf4: Path | None = None,
    mcap: Path | None = None,
) -> int:
    """Run a log and write what was asked for; a summary goes to standard error. explained: the CSV's rows say which
    model and which rule decided.

    Returns the exit status: STOPPED for a log that could not be read to its end, NOT_THERE where no frame is an input.
    Outputs of a log that turns out not to be readable at all are removed again.
    """
    outputs = Outputs(output, table, changes, mf4, mcap)
    check_log(log)
    check_outputs([outputs], [log], config_file)
    if changes == SCREEN and explained and table is None:
        raise InputError("and the rows of --explain are both for the screen", key="--events", hint="name a file")
    config = load_config(config_file)
    selection.check(config)
    gathered = gather(outputs, config)
    core = Core(config, observer=gathered)
    saved = resume(core, log)
    # a pipe cannot be read twice; a state may tell of an axle whose frames lie before the log
    looked = survey(log, config, selection.channel) if log.is_file() or not log.exists() else Survey()
    found = looked if saved is None else replace(looked, without_frame=frozenset())
    check_since(log, selection, found.first_us)
    part = Part(selection, found, config)
    if part.end_us is not None and part.end_us <= found.first_us:
        check_time(log, selection, part)
    run = Run(log, core, saved, selection.channel)
    try:
        if gathered is not None:
            gathered.begin(core, part, about(log, config, found.first_us))
        with Writing(outputs, core, config, explained, part, gathered) as writing:
            writing.write(run.made(part))
        if not writing.sent:
            check_time(log, selection, part)
    except InputError:
        outputs.remove()
        raise
    run.tell(found, writing.sent)
    return run.status


def resume(core: Core, log: Path) -> Saved | None:
    """Put the state that lies beside a recorder's log into a core, and say so. Raises InputError if it does not fit."""
    path = state_file(log)
    if not path.exists() or not log.exists():
        return None
    saved = load(path, core)
    print(f"wrcd: goes on from {path.name}", file=sys.stderr)
    return saved


class Run:
    """One log through a core, and what is said of it at the end. saved: the state that the core goes on from."""

    def __init__(self, log: Path, core: Core, saved: Saved | None, channel: str | None) -> None:
        self._log, self._core, self._saved, self._channel = log, core, saved, channel
        self._before = Counts(core.counts.accepted, core.counts.rejected.copy(), ticks=core.counts.ticks)
        self._damage, self._order = Damage(), TimeOrder(log)

    def made(self, part: Part) -> Iterator[tuple[Outgoing, str]]:
        """What the core makes of the log, as far as it is needed for a part, and the channel."""
        if self._saved is None:
            stretches = on_channel(read_stretches(self._log, self._damage), self._channel, self._log)
            return outgoing_of_stretches(self._core, progress(part.read(self._order.put(stretches)), self._log))
        frames = on_channel(read_log(self._log, self._damage), self._channel, self._log)
        return outgoing(self._core, progress(frames, self._log), self._saved)

    @property
    def accepted(self) -> int:
        """Frames of the log that the core took."""
        return self._core.counts.accepted - self._before.accepted

    @property
    def status(self) -> Status:
        """The exit status of a log that was read."""
        if not self.accepted:
            return Status.NOT_THERE
        return Status.DONE if self._damage.whole else Status.STOPPED

    def tell(self, found: Survey, sent: int) -> None:
        """Say on standard error what is odd in the log, and what it came to."""
        for warning in self._warnings(found):
            print(f"wrcd: warning: {warning}", file=sys.stderr)
        read, counts = self._damage.read, self._core.counts
        if not self.accepted:
            print(
                f"wrcd: error: {self._log}: none of its {read} frames is a usable input of this configuration",
                file=sys.stderr,
            )
        rejected = Counts(rejected=counts.rejected - self._before.rejected)
        print(
            f"wrcd: {read} frames read, {self.accepted} accepted, rejected: {rejected.rejections}; "
            f"{counts.ticks - self._before.ticks} ticks, {sent} frames made",
            file=sys.stderr,
        )

    def _warnings(self, found: Survey) -> Iterator[str]:
        yield from self._damage.warnings(self._log)
        yield from self._order.warnings()
        if self._saved is not None and self._damage.read != self._saved.lines:
            yield (
                f"{self._log}: has {self._damage.read} frames, {self._saved.lines} when it was recorded: from where "
                "they differ on, so may what is made of them"
            )
        if self.accepted and found.without_frame:
            axles = ", ".join(map(str, sorted(found.without_frame)))
            yield f"{self._log}: has no frame of axle {axles}; no rows of it"
