"""The flight recorder: the last frames in memory, written to a folder when Validity was lost, or somebody asks.

A dump is a log like any other. Its replay begins with nothing of what the daemon's estimate had from before but what
slides had revealed, and makes the daemon's own frames when that is forgotten: after PRE_ROLL_S.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence

from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.core.causes import Validity
from wrcd.core.configuration import RecorderConfig
from wrcd.core.core import Core
from wrcd.core.events import COLUMNS, MAX_KEPT, csv_line, csv_time
from wrcd.core.reports import Report
from wrcd.core.slides import kept_text
from wrcd.recorder.dump_folder import LOG, dump_name, safe_channel_name
from wrcd.recorder.ring import CLASSICAL_BYTES, FD_BYTES, RECEIVED, SENT, Ring
from wrcd.recorder.writer import Child, Request, start

# Of 130 simulated logs that were begun anew, 0.3 % of the Adhesion frames after it have other bytes with multiple-unit,
# none of a sound ride; docs/how-to/read-a-recorder-dump.md has the figures by kind.
PRE_ROLL_S = 60.0
PRE_ROLL_ENDS = "the pre-roll ends: from here on compare a replay with what was sent"
LOST_SLOTS = 5  # in a row without Valid: less is a hiccup


class LossOfValidity:
    """Watches every axle; slots_us: the cycle of its Adhesion frame."""

    def __init__(self, slots_us: Sequence[int]) -> None:
        self._after_us = [LOST_SLOTS * slot_us for slot_us in slots_us]
        self._was_valid = [False] * len(slots_us)
        self._since_us: list[int | None] = [None] * len(slots_us)

    def look(self, reports: Sequence[Report], below_min_speed: bool, now_us: int) -> bool:
        """Whether an axle has just lost it for good. A train that stands is not Valid by right; one that is about to
        stand, or has a window of too little track, has lost nothing."""
        lost = False
        for axle, report in enumerate(reports):
            valid = report.validity is Validity.VALID
            if valid or below_min_speed:
                self._was_valid[axle], self._since_us[axle] = valid, None
            elif self._was_valid[axle] and not report.short:
                since_us = self._since_us[axle]
                if since_us is None:
                    self._since_us[axle] = now_us
                elif not 0 <= now_us - since_us < self._after_us[axle]:
                    self._was_valid[axle], lost = False, True
        return lost


# That the ring has room for. An axle of the packaged DBC makes 580 of them; a full bus of 500 kbit/s carries about 4000
# of eight bytes, one of 1 Mbit/s twice as many.
FRAMES_PER_S, AXLE_FRAMES_PER_S = 4000, 1000
SPARE_SHARE = 0.1  # of the ring, may be overwritten before the process that writes a dump has copied it
POST_TRIGGER_US = 2_000_000  # is in the dump, too
HOLD_OFF_US = 30_000_000  # between two dumps that nobody asked for
EXIT_S = 3.0  # for a dump that is due when the daemon ends; less than systemd's patience


class Recorder:
    """The loop gives it all that comes and goes; turn() between turns, when the core has all of it."""

    def __init__(self, config: RecorderConfig, core: Core, channel: str, write: Callable[[str], None]) -> None:
        if config.folder is None:
            raise ValueError("a recorder needs a folder")
        self._folder, self._config, self._core, self._write = config.folder, config, core, write
        self._channel = safe_channel_name(channel)
        frames_per_s = max(FRAMES_PER_S, AXLE_FRAMES_PER_S * len(core.config.axles))
        data_bytes = FD_BYTES if core.mapped.fd else CLASSICAL_BYTES
        self._ring = Ring(math.ceil(config.seconds * (1 + SPARE_SHARE) * frames_per_s), data_bytes)
        self._changes: deque[tuple[int, str]] = deque(maxlen=MAX_KEPT)  # of Validity, by position as rows
        self._changes_told = core.events.total
        self._states = deque([(0, kept_text(core.estimator))], MAX_KEPT)  # by position, and since when
        self._slides = core.estimator.slides
        self._seconds = deque([0], math.ceil(config.seconds) + 1)  # where in the ring each of the last ones began
        self._second_us: int | None = None  # when the newest of them did
        self._loss = LossOfValidity([axle.adhesion.cycle_us for axle in core.config.axles])
        self._asked = False
        self._pending: tuple[str, int] | None = None  # trigger and its time, while the aftermath is awaited
        self._last_us: int | None = None  # of the newest dump that nobody asked for
        self._child: Child | None = None
        self._name = ""
        self._said = ""

    def received(self, frames: FrameBatch | Sequence[Frame]) -> None:
        """What is fed to the core, before it is."""
        self._ring.put_frames(RECEIVED, frames)

    def sent(self, frame: Frame) -> None:
        """A frame that went out."""
        self._ring.put_frame(SENT, frame)

    def ask(self) -> None:
        """A person wants a dump."""
        self._asked = True

    def turn(self, now_us: int) -> None:
        """A turn of the loop is over."""
        core = self._core
        if self._second_us is None:
            self._second_us = now_us
        elif not 0 <= now_us - self._second_us < 1_000_000:
            self._seconds.append(self._ring.end)
            self._second_us = now_us
        if core.events.total != self._changes_told:
            self._changes.extend((self._ring.end, c.csv_line) for c in core.events.since(self._changes_told))
            self._changes_told = core.events.total
        if core.estimator.slides != self._slides:
            self._slides = core.estimator.slides
            self._states.append((self._ring.end, kept_text(core.estimator)))
        if self._loss.look(core.reports, core.below_min_speed, now_us):
            # a clock that has stepped back holds nothing up
            held_off = self._last_us is not None and 0 <= now_us - self._last_us < HOLD_OFF_US
            if self._pending is None and not held_off:
                self._pending, self._last_us = ("validity", now_us), now_us
        if self._asked and self._pending is None:
            self._asked, self._pending = False, ("asked", now_us)
        self.reap()
        if self._pending and self._child is None and not 0 <= now_us - self._pending[1] < POST_TRIGGER_US:
            self._dump()

    def _dump(self, urgent: bool = False) -> None:
        """Have written what is pending."""
        assert self._pending is not None
        ring, config, (trigger, at_us) = self._ring, self._config, self._pending
        self._name, self._pending = dump_name(self._channel, at_us, trigger), None
        first = max(self._seconds[0], ring.end - round(ring.records / (1 + SPARE_SHARE)))
        if first == ring.end:
            self._report(f"no frame in the last {config.seconds:g} s")
            return
        # what begins with the daemon itself has forgotten nothing
        equal_us = ring.stamp_us(first) + (round(PRE_ROLL_S * 1e6) if first else 0)
        rows = [csv_line(COLUMNS), csv_line((csv_time(equal_us), "", "", "", "", PRE_ROLL_ENDS))]
        request = Request(
            folder=str(self._folder),
            name=self._name,
            channel=self._channel,
            first=first,
            end=ring.end,
            data_bytes=ring.data_bytes,
            events="".join((*rows, *(row for position, row in self._changes if position > first))),
            state=next((text for position, text in reversed(self._states) if position <= first), self._states[0][1]),
            max_dumps=config.max_files,
            max_bytes=round(config.max_mb * 1e6),
        )
        try:
            self._child = start(ring, request, urgent)
        except OSError as e:
            self._report(f"no process to write it: {e.strerror}")

    def reap(self) -> None:
        """Log the result of a dump whose process has ended."""
        if self._child is not None and (failed := self._child.finished()) is not None:
            self._report(failed)

    def _report(self, failed: str) -> None:
        """One line for each dump, and one for a trouble however often it comes."""
        if failed != self._said or not failed:
            where = self._folder / (self._name + LOG)
            self._write(f"recorder: {where} not written: {failed}" if failed else f"recorded {where}")
        self._said, self._child = failed, None

    def close(self, now_us: int) -> None:
        """The daemon ends: what is asked for or begun is written now, within EXIT_S."""
        if self._asked and self._pending is None:
            self._pending = ("asked", now_us)
        end = time.monotonic() + EXIT_S
        if self._child is not None:
            self._report(self._child.wait(EXIT_S if self._pending is None else EXIT_S / 2))
        if self._pending is not None:
            self._dump(urgent=True)
            if self._child is not None:
                self._report(self._child.wait(end - time.monotonic()))
        self._ring.close()


def make_recorder(core: Core, channel: str, write: Callable[[str], None]) -> Recorder | None:
    """The recorder that the core's configuration asks for, if any. That there is none stops no daemon."""
    config = core.config.recorder
    try:
        return Recorder(config, core, channel, write) if config.on else None
    except OSError as e:
        write(f"recorder: none: {e}")
        return None
