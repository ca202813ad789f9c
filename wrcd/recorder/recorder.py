"""The flight recorder: the last minute of frames in memory, written to a folder when something went wrong.

Beside the frames it keeps what the estimate had from before them: a snapshot of the core every few seconds. A dump
begins at the oldest snapshot whose frames are all still there, so that `wrcd replay` of it gives the very bytes that
were sent.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.core.causes import Validity
from wrcd.core.configuration import RecorderConfig
from wrcd.core.core import Core
from wrcd.core.counts import Health
from wrcd.core.events import COLUMNS, MAX_KEPT, csv_line
from wrcd.core.messages import Report
from wrcd.recorder.dump_folder import Bound, dump_name, safe_channel_name
from wrcd.recorder.resume import identity
from wrcd.recorder.ring import ADVANCED, CLASSICAL_BYTES, FD_BYTES, HEALTH, RECEIVED, SENT, Ring
from wrcd.recorder.state import capture, encode
from wrcd.recorder.writer import Child, Request, start

LOST_SLOTS = 5  # in a row without Valid: less is a hiccup
COLLAPSED_PCT = 15.0
COLLAPSED_SHARE = 0.5  # of what it was
REMEMBERED_US = 1_000_000


class Triggers:
    """Watches every axle, each with a slot of its own. Give it each slot's reports once."""

    def __init__(self, slots_us: Sequence[int]) -> None:
        self._was_valid = [False] * len(slots_us)
        self._lost = [0] * len(slots_us)  # slots in a row that were not Valid
        # percent, 0 where it was not Valid
        self._mu: list[deque[float]] = [deque([0.0], max(1, REMEMBERED_US // slot_us)) for slot_us in slots_us]

    def look(self, reports: Sequence[Report], below_min_speed: bool, axles: Sequence[int]) -> str:
        """ "validity" or "collapse" in the slot where it shows, else nothing. axles: whose slot it is. A train that
        stands is not Valid by right; one that is about to stand has lost nothing."""
        lost = collapsed = False
        for axle in axles:
            report = reports[axle]
            valid = report.validity is Validity.VALID
            if not report.short:
                lost |= self._loses(axle, valid, below_min_speed)
            mu = (report.mu_available_pct or 0.0) if valid else 0.0
            before = self._mu[axle]
            collapsed |= valid and mu < min(COLLAPSED_PCT, COLLAPSED_SHARE * max(before))
            before.append(mu)
        return "validity" if lost else "collapse" if collapsed else ""

    def _loses(self, axle: int, valid: bool, below_min_speed: bool) -> bool:
        if valid or below_min_speed:
            self._was_valid[axle], self._lost[axle] = valid, 0
            return False
        self._lost[axle] += self._was_valid[axle]
        if self._lost[axle] < LOST_SLOTS:
            return False
        self._was_valid[axle], self._lost[axle] = False, 0
        return True


# That the ring has room for. An axle of the packaged DBC makes 570 of them; a full bus of 500 kbit/s carries about 4000
# of eight bytes, one of 1 Mbit/s twice as many.
FRAMES_PER_S, AXLE_FRAMES_PER_S = 4000, 1000
SNAPSHOTS = 6  # within the ring's time
SPARE_SHARE = 0.1  # of the ring, may be overwritten before the process that writes a dump has copied it
POST_TRIGGER_US = 2_000_000  # is in the dump, too
HOLD_OFF_US = 30_000_000  # between two dumps that nobody asked for
EXIT_S = 3.0  # for the last dump; less than systemd's patience


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The core as it was when the ring's end was at position."""

    position: int
    at_us: int
    core: dict[str, Any]


class Recorder:
    """Told by the loop of all that comes, goes and happens; turn() between turns, when the core has all of it."""

    def __init__(self, config: RecorderConfig, core: Core, channel: str, write: Callable[[str], None]) -> None:
        if config.folder is None:
            raise ValueError("a recorder needs a folder")
        self._folder, self._core, self._write = config.folder, core, write
        self._bound = Bound(config.max_files, round(config.max_mb * 1e6))
        self._channel = safe_channel_name(channel)
        self._every_us = max(1, round(config.seconds * 1e6 / SNAPSHOTS))
        # dumps are of config.seconds at least: the oldest snapshot is up to one interval older than that
        frames_per_s = max(FRAMES_PER_S, AXLE_FRAMES_PER_S * len(core.config.axles))
        data_bytes = FD_BYTES if core.receiver.fd else CLASSICAL_BYTES
        self._ring = Ring(math.ceil(config.seconds * (1 + 1 / SNAPSHOTS) * frames_per_s), data_bytes)
        self._snapshots: deque[Snapshot] = deque(maxlen=SNAPSHOTS + 1)
        self._health = _copied(core.health)
        self._healths: deque[tuple[int, dict[str, Any]]] = deque()  # by position, from the oldest snapshot on: changes
        self._changes: deque[tuple[int, str]] = deque(maxlen=MAX_KEPT)  # of Validity, by position as rows
        self._changes_told = core.events.total
        self._fits = identity(core.config)
        self._triggers = Triggers([axle.adhesion.cycle_us for axle in core.config.axles])
        core.take_reports()  # from now on it is kept
        self._asked = False
        self._pending: tuple[str, int] | None = None  # trigger and its time, while the aftermath is awaited
        self._last_us: int | None = None  # of the newest dump that nobody asked for
        self._child: Child | None = None
        self._name = ""
        self._said = ""

    def received(self, frames: FrameBatch | Sequence[Frame]) -> None:
        """What the link handed over in this turn, before it is fed."""
        self._note_health()  # the link may have learnt of losses on the way
        self._ring.put_frames(RECEIVED, frames)

    def sent(self, frame: Frame) -> None:
        """A frame that went out."""
        self._ring.put_frame(SENT, frame)

    def advanced(self, now_us: int) -> None:
        """Time has come to now_us without a frame."""
        self._ring.put(ADVANCED, now_us)

    def ask(self) -> None:
        """A person wants a dump."""
        self._asked = True

    def turn(self, now_us: int) -> None:
        """A turn of the loop is over."""
        core = self._core
        self._note_health()
        if core.events.total != self._changes_told:
            self._note_changes()
        self._snapshot(now_us)
        for slot in core.take_reports():
            found = self._triggers.look(slot.reports, slot.below_min_speed, slot.adhesion)
            if found and self._pending is None and self._hold_off_over(now_us):
                self._pending, self._last_us = (found, now_us), now_us
        if self._asked and self._pending is None:
            self._asked, self._pending = False, ("asked", now_us)
        self.reap()
        if self._pending and self._child is None and not 0 <= now_us - self._pending[1] < POST_TRIGGER_US:
            name, self._pending = dump_name(self._channel, self._pending[1], self._pending[0]), None
            self._dump(name)

    def _note_health(self) -> None:
        """What the core reports of the loop and the link does not come from frames: a replay needs it."""
        health = self._core.health
        if health != self._health:
            self._health = _copied(health)
            self._healths.append((self._ring.end, capture(health)))
            self._ring.put(HEALTH, 0)

    def _note_changes(self) -> None:
        """Changes of Validity, behind the record that made them."""
        events = self._core.events
        self._changes.extend((self._ring.end, change.csv_line) for change in events.since(self._changes_told))
        self._changes_told = events.total

    def _hold_off_over(self, now_us: int) -> bool:
        # a clock that has stepped back holds nothing up
        return self._last_us is None or not 0 <= now_us - self._last_us < HOLD_OFF_US

    def _snapshot(self, now_us: int) -> None:
        ring, kept = self._ring, self._snapshots
        # by the ring's filling, too, so that the newest is never overwritten by a bus that carries more than it can
        if kept and 0 <= now_us - kept[-1].at_us < self._every_us and (
            ring.end - kept[-1].position < ring.records // (SNAPSHOTS + 1)
        ):  # fmt: skip
            return
        self._core.settle()
        kept.append(Snapshot(ring.end, now_us, capture(self._core)))
        while len(kept) > 1 and not ring.holds(kept[0].position):
            kept.popleft()
        while self._healths and self._healths[0][0] < kept[0].position:
            self._healths.popleft()
        while self._changes and self._changes[0][0] <= kept[0].position:
            self._changes.popleft()

    def _dump(self, name: str, urgent: bool = False) -> None:
        ring, self._name = self._ring, name
        spare = round(SPARE_SHARE * ring.records)
        first = next((s for s in self._snapshots if ring.holds(s.position, spare)), None)
        if first is None:  # not one turn
            return
        request = Request(
            folder=str(self._folder),
            name=name,
            channel=self._channel,
            position=first.position,
            end=ring.end,
            data_bytes=ring.data_bytes,
            fits=self._fits,
            core=encode(first.core),
            healths=[(position, health) for position, health in self._healths if position >= first.position],
            max_dumps=self._bound.dumps,
            max_bytes=self._bound.size,
            changes=csv_line(COLUMNS) + "".join(row for position, row in self._changes if position > first.position),
            urgent=urgent,
        )
        try:
            self._child = start(ring, request)
        except OSError as e:
            self._report(f"no process to write it: {e.strerror}")

    @property
    def pending_trigger(self) -> str | None:
        """The trigger whose dump waits for the frames after it, or None."""
        return self._pending and self._pending[0]

    @property
    def is_writing(self) -> bool:
        """Whether a process writes a dump."""
        return self._child is not None

    def reap(self) -> None:
        """Log the result of a dump whose process has ended."""
        if self._child is not None and (failed := self._child.finished()) is not None:
            self._child = None
            self._report(failed)

    def _report(self, failed: str) -> None:
        """One line for each dump, and one for a trouble however often it comes."""
        if failed != self._said or not failed:
            where = self._folder / (self._name + ".log")
            self._write(f"recorder: {where} not written: {failed}" if failed else f"recorded {where}")
        self._said = failed

    def close(self, now_us: int, alive: Callable[[], None] = lambda: None) -> None:
        """The daemon ends: a last dump, within EXIT_S. alive is called while it is written.

        A process writes this one, too: a disk that hangs could not be left alone otherwise.
        """
        end = time.monotonic() + EXIT_S
        if self._child is not None:
            self._report(self._child.wait(EXIT_S / 2, alive))
            self._child = None
        self._dump(dump_name(self._channel, now_us, "exit"), urgent=True)
        if self._child is not None:
            self._report(self._child.wait(end - time.monotonic(), alive))
            self._child = None
        self._ring.close()


def _copied(health: Health) -> Health:
    return replace(health, link=replace(health.link))


def make_recorder(core: Core, channel: str, write: Callable[[str], None]) -> Recorder | None:
    """The recorder that the core's configuration asks for, if any. That there is none stops no daemon."""
    config = core.config.recorder
    try:
        return Recorder(config, core, channel, write) if config.on else None
    except OSError as e:
        write(f"recorder: none: {e}")
        return None
