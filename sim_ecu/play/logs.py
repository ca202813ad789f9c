"""The logs that `sim-ecu play` writes: which format holds all that is to go into it."""

import contextlib
import gzip
import math
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import can

from sim_ecu.play.mapped import Train
from sim_ecu.play.scenario import Scenario
from wrcd.bus.candump import format_line
from wrcd.bus.pythoncan import from_message
from wrcd.errors import InputError
from wrcd.logs.reader import log_suffix

# python-can's writers of these leave such frames out, or write them as others.
_WITHOUT_FD = {".trc", ".csv"}
_WITHOUT_ERRORS = {".trc"}
_HINT = "use .log, .asc or .blf"


class CandumpWriter(can.Listener):
    """Writes frames as candump does. python-can's writer puts a direction behind each, which readers of the plain form
    take for data."""

    def __init__(self, log: Path) -> None:
        self._file = log.open("w", encoding="ascii", newline="\n")

    def on_message_received(self, msg: can.Message) -> None:
        """Write a line."""
        stamp_us = round(msg.timestamp * 1e6)
        self._file.write(f"{format_line(from_message(msg, stamp_us), str(msg.channel))}\n")

    def stop(self) -> None:
        """Close the file."""
        self._file.close()


class AscWriter(can.ASCWriter):
    """Begins the measurement at the full second before the first frame: stamps that count from 0 then lie in the ticks
    and slots that they have since 1970, and a replay gives the same adhesion."""

    def on_message_received(self, msg: can.Message) -> None:
        """Write a line, with the first also what comes before it."""
        if not self.header_written:
            self.log_event("begins at the full second", math.floor(msg.timestamp))
        super().on_message_received(msg)


class Mf4Writer(can.MF4Writer):
    """Says that its begin is UTC. python-can's is local time, which a reader in another zone takes for its own."""

    def __init__(self, log: Path) -> None:
        super().__init__(log)
        self._mdf.header.start_time = datetime.fromtimestamp(self._start_time, UTC)


def check_format(log: Path, scenario: Scenario, train: Train) -> None:
    """Raises InputError if the format that the suffix gives cannot hold every frame of a scenario."""
    suffix = log_suffix(log)
    if suffix == ".db":
        # python-can's writer stops with frames still in its queue, and appends to a file that is there
        raise InputError("cannot be written: a .db loses its last frames without a word", file=log, hint=_HINT)
    if suffix in _WITHOUT_FD and train.has_fd:
        raise InputError(
            f"cannot be written: a {suffix} takes no CAN FD frames, which this train has", file=log, hint=_HINT
        )
    if suffix in _WITHOUT_ERRORS and any(f.kind == "error-flood" for f in scenario.faults):
        raise InputError(
            f"cannot be written: a {suffix} takes no error frames, which error-flood sends", file=log, hint=_HINT
        )


@contextlib.contextmanager
def open_logger(log: Path) -> Iterator[can.Listener]:
    """A writer for the suffix. Raises InputError if there is none or the file can't be made. To be checked before."""
    try:
        logger = _writer(log)
    except (ValueError, OSError, ImportError, NotImplementedError) as e:
        raise InputError(f"cannot be written: {e}", file=log, hint="use .log for a candump log") from None
    try:
        yield logger
    finally:
        logger.stop()


def _writer(log: Path) -> can.Listener:
    if log.suffix.lower() == ".log":
        return CandumpWriter(log)
    if log.suffix.lower() == ".mf4":
        return Mf4Writer(log)
    if log_suffix(log) != ".asc":
        return can.Logger(log)
    return AscWriter(gzip.open(log, "wt") if log.suffix.lower() == ".gz" else log)
