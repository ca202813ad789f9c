"""What tests/hil/vcan.sh has recorded of a daemon, and what a core on this computer makes of the same bus."""

import re
from collections.abc import Iterator, Sequence
from functools import cache, cached_property

import pytest

from sim_ecu.play.encoder import databases
from tests.support.can_ids import ADHESION_A1, WRCD_LINK, WRCD_STATUS
from tests.support.processes import ROOT
from wrcd.bus.candump import parse_line
from wrcd.bus.e2e import crc
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.core.core import Core
from wrcd.core.reports import Outgoing
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.service.journal import sent_messages

RECORDED, PLAYED = ROOT / "build/hil/vcan", ROOT / "build/hil/play"
NOT_AVAILABLE, VALID = 0, 1
# by name: the configuration, and a log that somebody else has sent under the daemon's ids
EPISODES: dict[str, tuple[str | None, str | None]] = {
    "axles": ("recorded.toml", None), "six": ("six.toml", None), "faults": (None, None), "flood": (None, None),
    "lost": (None, None), "link": (None, None), "errors": (None, "foreign"), "fd": ("fd.toml", None),
    "busoff": (None, None),
}  # fmt: skip
OF_ITSELF = {WRCD_STATUS, WRCD_LINK}  # what the daemon tells of itself, and no core knows
SILENT_US = 50_000  # so long without an input it was the clock that closed the ticks
END_US = 1 << 62
# Stamps that jump by more tell of a clock that was set, where it was: slots may come again, and a frame that was made
# before may leave after it. No pause is longer than the other.
JUMP_US, PAUSE_US = 300_000, 60_000_000
SETTLED_US = 10_000  # half of Adhesion's cycle: one turn of a loop
COUNTER_TURN = 15  # slots with another counter each
HELD_UP_TURNS = 10  # of a counter, 3 s of Adhesion's: so long may a loop stand still that is about to send
# a message's id, the number of the cycle that a frame was made for, how often the clock was set before
Slot = tuple[int, int, int]


@cache
def played(name: str) -> list[Frame]:
    """A log that was played."""
    return [f for f, _ in read_log(PLAYED / f"{name}.log", Damage())]


def slot_of(f: Frame, cycle_us: int = 20_000) -> int:
    """The cycle that a protected frame was made for: its counter tells, should it have left late."""
    ahead = f.stamp_us // cycle_us + 1  # a daemon that stops is one ahead
    return ahead - (ahead - (f.data[1] & 0x0F)) % COUNTER_TURN


def validity(f: Frame) -> int:
    """Of an Adhesion frame."""
    return f.data[1] >> 4


