"""A log, or a bus for some seconds, through a core that nobody listens to."""

import signal
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import FrameType

from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, read_stretches
from wrcd.bus.log_order import TimeOrder, on_channel
from wrcd.bus.opening import open_link
from wrcd.config import input_mappings, load_config
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.errors import InputError
from wrcd.mapping.statements import Statement
from wrcd.tools.bus_check.figures import figures
from wrcd.tools.bus_check.findings import findings
from wrcd.tools.bus_check.gather import Gathered, Item
from wrcd.tools.bus_check.page import nothing, page
from wrcd.tools.bus_check.signs import signs
from wrcd.tools.bus_check.times import Clock
from wrcd.tools.bus_check.units import wrong_units
from wrcd.tools.bus_check.wheelsets import Wheelsets
from wrcd.tools.bus_of import pick_bus
from wrcd.tools.feed import outgoing_of_stretches, progress
from wrcd.tools.progress import Progress

FINE, WOULD_STOP, NO_FRAME_FITS = 0, 1, 3
TURN_S = 0.02
MAX_LIVE_S = 3600.0


def check_log(log: Path, config_file: Path | None, channel: str | None = None) -> int:
    """Print what a log gives a configuration; of a log of several channels, what one of them gives. Returns 0 if
    nothing would stop Valid, 1 if something would or the log is damaged, 3 if no frame fits. Raises InputError."""
    config = load_config(config_file)
    damage, order = Damage(), TimeOrder(log)
    items = order.put(on_channel(read_stretches(log, damage), channel, log))
    status = _report(config, input_mappings(config_file), Gathered(config), progress(items, log))
    for warning in (*damage.warnings(log), *order.warnings()):
        print(f"wrcd: warning: {warning}", file=sys.stderr)
    return WOULD_STOP if status == FINE and not damage.whole else status


def check_live(seconds: float, config_file: Path | None, interface: str | None, channel: str | None) -> int:
    """The same of a bus, to which nothing is sent. Ctrl-C ends it sooner. Raises InputError."""
    if not 0.0 < seconds <= MAX_LIVE_S:
        raise InputError(f"takes seconds up to {MAX_LIVE_S:g}, not {seconds:g}", key="--live")
    config = load_config(config_file)
    gathered = Gathered(config)
    bus = pick_bus(interface, channel, config_file, (config.interface, config.channel))
    heard = _heard(seconds, *bus, gathered.receiver.fd)
    return _report(config, input_mappings(config_file), gathered, heard)


def _heard(seconds: float, interface: str, channel: str, fd: bool) -> Iterator[tuple[Frame, str]]:
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
    wheelsets = Wheelsets(config)
    core = Core(config, observer=wheelsets)
    clock = Clock(core, config)
    for _ in outgoing_of_stretches(core, gathered.watched(items)):
        clock.look()
    clock.end()
    if not gathered.mapped:
        print("\n".join(nothing(config, gathered)))
        return NO_FRAME_FITS
    found = figures(config, gathered, core.counts.rejected_by_message)
    fits = signs(config, gathered)
    told = [
        *wrong_units(config, mappings, gathered, found),
        *findings(config, gathered, found, fits, clock.axles, wheelsets.finding),
    ]
    print("\n".join(page(config, gathered, found, fits, clock.axles, told)))
    return WOULD_STOP if any(f.stops for f in told) else FINE
