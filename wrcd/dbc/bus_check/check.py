"""A log, or a bus for some seconds, through a core that nobody listens to."""

import signal
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import FrameType

from wrcd.bus.frame import Frame
from wrcd.bus.opening import open_link
from wrcd.config.config import input_mappings, load_config
from wrcd.config.statements import Statement
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import Change
from wrcd.dbc.bus_check.findings import findings, nothing, page
from wrcd.dbc.bus_check.input_figures import Gathered, figures, spells
from wrcd.dbc.bus_check.signs import signs
from wrcd.dbc.bus_check.wrong_units import wrong_units
from wrcd.errors import InputError
from wrcd.logs.bus_of import pick_bus
from wrcd.logs.columns import Item
from wrcd.logs.feed import outgoing_of_stretches
from wrcd.logs.reader import LogReader
from wrcd.logs.story_events import NewChanges
from wrcd.progress import Progress

FINE, WOULD_STOP, NO_FRAME_FITS = 0, 1, 3
TURN_S = 0.02
MAX_LIVE_S = 3600.0


def check_log(log: Path, config_file: Path | None, channel: str | None = None) -> int:
    """Print what a log gives a configuration; of a log of several channels, what one of them gives. Returns 0 if
    nothing would stop Valid, 1 if something would or the log is damaged, 3 if no frame fits. Raises InputError."""
    config = load_config(config_file)
    with LogReader(log, channel, shows=True) as reader:
        status = _report(config, input_mappings(config_file), Gathered(config), reader.in_order())
    for warning in reader.warnings:
        print(f"wrcd: warning: {warning}", file=sys.stderr)
    return WOULD_STOP if status == FINE and not reader.whole else status


def check_live(seconds: float, config_file: Path | None, interface: str | None, channel: str | None) -> int:
    """The same of a bus, to which nothing is sent. Ctrl-C ends it sooner. Raises InputError."""
    if not 0.0 < seconds <= MAX_LIVE_S:
        raise InputError(f"takes seconds up to {MAX_LIVE_S:g}, not {seconds:g}", key="--live")
    config = load_config(config_file)
    gathered = Gathered(config)
    bus = pick_bus(interface, channel, config_file, (config.interface, config.channel))
    frames = _frames(seconds, *bus, gathered.receiver.fd)
    return _report(config, input_mappings(config_file), gathered, frames)


def _frames(seconds: float, interface: str, channel: str, fd: bool) -> Iterator[tuple[Frame, str]]:
    """Every frame of a bus for so long."""
    stopped = False

    def stop(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True

    link = open_link(interface, channel, None, fd=fd, user_settings=True)
    shown, began = Progress(), time.monotonic()
    before = signal.signal(signal.SIGINT, stop)
    try:
        while not stopped and (passed := time.monotonic() - began) < seconds:
            for frame in link.receive(time.time_ns() // 1000):
                yield frame, channel
            shown.at(f"{channel}: listening", passed / seconds)
            time.sleep(TURN_S)
    finally:
        signal.signal(signal.SIGINT, before)
        link.close()
        shown.end()


def _report(config: Config, mappings: Sequence[Statement], gathered: Gathered, items: Iterable[Item]) -> int:
    core = Core(config)
    new_changes = NewChanges(core)
    changes: list[Change] = []
    for _ in outgoing_of_stretches(core, gathered.watched(items)):
        changes += new_changes.take()
    changes += new_changes.take()
    lasted = {a.number: spells(a.number, changes, core.time_us or 0) for a in config.axles}
    if not gathered.mapped:
        print("\n".join(nothing(config, gathered)))
        return NO_FRAME_FITS
    found = figures(config, gathered, core.counts.rejected_by_message)
    fits = signs(config, gathered)
    noted = [*wrong_units(config, mappings, gathered, found), *findings(config, gathered, found, fits, lasted)]
    print("\n".join(page(config, gathered, found, fits, lasted, noted)))
    return WOULD_STOP if any(f.stops for f in noted) else FINE
