"""What the machine gave in a run: a bare process beside the daemon wakes every 5 ms and notes how late it came, and how
long a little work then took.

Its real-time priority is just above the daemon's: a busy daemon cannot excuse itself by it. What is seen is what takes
the processor from both: a host that runs something else than the guest, or that runs it beside something else on the
other half of a core, at a part of its speed.
"""

import signal
import sys
import tempfile
import time
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise, takewhile
from pathlib import Path
from statistics import median

from tests.support.processes import running, wait_for

PERIOD_NS = 5_000_000
NOTED_NS = 500_000  # later than that is a stall: 3 % of the wake-ups in an idle guest
WORK = range(1_000)  # passes of an empty loop: 10 to 30 µs, 60 to 80 in the guest of a host that is slow
SLOW = 1.5  # times the run's median for that work, and more: slower, not noise
SLOT_US = 20_000
# A single slot may be excused where so much of the time up to its end was taken: 2.5 ms are in an idle guest, 8 ms at
# least before 25 slots that six axles skipped beside other work.
BEFORE_US, TAKEN_US = 100_000, 6_000
WINDOW_US = 2_000_000


@dataclass(frozen=True, slots=True)
class Stall:
    """A wake-up that was due at begin_us and came at end_us, of the clock that stamps frames; or as much of the time
    before one as a processor at its usual speed would not have needed."""

    begin_us: int
    end_us: int


@dataclass
class Machine:
    """The stalls of a run by their ends, known when the metronome has stopped."""

    stalls: list[Stall] = field(default_factory=list)

    def _touching(self, begin_us: int, end_us: int) -> Iterator[Stall]:
        first = bisect_right(self.stalls, begin_us, key=lambda s: s.end_us)  # of thousands, for thousands of slots
        return takewhile(lambda s: s.begin_us < end_us, (self.stalls[k] for k in range(first, len(self.stalls))))

    def taken_us(self, begin_us: int, end_us: int) -> int:
        """How much of a time was taken."""
        touching = self._touching(begin_us, end_us)
        return sum(min(s.end_us, end_us) - max(s.begin_us, begin_us) for s in touching)

    def excuses(self, slot: int) -> bool:
        """Whether the machine took so much up to a slot's end that it could not be kept."""
        end_us = (slot + 1) * SLOT_US
        return self.taken_us(end_us - BEFORE_US, end_us) >= TAKEN_US


def calm(stamps_us: Sequence[int], timeout_us: int) -> list[tuple[int, int]]:
    """The times in which a sensor's frames leave no reason not to be Valid: without silences that reach its time-out,
    and without the longest window after the first frame and after each silence."""
    out, begin_us = [], stamps_us[0] + WINDOW_US
    for before_us, stamp_us in pairwise(stamps_us):
        if stamp_us - before_us > timeout_us - 1000:  # a frame may be read by a tick before it is stamped
            out.append((begin_us, before_us))
            begin_us = stamp_us + WINDOW_US
    return [(a, b) for a, b in (*out, (begin_us, stamps_us[-1])) if a < b]


def within(stamp_us: int, times: Sequence[tuple[int, int]]) -> bool:
    """Whether a moment lies in one of these times."""
    return any(begin_us <= stamp_us <= end_us for begin_us, end_us in times)


def mostly(judged: Sequence[bool], share: float, begin_us: int, end_us: int, machine: Machine) -> bool:
    """Whether a share of what was judged, in the calm moments of a time, is as it must be. Nothing judged is right only
    where each whole window of the time has a slot that the machine excuses, and is said."""
    if judged:
        return sum(judged) >= share * len(judged)
    begins = range(begin_us, end_us - WINDOW_US + 1, WINDOW_US)
    explained = all(any(map(machine.excuses, range(b // SLOT_US, (b + WINDOW_US) // SLOT_US))) for b in begins)
    print(f"NOTHING JUDGED: no calm moment in {(end_us - begin_us) * 1e-6:.1f} s; explained by stalls: {explained}")
    return explained


@dataclass(frozen=True, slots=True)
class Cycle:
    """The slots of a time that were not sent, and how much of it the machine took."""

    wanted: int
    missing: list[int]
    taken_us: int
    slot_us: int

    def __str__(self) -> str:
        return (
            f"{len(self.missing)} of {self.wanted} slots missing; "
            f"the machine took {self.taken_us / 1000:.0f} ms of {self.wanted * self.slot_us / 1000:.0f}"
        )


def cycle(slots: Sequence[int], begin_us: int, end_us: int, machine: Machine, slot_us: int = SLOT_US) -> Cycle:
    """Compare the slots that were sent with those that lie in a time. Raises AssertionError where they do not rise."""
    assert list(slots) == sorted(set(slots)), "slots were sent twice or out of their order"
    wanted, sent = range(begin_us // slot_us + 1, end_us // slot_us), set(slots)
    return Cycle(len(wanted), [s for s in wanted if s not in sent], machine.taken_us(begin_us, end_us), slot_us)


@contextmanager
def metronome(above: int) -> Iterator[Machine]:
    """Run it above the daemon's real-time priority (0: it has none); the machine has the stalls after the block."""
    machine = Machine()
    with tempfile.TemporaryDirectory() as folder:
        noted = Path(folder) / "stalls"
        with running("chrt", "-f", str(above + 1), sys.executable, "-m", "tests.support.metronome", noted):
            wait_for("the metronome", 30, noted.exists)
            yield machine
        lines = [line.split() for line in noted.read_text().splitlines()]
    # not in their order where a test has stepped the clock
    machine.stalls += sorted((Stall(int(end) - int(late), int(end)) for end, late in lines), key=lambda s: s.end_us)


def note(path: Path) -> None:
    """Wake until SIGTERM, then write a line for each stall: when it ended, and how late that was, in µs."""
    stop: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _frame: stop.append(number))
    wakes: list[tuple[int, int, int]] = []
    path.touch()
    due_ns = time.monotonic_ns()
    while not stop:
        due_ns += PERIOD_NS
        time.sleep(max(0, due_ns - time.monotonic_ns()) * 1e-9)
        woke_ns = time.monotonic_ns()
        for _ in WORK:
            pass
        wakes.append((time.time_ns() // 1000, woke_ns - due_ns, time.monotonic_ns() - woke_ns))
        if woke_ns - due_ns > NOTED_NS:
            due_ns = woke_ns
    usual_ns = median(took for _, _, took in wakes) if wakes else 0
    path.write_text("".join(f"{end} {late // 1000}\n" for end, late in stalls(wakes, usual_ns)))


def stalls(wakes: Sequence[tuple[int, int, int]], usual_ns: float) -> list[tuple[int, int]]:
    """When each stall ended (µs), and its length (ns): of wake-ups with their time (µs), how late each was and how long
    its work took (ns), and how long it usually takes."""
    out = []
    for end_us, late_ns, took_ns in wakes:
        lost_ns = 0 if took_ns < SLOW * usual_ns else round(PERIOD_NS * (1 - usual_ns / took_ns))
        if late_ns > NOTED_NS or lost_ns:
            out.append((end_us, max(late_ns, lost_ns)))
    return out


if __name__ == "__main__":
    note(Path(sys.argv[1]))
