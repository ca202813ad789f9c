"""A log, or a bus for some seconds, through a core that nobody listens to."""

import math
import signal
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import FrameType

import numpy as np

from wrcd.bus.frame import Frame
from wrcd.bus.opening import open_link
from wrcd.config.config import input_mappings, load_config
from wrcd.config.statements import Statement
from wrcd.core.configuration import Config
from wrcd.core.core import Core, Observer
from wrcd.core.events import Change
from wrcd.dbc.bus_check.findings import findings, nothing, page
from wrcd.dbc.bus_check.input_figures import Gathered, figures, spells
from wrcd.dbc.bus_check.likeness import likeness
from wrcd.dbc.bus_check.signs import signs
from wrcd.dbc.bus_check.wrong_units import wrong_units
from wrcd.errors import InputError
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.records import Estimate, StepResult, Tick
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
    wheelsets = Wheelsets(config)
    core = Core(config, observer=wheelsets)
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
    noted = [
        *wrong_units(config, mappings, gathered, found),
        *findings(config, gathered, found, fits, lasted, wheelsets.finding),
    ]
    print("\n".join(page(config, gathered, found, fits, lasted, noted)))
    return WOULD_STOP if any(f.stops for f in noted) else FINE


MIN_S = 30.0  # of measurements: over a stop, saturated for most of it, some sound trains seem unlike their design's
MAX_LOG = 300.0  # of a likelihood: more is no number


class Wheelsets(Observer):
    """Shows a core's measurements to a Likeness: an observer of the core."""

    def __init__(self, config: Config) -> None:
        axles = len(config.axles)
        self._noise_rms = np.array(config.design.noise_rms)[:, None]
        self._likeness = likeness(config.design, axles)  # None where the design says too little
        self._tick_s = config.design.tick_s
        self._seconds = 0.0  # in which an axle had data
        self._saturated: BoolArray = np.zeros(axles, dtype=bool)

    def stepped(self, tick: Tick, result: StepResult) -> None:
        """Measurements that the bank has used, far from pulses of the axle box."""
        used = result.accepted & ~result.near_pulse
        self._seconds += self._tick_s * bool(used.any())
        if self._likeness is not None:
            x = np.where(used, tick.z / self._noise_rms, 0.0)
            self._likeness.add(x, used, tick.speed_m_s, self._saturated)

    def was_reset(self, axle: int) -> None:
        """Its window does not go on."""
        self._saturated[axle] = False
        if self._likeness is not None:
            self._likeness.reset(axle)

    def estimated(self, tick: int, estimate: Estimate) -> None:
        """Which axles are saturated."""
        self._saturated = estimate.saturated

    @property
    def finding(self) -> str | None:
        """What the signals say against the design's wheelset; None: nothing, or there is too little of them."""
        if self._likeness is None or not self._likeness.unlike or self._seconds < MIN_S:
            return None
        k, m, margin = self._likeness.figures
        times = math.exp(min(0.5 * margin, MAX_LOG))
        return (
            f"the signals of {self._seconds:.0f} s fit a wheelset with {k:.2f} times the design's yaw stiffness over "
            f"yaw inertia (k_w/I_w) and {m:.2f} times its load over mass (M_v/m_w) {times:.1g} times better than one "
            "near the design's"
        )
