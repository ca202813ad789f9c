"""Plays frames slot by slot, and judges what the consumer used meanwhile."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from wrcd.bus.frame import Frame
from wrcd.contract.benches import PATIENCE_US, POLL_US, Bench
from wrcd.contract.consumers import ConsumerError
from wrcd.contract.frames import BASE, FrameMaker, Says

TOLERANCE_PCT = 0.5
RAMP_US = 3_000_000  # from the first good frame on: until it is used again, and until a limit has risen to its end
TICK_US = 100  # before the time-out and after it


class BrokenRule(Exception):
    """The consumer has not done what the contract says: what was played, what it must use, what it used."""

    def __init__(self, played: str, must: str, used: str) -> None:
        super().__init__(f"{played}: the consumer must {must}, but it {used}")


class CannotPlay(Exception):
    """The configuration's messages cannot say what a check plays."""


@dataclass(frozen=True, slots=True)
class PlayedFrame:
    """A frame of a slot, so long after the slot's begin. foul: a consumer must not use it."""

    frame: Frame
    offset_us: int = 0
    foul: bool = False


Script = Callable[[int, int], Sequence[PlayedFrame]]  # number of the slot within the stretch, its counter


@dataclass(slots=True)
class Seen:
    """What happened in a stretch: when its first frame left (or should have), and the limits used."""

    begun_us: int
    uses: list[tuple[int, float | None]] = field(default_factory=list)  # in time
    foul_us: list[int] = field(default_factory=list)  # when frames left that must not be used

    def after(self, us: int) -> list[tuple[int, float | None]]:
        """The limits used later than so long after the begin."""
        return [(t, limit) for t, limit in self.uses if t >= self.begun_us + us]


