"""Any sequence of good frames, bad frames, gaps and steps of time leaves the core sound.

The window is a little more than a tenth of a second here: a sequence of a few steps reaches Valid and loses it again.
"""

import bisect
import struct
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import replace

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from tests.fuzz.strategies import near_frames
from tests.support.can_ids import ADHESION, ADHESION_A1, LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED, YAW_RATE_A1
from tests.support.sensor_simulator import SensorSimulator
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.core.reading import Receiver
from wrcd.core.reports import Outgoing

WINDOW_US, TICK_US, SLOT_US = 120_000, 5_000, 20_000
BRIDGED_TICKS = 8  # past a time-out
_DEFAULT = load_config(None)
CONFIG = replace(_DEFAULT, design=replace(_DEFAULT.design, window_s=WINDOW_US * 1e-6, recent_s=0.05))
LENGTHS = {
    m.frame_id: m.length
    for m in CONFIG.database.messages
    if m.frame_id in Receiver(CONFIG.database, [i.source for i in CONFIG.inputs]).mapped.keys
}
# of what axle 1 needs
TIMEOUTS_US = {YAW_RATE_A1: 15_000, LAT_ACCEL_A1: 15_000, TORQUE_A1: 30_000, VEHICLE_SPEED: 60_000}
VALID, NO_NUMBER = 1, 0xFFFE


