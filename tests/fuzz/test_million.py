"""A million corrupted frames among good ones, in one run on the virtual clock.

What CRC, counter, status and range let through, in a million: of frames of random bytes, 1 of 256 has the right CRC, 3
of 16 a counter that continues the chain, 2 of 16 a usable status (Ok or Degraded), and all are in range, as the fields
hold little more: 92. Flipped bits leave counter and status of a good frame usable the more often, the fewer there are;
up to two are always found by the CRC; of those of three and more, over 1 to all bits, 1/256 x 5.6 %: 219. Half of each
is 155; `corrupted.let_through` takes the sum from the DBC. What jumps or is absurd is refused beyond that. What is
accepted, about one in twelve thousand, may move a Valid estimate by no more than the frame says that it may be off.
"""

import math
import os
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import pytest

from tests.fuzz.corrupted import START_US, bus, let_through
from tests.support.can_ids import ADHESION
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.contract.frames import HALF_WIDTHS
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.reports import Outgoing

FRAMES = int(os.environ.get("FRAMES", 1_000_000))
PER_TICK = 40  # corrupted ones; good ones are ten on average
NO_NUMBER = 0xFFFE
VALID = 1
MAX_REFUSED = 2  # cycles of a signal, after one corrupted frame that was accepted


@dataclass(slots=True)
class Seen:
    """What the run showed."""

    corrupted: int = 0
    accepted: int = 0  # of the corrupted ones
    accepted_ids: Counter[int] = field(default_factory=Counter)
    good: int = 0
    refused_good: int = 0
    longest: int = 0  # good frames of one message refused in a row after a corrupted one was accepted
    longest_any: int = 0  # the same whatever went before
    change_pp: float = 0.0
    change_at: str = ""
    change_share: float = 0.0  # of two Valid estimates, of the Confidence of the less sure one
    lost_slots: int = 0  # with a number in the run without corrupted frames only
    slots: int = 0


class CounterLog:
    """Follows both runs: with the corrupted frames, and without them."""

    def __init__(self, config: Config) -> None:
        self.core, self.clean = Core(config), Core(config)
        self.seen = Seen()
        self._adhesion = {m.frame_id for m in config.database.messages if m.name.startswith("Adhesion_A")}
        self._run: Counter[int] = Counter()  # of refused good frames, by id
        self._after_accepted: dict[int, bool] = {}
        self._numbers: dict[tuple[int, int], tuple[int, float]] = {}  # MuAvailable, and its half-width when Valid

    def feed(self, frame: Frame, good: bool) -> None:
        before = self.core.counts.accepted
        self._check(self.core.feed(frame))
        taken = self.core.counts.accepted > before
        s, i = self.seen, frame.can_id
        if not good:
            s.corrupted += 1
            if taken:
                s.accepted += 1
                s.accepted_ids[i] += 1
                self._after_accepted[i] = True
            return
        s.good += 1
        self._compare(self.clean.feed(frame))
        if taken:
            self._run[i], self._after_accepted[i] = 0, False
            return
        s.refused_good += 1
        self._run[i] += 1
        s.longest_any = max(s.longest_any, self._run[i])
        if self._after_accepted.get(i):
            s.longest = max(s.longest, self._run[i])

    def _check(self, out: Sequence[Outgoing]) -> None:
        for o in out:
            if o.frame.can_id in self._adhesion:
                validity, mu = _read(o.frame)
                assert mu <= 10_000 or mu >= NO_NUMBER
                assert validity != VALID or mu <= 10_000
                within_pp = _within_pp(self.core, o.frame) if validity == VALID else math.nan
                self._numbers[o.frame.can_id, o.frame.stamp_us] = mu, within_pp
        for report in self.core.reports:
            assert all(math.isfinite(x) for x in (report.mu_available_pct or 0.0, report.mu_used_pct or 0.0))

    def _compare(self, out: Sequence[Outgoing]) -> None:
        """The clean run's frames with those of the other, which come first or with the same frame."""
        s = self.seen
        for o in out:
            if o.frame.can_id not in self._adhesion:
                continue
            mu, within_pp = self._numbers.pop((o.frame.can_id, o.frame.stamp_us))
            validity, clean = _read(o.frame)
            s.slots += clean < NO_NUMBER
            if clean < NO_NUMBER <= mu:
                s.lost_slots += 1
            elif clean < NO_NUMBER:
                change_pp = abs(mu - clean) * 0.01
                if validity == VALID and math.isfinite(within_pp):
                    s.change_share = max(s.change_share, change_pp / max(within_pp, _within_pp(self.clean, o.frame)))
                if change_pp > s.change_pp:
                    s.change_pp = change_pp
                    s.change_at = f"id {o.frame.can_id:03X} at {(o.frame.stamp_us - START_US) * 1e-6:.2f} s"


def _within_pp(core: Core, frame: Frame) -> float:
    """What the newest frame of the axle says of itself."""
    return HALF_WIDTHS[core.reports[frame.can_id - ADHESION[1]].confidence]


def _read(frame: Frame) -> tuple[int, int]:
    """Validity and MuAvailable, raw."""
    return frame.data[1] >> 4, int(struct.unpack_from("<H", frame.data, 2)[0])


@pytest.mark.night
def test_million_corrupted_frames_let_through_no_more_than_expected(capsys: pytest.CaptureFixture[str]) -> None:
    config = load_config(None)
    watch = CounterLog(config)
    for tick in bus(FRAMES, PER_TICK, seed=1):
        for arrived in tick:
            watch.feed(arrived.frame, arrived.good)
    s, counts = watch.seen, watch.core.counts
    share = let_through(config.database)
    with capsys.disabled():
        print(
            f"\n{s.corrupted} corrupted among {s.good} good frames: {s.accepted} accepted, "
            f"{1e6 * s.accepted / s.corrupted:.0f} in a million (E2E, status and range let {1e6 * share:.0f} through)\n"
            f"rejected: {counts.rejections}; axles started anew: {counts.restarts}\n"
            f"largest change of MuAvailable: {s.change_pp:.2f} percentage points ({s.change_at or 'none'}), of a Valid "
            f"one {s.change_share:.2f} of what its Confidence allows; slots "
            f"without a number that have one in the run without corrupted frames: {s.lost_slots} of {s.slots}\n"
            f"good frames refused: {s.refused_good}, in a row after an accepted corrupted one at most {s.longest}, "
            f"otherwise {s.longest_any}"
        )
    assert s.corrupted == FRAMES
    assert counts.accepted + counts.rejected.total() == s.corrupted + s.good
    expected = share * s.corrupted
    assert 0 < s.accepted <= expected + 4 * math.sqrt(expected)
    assert s.slots > 0
    assert 0.0 < s.change_share < 1.0
    assert s.longest <= MAX_REFUSED