class ContractPlayer:
    """Plays one axle's frames to a consumer. Every judging method raises BrokenRule."""

    def __init__(self, bench: Bench, maker: FrameMaker, max_age_ms: int, other: FrameMaker | None = None) -> None:
        """max_age_ms: the SampleAge that the consumer bears; other: another axle's frames."""
        self.bench, self.maker, self.max_age_ms, self.other = bench, maker, max_age_ms, other
        self._cycle_us = maker.cycle_us
        self._next = bench.now_us() // self._cycle_us + 1  # slot
        self._last_us = bench.now_us()  # when the newest frame left

    def run(self, duration_us: int, script: Script) -> Seen:
        """Play a script for so many slots. A slot for which the player comes too late is left out, as the daemon does;
        the stretch then takes longer."""
        seen: Seen | None = None
        for n in range(max(1, round(duration_us / self._cycle_us))):
            slot = max(self._next, self.bench.now_us() // self._cycle_us)
            for sent in script(n, slot):
                self._until(slot * self._cycle_us + sent.offset_us, seen)
                self.bench.send(sent.frame)
                self._last_us = self.bench.now_us()
                seen = seen or Seen(self._last_us)
                if sent.foul:
                    seen.foul_us.append(self._last_us)
                self._look(seen)
            self._next = slot + 1
            seen = seen or Seen(slot * self._cycle_us)
            self._until((slot + 1) * self._cycle_us, seen)
        assert seen is not None
        return seen

    @property
    def slot(self) -> int:
        """The newest slot's number: what its frame's counter was made of."""
        return self._next - 1

    def play(self, says: Says, duration_us: int, foul: bool = False) -> Seen:
        """Play good frames that say one thing. foul: they must change nothing."""
        return self.run(duration_us, lambda n, slot: [PlayedFrame(self.maker.frame(slot, says), foul=foul)])

    def hold(self, says: Says, foul: bool = False) -> Seen:
        """Play them for as long as it takes to judge."""
        return self.play(says, self.hold_us, foul)

    @property
    def hold_us(self) -> int:
        """A stretch that ends a moment after the guard."""
        return self.bench.guard_us + max(3 * POLL_US, 2 * self._cycle_us)

    def silence(self, duration_us: int) -> Seen:
        """Send nothing; the stretch begins with the newest frame."""
        seen = Seen(self._last_us)
        self._until(self._last_us + duration_us, seen)
        self._look(seen)
        self._next = self.bench.now_us() // self._cycle_us + 1
        return seen

    def _until(self, end_us: int, seen: Seen | None) -> None:
        """Let time pass and look at the consumer meanwhile, but not at the end."""
        while (now_us := self.bench.now_us()) < end_us:
            self.bench.wait(min(end_us, now_us + POLL_US))
            if seen is not None and self.bench.now_us() < end_us:
                self._look(seen)

    def _look(self, seen: Seen) -> None:
        limit = self.bench.use(self.maker.number).limit_pct
        if limit is not None and not math.isfinite(limit):
            raise ConsumerError(f"the consumer used {limit} %, which is no number")
        seen.uses.append((self.bench.now_us(), limit))

    def settle(self, says: Says = BASE) -> float:
        """Play good frames until the consumer uses them. Returns the limit that it uses."""
        begun_us, lower = self.bench.now_us(), self.maker.lower_end(says)
        patience_us, used_us = self.bench.patience_us, 0
        while True:
            now_us, limit = self.play(says, 2 * self._cycle_us).uses[-1]
            if limit is not None:
                self.bench.patience_us = PATIENCE_US
                used_us = used_us or now_us
                if limit >= lower - TOLERANCE_PCT or now_us - used_us > RAMP_US + self.bench.guard_us:
                    return limit
            elif now_us - begun_us > patience_us:
                self.bench.patience_us = PATIENCE_US
                must = f"use a Valid frame, at most {lower:.1f} %"
                raise BrokenRule(f"{says} for {patience_us / 1e6:g} s", must, "fell back")

    def must_reach(self, says: Says) -> None:
        """Play good frames: what is used comes to the interval's lower end within three seconds. Without it every "at
        most" would be kept by a consumer that counts in another unit. Whether the half-width is taken off is another
        rule: up to MuAvailable passes."""
        lower, limit = self.maker.lower_end(says), self.settle(says)
        highest = self.maker.lower_end(says, whole=True)
        if not lower - TOLERANCE_PCT <= limit <= highest + TOLERANCE_PCT:
            played = f"{says} for {RAMP_US / 1e6:g} s"
            raise BrokenRule(played, f"come to {lower:.1f} %", f"used {limit:.4g} %: is the unit percent?")

    def must_hold_until_the_time_out(self) -> None:
        """Judge the silence after a good frame to a tenth of a millisecond, where nothing is late but the consumer."""
        played, timeout_us = "silence after a good frame", self.maker.timeout_us
        for t_us, limit in self.silence(timeout_us - TICK_US).uses:
            if limit is None:
                when = _time(t_us - self._last_us)
                raise BrokenRule(played, f"go on using it for {_time(timeout_us)}", f"fell back {when} later")
        limit = self.silence(timeout_us + TICK_US).uses[-1][1]
        if limit is not None:
            used = f"used {limit:.1f} % {TICK_US / 1000:g} ms after that"
            raise BrokenRule(played, f"fall back after {_time(timeout_us)}", used)

    def must_fall_back(self, seen: Seen, played: str, after_us: int = 0) -> None:
        """Judge a stretch: from then on, and past the guard, it falls back."""
        when = f"after {_time(after_us)}" if after_us else "at once"
        for t_us, limit in seen.after(after_us + self.bench.guard_us):
            if limit is not None:
                raise BrokenRule(played, f"fall back {when}", f"used {limit:.1f} % {_time(t_us - seen.begun_us)} later")

    def must_return(self, played: str, says: Says = BASE) -> None:
        """Play good frames: they are used again within three seconds."""
        lower, begun_us = self.maker.lower_end(says), self.bench.now_us()
        while True:
            seen = self.play(says, 2 * self._cycle_us)
            if any(limit is not None for _, limit in seen.uses):
                return
            if self.bench.now_us() - begun_us > RAMP_US + self.bench.guard_us:
                must = f"use it again, at most {lower:.1f} %"
                raise BrokenRule(f"{says} for {RAMP_US / 1e6:g} s {played}", must, "fell back")

    def must_be_at_most(self, seen: Seen, percent: float, played: str, must: str = "") -> None:
        """Judge a stretch: past the guard it uses no more, and no less than zero."""
        for t_us, limit in seen.after(self.bench.guard_us):
            if limit is not None and not -TOLERANCE_PCT <= limit <= percent + TOLERANCE_PCT:
                used = f"used {limit:.1f} % {_time(t_us - seen.begun_us)} later"
                raise BrokenRule(played, must or f"use at most {percent:.1f} %", used)

    def must_use(self, seen: Seen, played: str) -> None:
        """Judge a stretch: it does not fall back; on a bus only not all the time."""
        late = [limit for _, limit in seen.after(self.bench.guard_us)]
        if late and (None in late if self.bench.strict else not any(limit is not None for limit in late)):
            raise BrokenRule(played, "go on using it", "fell back")

    def must_ignore(self, seen: Seen, before: float, played: str, at_least: int = 1, says: Says = BASE) -> None:
        """Judge a stretch of good frames with foul ones between: none of these changes what is used; falling back is no
        fault. before: the limit used before.

        at_least: so many of them must have been used. On a bus a consumer that was late may rightly take a frame for a
        new sequence's: one is no proof there.
        """
        lower = self.maker.lower_end(says)
        lowest, highest = min(before, lower), max(before, lower)
        used: list[float] = []
        for begin_us, end_us in itertools.pairwise([*seen.foul_us, seen.uses[-1][0] + 1]):
            limits = [limit for t, limit in seen.uses if begin_us <= t < end_us and limit is not None]
            if limits and min(limits) < lowest - TOLERANCE_PCT:
                lowest = min(limits)
                used.append(lowest)
            elif limits and max(limits) > highest + TOLERANCE_PCT:
                used.append(max(limits))
        if len(used) >= (1 if self.bench.strict else at_least):
            must = f"drop them and go on with at most {highest:.1f} %, or fall back"
            values = dict.fromkeys(f"{u:.1f} %" for u in used)
            raise BrokenRule(played, must, f"used {' and '.join(values)}")

    def need(self, possible: bool, what: str) -> None:
        """Raise CannotPlay, where the messages cannot say what is to be played."""
        if not possible:
            raise CannotPlay(f"{self.maker.name} {what}")


def _time(us: int) -> str:
    return f"{us / 1000:.0f} ms" if us < 1_000_000 else f"{us / 1e6:.1f} s"