class Day(RuleBasedStateMachine):
    """One axle's good frames and all that can happen to them."""

    @initialize()
    def start(self) -> None:
        self.sim = SensorSimulator(CONFIG)
        self.core = self.sim.core
        self.fed = 0
        self.newest_us = self.sim.t  # furthest that time has come since it last stepped back
        self.passed_us = 0  # by how much time has moved on, in all
        self.steps_back = 0
        self.slots: Counter[int] = Counter()  # Adhesion frames by id
        # when accepted frames of axle 1 came, since the last step of time, newest last
        self.came: dict[int, deque[int]] = {i: deque(maxlen=200) for i in TIMEOUTS_US}

    # what happens

    @rule(ms=st.integers(1, 60).map(lambda n: 5 * n), silent=st.sets(st.sampled_from(sorted(TIMEOUTS_US)), max_size=2))
    def good_frames(self, ms: int, silent: set[int]) -> None:
        self.sim.silent = silent
        for _ in range(ms // 5):
            for frame in self.sim.frames():
                self.feed(frame)
        self.sim.silent = set()

    @rule()
    def a_whole_window(self) -> None:
        self.good_frames(2 * WINDOW_US // 1000, set())

    @rule(frames=st.lists(near_frames(LENGTHS), min_size=1, max_size=8), late_us=st.integers(-12_000, 5_000))
    def bad_frames(self, frames: list[Frame], late_us: int) -> None:
        for frame in frames:
            self.feed(replace(frame, stamp_us=self.sim.t + late_us))

    @rule(frame=near_frames(LENGTHS))
    def a_frame_of_any_time(self, frame: Frame) -> None:
        self.feed(frame)

    @rule(bits=st.sets(st.integers(0, 31), min_size=1))
    def flipped_bits(self, bits: set[int]) -> None:
        for good in self.sim.frames():
            data = int.from_bytes(good.data, "big")
            for bit in bits:
                data ^= 1 << bit
            self.feed(replace(good, data=data.to_bytes(len(good.data), "big")))

    @rule(signal=st.sampled_from((YAW_RATE_A1, LAT_ACCEL_A1, TORQUE_A1)), value=st.integers(-(1 << 23), (1 << 23) - 1))
    def an_absurd_value(self, signal: int, value: int) -> None:
        for good in self.sim.frames():
            payload = struct.pack("<i", value)[:3] if good.can_id == signal else good.data[2:]
            self.feed(replace(good, data=protect(good.data[:2] + payload, good.can_id, good.data[1] & 0x0F)))

    @rule(
        speed=st.sampled_from((0.0, 2.0, 25.0, 25.5, 61.0, 160.0)), torque=st.sampled_from((0.0, 1e4, -1e4, 8e4)),
        status=st.sampled_from((0, 1, 14)),
    )  # fmt: skip
    def another_drive(self, speed: float, torque: float, status: int) -> None:
        self.sim.speed, self.sim.torque, self.sim.yaw_status = speed, torque, status

    @rule(
        us=st.sampled_from((-3_600_000_000, -50_000, -9_000, 3_000, 80_000, 999_000, 1_001_000, 59_000_000, 61_000_000))
    )
    def the_clock_steps(self, us: int) -> None:
        self.sim.t += us

    @rule(us=st.integers(-20_000, 2_000_000))
    def time_goes_on(self, us: int) -> None:
        """Nothing has come, and the loop says how late it is."""
        self.sim.t = max(self.sim.t + us, self.sim.t)
        self.out(self.core.advance(self.sim.t), self.sim.t)

    @precondition(lambda self: self.core.counts.accepted > 0)
    @rule()
    def the_end_and_on(self) -> None:
        assert all(data[1] >> 4 == 0 for data in (f.data for f in self.core.shutdown_frames(self.sim.t)[:4]))

    # what must hold

    def feed(self, frame: Frame) -> None:
        accepted, steps = self.core.counts.accepted, self.core.counts.time_steps
        out = self.core.feed(frame)
        self.fed += 1
        self.out(out, frame.stamp_us)  # what was due before the step, if there was one
        if self.core.counts.time_steps > steps:
            for stamps in self.came.values():
                stamps.clear()
        if self.core.counts.accepted > accepted and frame.can_id in self.came:
            self.came[frame.can_id].append(frame.stamp_us)

    def out(self, out: Sequence[Outgoing], now_us: int) -> None:
        """Judge what was sent up to a time."""
        self.passed_us += max(now_us - self.newest_us, 0)
        if now_us < self.newest_us - 10_000:
            self.steps_back += 1
            self.newest_us = now_us
        self.newest_us = max(self.newest_us, now_us)
        seen = set()
        for o in out:
            if o.frame.can_id not in ADHESION.values():
                continue
            self.slots[o.frame.can_id] += 1
            place = o.frame.can_id, o.frame.stamp_us // SLOT_US
            assert place not in seen
            seen.add(place)
            assert o.frame.stamp_us <= now_us
            validity, mu = o.frame.data[1] >> 4, struct.unpack_from("<H", o.frame.data, 2)[0]
            assert mu <= 10_000 or mu >= NO_NUMBER
            if validity == VALID:
                assert mu <= 10_000
                assert o.frame.can_id == ADHESION_A1
                self.a_full_window_before(o.frame.stamp_us)

    def a_full_window_before(self, end_us: int) -> None:
        """At every tick's end of a window, each signal of axle 1 had come within its time-out, or so little past it
        that it was bridged; at the window's own end there is nothing to bridge."""
        for can_id, timeout_us in TIMEOUTS_US.items():
            stamps = sorted(self.came[can_id])
            for tick_us in range(end_us - WINDOW_US + TICK_US, end_us + 1, TICK_US):
                before = bisect.bisect_right(stamps, tick_us)
                assert before, f"{can_id:03X} had not come"
                bridged_us = 0 if tick_us == end_us else BRIDGED_TICKS * TICK_US
                assert tick_us - stamps[before - 1] <= timeout_us + bridged_us, f"{can_id:03X} was too old"

    @invariant()
    def counts_balance(self) -> None:
        assert self.core.counts.accepted + self.core.counts.rejected.total() == self.fed

    @invariant()
    def no_more_frames_than_slots(self) -> None:
        for count in self.slots.values():
            assert count <= self.passed_us // SLOT_US + 1 + self.steps_back

    @invariant()
    def what_is_known_is_finite(self) -> None:
        for report in self.core.reports:
            for x in (report.mu_available_pct, report.mu_used_pct):
                assert x is None or 0 <= x <= 100


TestDay = Day.TestCase
# A tenth of the examples of a plain property, each of up to 25 steps.
TestDay.settings = settings(max_examples=max(settings().max_examples // 10, 50), stateful_step_count=25)
