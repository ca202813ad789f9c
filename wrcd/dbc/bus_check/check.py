"""A log, or a bus for some seconds, through a core that nobody listens to."""

import signal
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import FrameType

from wrcd.bus.opening import open_link
from wrcd.config.config import input_mappings, load_config
from wrcd.config.statements import Statement
from wrcd.core.core import Core
from wrcd.core.events import Change
from wrcd.core.slides import slides_of
from wrcd.dbc.bus_check.findings import design_findings, findings, nothing, page
from wrcd.dbc.bus_check.input_figures import Gathered, figures
from wrcd.dbc.bus_check.signs import signs
from wrcd.dbc.bus_check.wrong_units import wrong_units
from wrcd.errors import InputError
from wrcd.logs.bus_of import pick_bus
from wrcd.logs.feed import made_of_stretches
from wrcd.logs.reader import LogReader
from wrcd.logs.story_events import NewChanges, of_changes, with_gaps
from wrcd.logs.story_records import Spells
from wrcd.progress import Progress

FINE, WOULD_STOP, NO_FRAME_FITS = 0, 1, 3
TURN_S = 0.02
SILENT_US = 100_000  # without a mapped frame of a bus: the clock closes the slots
MAX_LIVE_S = 3600.0


def check_log(log: Path, config_file: Path | None, channel: str | None = None) -> int:
    """Print what a log gives a configuration; of a log of several channels, what one of them gives. Returns 0 if
    nothing would stop Valid, 1 if something would or the log is damaged, 3 if no frame fits. Raises InputError."""
    config = load_config(config_file)
    with LogReader(log, channel, shows=True) as reader:
        core, gathered = Core(config), Gathered(config, reader.clock)
        items = gathered.watched(reader.clock.items(reader.in_order()))
        new = NewChanges(core, reader.clock)
        status = _report(core, input_mappings(config_file), gathered, made_of_stretches(core, items), new)
    for warning in reader.warnings:
        print(f"wrcd: warning: {warning}", file=sys.stderr)
    return WOULD_STOP if status == FINE and not reader.whole else status


def check_live(seconds: float, config_file: Path | None, interface: str | None, channel: str | None) -> int:
    """The same of a bus, to which nothing is sent. Ctrl-C ends it sooner. Raises InputError."""
    if not 0.0 < seconds <= MAX_LIVE_S:
        raise InputError(f"takes seconds up to {MAX_LIVE_S:g}, not {seconds:g}", key="--live")
    config = load_config(config_file)
    core, gathered = Core(config), Gathered(config)
    bus = pick_bus(interface, channel, config_file, (config.interface, config.channel))
    turns = _listened(core, gathered, seconds, *bus)
    return _report(core, input_mappings(config_file), gathered, turns, NewChanges(core))


def _listened(core: Core, gathered: Gathered, seconds: float, interface: str, channel: str) -> Iterator[None]:
    """Every frame of a bus for so long to a core, to which a silence lasts as long as it does. A turn each."""
    stopped = False

    def stop(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True

    link = open_link(interface, channel, None, fd=gathered.receiver.mapped.fd, user_settings=True)
    shown, began, heard_us = Progress(), time.monotonic(), 0
    before = signal.signal(signal.SIGINT, stop)
    try:
        while not stopped and (passed := time.monotonic() - began) < seconds:
            now_us, seen = time.time_ns() // 1000, core.counts.seen
            for frame in link.receive(now_us):
                gathered.take((frame, channel))
                core.feed(frame)
            if core.counts.seen > seen or core.time_us is None:
                heard_us = now_us
            elif now_us - heard_us > SILENT_US:
                core.advance(now_us)
            gathered.lasts(now_us)
            yield
            shown.at(f"{channel}: listening", passed / seconds)
            time.sleep(TURN_S)
    finally:
        signal.signal(signal.SIGINT, before)
        link.close()
        shown.end()


def _report(
    core: Core, mappings: Sequence[Statement], gathered: Gathered, run: Iterable[object], new_changes: NewChanges
) -> int:
    """Of a core that is run by iterating."""
    config = core.config
    changes: list[Change] = []
    for _ in run:
        changes += new_changes.take()
    changes += new_changes.take()
    if not gathered.mapped:
        print("\n".join(nothing(config, gathered)))
        return NO_FRAME_FITS
    lasted = {a.number: _spells(a.number, changes, gathered) for a in config.axles}
    found = figures(config, gathered, core.counts.rejected_by_message)
    fits = signs(config, gathered)
    noted = [*wrong_units(config, mappings, gathered, found), *findings(config, gathered, found, fits, lasted)]
    noted += design_findings(core.design_fits, slides_of(core.estimator).sentence)
    print("\n".join(page(config, gathered, found, fits, lasted, noted, core.design_fits)))
    return WOULD_STOP if any(f.stops for f in noted) else FINE


def _spells(axle: int, changes: Sequence[Change], gathered: Gathered) -> Spells:
    """Of an axle; nothing without a change, as of a log that is shorter than a slot."""
    own = [c for c in changes if c.axle == axle]
    if not own or gathered.first_us is None:
        return Spells(())
    return Spells.of(with_gaps(of_changes(axle, own, gathered.first_us, gathered.last_us), gathered.gaps))