class Episode:
    """One of the script's."""

    def __init__(self, name: str) -> None:
        configuration, foreign = EPISODES[name]
        self.name, self._folder = name, RECORDED / name
        self.config = load_config(PLAYED / configuration if configuration else None)
        outputs = [o for a in self.config.axles for o in (a.adhesion, a.detail, a.inputs)]
        outputs += [self.config.status, self.config.rejects, self.config.link]
        cycles = {o.message: o.cycle_us for o in outputs if o is not None}
        self.cycles_us = {key: cycles[name] for key, name in sent_messages(self.config).items()}
        self._protected = self.config.status is not None  # by CRC and counter, as the packaged DBC has it
        self._foreign = {(f.can_id, f.data) for f in (played(foreign) if foreign else ())}

    def read(self, file: str) -> str:
        """Of a file in its folder."""
        return (self._folder / file).read_text()

    @cached_property
    def marks(self) -> list[tuple[str, int]]:
        """What the script did, and when (µs)."""
        lines = (line.rpartition(" ") for line in self.read("marks").splitlines())
        return [(what, round(float(at) * 1e6)) for what, _, at in lines]

    def mark(self, what: str) -> int:
        """When it did that for the first time (µs)."""
        return next(at for name, at in self.marks if name == what)

    @cached_property
    def said(self) -> str:
        return self.read("said")

    def counted(self, what: str) -> int:
        """What lines of the daemon's count, in all: `what` has one group."""
        return sum(map(int, re.findall(what, self.said)))

    @cached_property
    def frames(self) -> list[Frame]:
        """What was on the bus while the daemon was, in candump's order."""
        found = map(parse_line, (self._folder / "bus.log").read_bytes().splitlines())
        frames = [f[0] for f in found if f is not None]
        end = max(k for k, f in enumerate(frames) if self.is_own(f))
        return frames[: end + 1]

    def is_own(self, f: Frame) -> bool:
        """Whether the daemon has sent a frame."""
        if f.key not in self.cycles_us or f.error or f.remote or (f.can_id, f.data) in self._foreign:
            return False
        return not self._protected or (len(f.data) == 8 and crc(f.data, f.can_id) == f.data[0])

    def slot_of(self, f: Frame) -> int:
        """The cycle that a frame of the daemon's was made for; without a counter the one that it was sent in."""
        cycle_us = self.cycles_us[f.key]
        return slot_of(f, cycle_us) if self._protected else f.stamp_us // cycle_us

    def times_set(self, frames: Sequence[Frame]) -> Iterator[tuple[int, Frame]]:
        """Each of these frames, and how often the clock was set before it."""
        is_set, times, before_us = any(what.startswith("stepped") for what, _ in self.marks), 0, frames[0].stamp_us
        for f in frames:
            times += is_set and abs(f.stamp_us - before_us) > JUMP_US
            before_us = f.stamp_us
            yield times, f

    @cached_property
    def sent(self) -> list[tuple[Slot, Frame]]:
        """The daemon's frames but for the last of each message, which say that it stops."""
        every, newest = list[tuple[Slot, Frame]](), dict[int, tuple[Slot, Frame]]()  # of each message
        for times, f in self.times_set(self.frames):
            if self.is_own(f):
                newest[f.can_id] = self._made_for(f, times, newest.get(f.can_id)), f
                every.append(newest[f.can_id])
        return every[: -len(self.last)]

    def _made_for(self, f: Frame, times: int, last: tuple[Slot, Frame] | None) -> Slot:
        """The slot of a frame of the daemon's; last: the message's one before it. Where the loop stood still between
        its look at the clock, in the slot, and the line, for longer than a counter's turn, it is the slot of a turn
        before of which a core makes these bytes. Nothing has left since: a daemon that is always late does not stand
        still. Nor is it the slot of the last one, whose bytes may be the same."""
        newest = (f.can_id, self.slot_of(f), times)
        if last is None or not self._protected or f.can_id in OF_ITSELF or self.replayed.data.get(newest) == f.data:
            return newest
        turns = (newest[1] - COUNTER_TURN * k for k in range(1, HELD_UP_TURNS + 1))
        free = (n for n in turns if last[1].stamp_us < (n + 1) * self.cycles_us[f.key])
        before = (slot for n in free if (slot := (f.can_id, n, times)) != last[0])
        return next((slot for slot in before if self.replayed.data.get(slot) == f.data), newest)

    @cached_property
    def last(self) -> list[Frame]:
        """The frames that say that it stops: Adhesion of every axle, and WrcdStatus."""
        own = [f for f in self.frames if self.is_own(f)]
        return own[-len(self.config.axles) - (self.config.status is not None) :]

    @cached_property
    def settled(self) -> list[tuple[Slot, Frame]]:
        """What was sent, but what a loop that stood still had made before the clock was set, with counters of slots
        that are still to come. It leaves in the moment after that; or later, where the loop stood still again, before
        all that it makes by the new clock: frames as a core makes them of their slot by the clock of before."""
        since_us: dict[int, int] = {0: -END_US}
        newest, begun = dict[tuple[int, int], int](), {0}  # slots by message; when the clock was set so often
        out = []
        for (can_id, slot, times), f in self.sent:
            before = newest.get((can_id, times - 1), slot)
            of_before = (can_id, before + 1 + (slot - before - 1) % COUNTER_TURN, times - 1)
            if f.stamp_us - since_us.setdefault(times, f.stamp_us) <= SETTLED_US:
                continue
            if times not in begun and (can_id in OF_ITSELF or self.replayed.data.get(of_before) == f.data):
                continue
            begun.add(times)
            newest[can_id, times] = slot
            out.append(((can_id, slot, times), f))
        return out

    @cached_property
    def slots(self) -> dict[tuple[int, int], list[int]]:
        """Of each message, after the clock was set so often, in the order in which they were sent."""
        out: dict[tuple[int, int], list[int]] = {}
        for (can_id, slot, times), _ in self.settled:
            out.setdefault((can_id, times), []).append(slot)
        return out

    def missing(self, since_us: int) -> list[int]:
        """How many frames of slots from a moment on were not sent, up to each slot that the daemon may have come to."""
        ends = range(self.slots[ADHESION_A1, 0][-1] + 1, slot_of(self.last[0]) + 1)
        return [self._missing(since_us, end * 20_000) for end in ends]

    def _missing(self, since_us: int, end_us: int) -> int:
        missing = 0
        for (can_id, _), slots in self.slots.items():
            cycle_us = self.cycles_us[can_id]
            first, end = -(-since_us // cycle_us), -(-end_us // cycle_us)
            missing += end - first - sum(s >= first for s in slots)
        return missing

    def of(self, can_id: int) -> list[Frame]:
        """A message's frames among those that were sent."""
        return [f for (i, _, _), f in self.sent if i == can_id]

    def told(self, can_id: int, signal: str, since_us: int = 0) -> int:
        """What the last frame of a message says, as a number; or the first after a moment."""
        frames = self.of(can_id)
        frame = next((f for f in frames if f.stamp_us >= since_us), None) if since_us else frames[-1]
        assert frame is not None
        values = databases()[0].decode_message(can_id, frame.data, decode_choices=False)
        assert isinstance(values, dict)
        return int(str(values[signal]))

    @cached_property
    def inputs(self) -> list[Frame]:
        """What the daemon must have received of the bus."""
        keys, fd = self.replayed.core.mapped.keys, self.replayed.core.mapped.fd
        return [f for f in self.frames if f.key in keys and not f.error and (fd or not f.fd)]

    def between(self, begin: str, end: str) -> list[Frame]:
        """Adhesion_A1 from one mark to another."""
        return [f for f in self.of(ADHESION_A1) if self.mark(begin) <= f.stamp_us <= self.mark(end)]

    @cached_property
    def replayed(self) -> "Replayed":
        return Replayed(self, self.frames)


@cache
def recorded(name: str) -> Episode:
    """An episode. Fails where the script has not come to its end, and says how far it came."""
    if not (RECORDED / "done").exists():
        marks = sorted(RECORDED.glob("*/marks"), key=lambda p: p.stat().st_mtime)
        last = f"{marks[-1].parent.name}: {marks[-1].read_text().splitlines()[-1]}" if marks else "nothing"
        pytest.fail(f"the recording is not whole, `make hil` makes one; the last of it: {last}", pytrace=False)
    return Episode(name)


class Replayed:
    """What a core makes of frames of an episode: those that it sends by their slot, and its counts. The daemon's own
    frames tell it when the clock has closed a tick without an input."""

    def __init__(self, episode: Episode, frames: Sequence[Frame]) -> None:
        self.core = Core(episode.config)
        self.data: dict[Slot, bytes] = {}
        keys, ahead_us, coming = self.core.mapped.keys, END_US, list[int]()  # when the next input is to come
        for f in reversed(frames):
            coming.append(ahead_us)
            ahead_us = f.stamp_us if f.key in keys and not f.error else ahead_us
        for (times, f), next_us in zip(episode.times_set(frames), reversed(coming), strict=True):
            if f.fd and not self.core.mapped.fd:
                continue  # its socket lets none in
            made: Sequence[Outgoing] = self._closed(episode, f, next_us) if episode.is_own(f) else self.core.feed(f)
            for o in made:
                self.data[o.frame.can_id, o.frame.stamp_us // o.cycle_us, times] = o.frame.data

    def _closed(self, episode: Episode, f: Frame, next_us: int) -> list[Outgoing]:
        cycle_us = episode.cycles_us[f.key]
        until_us = episode.slot_of(f) * cycle_us
        if cycle_us >= JUMP_US or max(until_us, next_us) - self.core.newest_us <= SILENT_US:
            return []
        since_us = self.core.time_us or until_us
        if 0 < since_us - until_us < JUMP_US:
            return []  # it has left late: the core is past it
        steps = range(since_us, until_us, SILENT_US) if until_us - since_us < PAUSE_US else ()  # else the clock was set
        return [o for at_us in (*steps, until_us) for o in self.core.advance(at_us)]
