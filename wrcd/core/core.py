"""frame -> sample -> estimate -> adhesion and its Validity -> frame, on the frames' own time stamps.

The core reads no clock. Live, the loop tells it how far time has come (advance); in a replay the next frame does.
Tick k owns the frames stamped in [k P, (k + 1) P); of two measurements one may wait for the next tick
(input_buffers.py), of every other signal the newest counts. Frames of a slot are made when the tick that ends it is
closed.

A stamp contradicts the clock if it is more than a second ahead of the open tick, which the clock drives, or behind the
newest stamp: a step of time. It is counted, nothing that was known before it holds, and no slot between is made. A
silence is none: its ticks are closed as the clock tells of them. But after a second of it nothing holds either, so that
silence and step leave the same behind them, and whoever cannot tell them apart, as a replay, goes on alike.
"""

from collections.abc import Sequence
from copy import copy, deepcopy
from typing import Any

import numpy as np

from wrcd.bus.batch import FrameBatch
from wrcd.bus.codec import Receiver, Sample, Value
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.counts import Counts, Health
from wrcd.core.design import FloatArray
from wrcd.core.estimator import Estimator
from wrcd.core.events import Events
from wrcd.core.input_buffers import NEVER
from wrcd.core.inputs import YAW, Inputs, TickInputs
from wrcd.core.lane import DUE, NOTE, FastLane, fits
from wrcd.core.messages import NAMES, Outbox, Outgoing, Report
from wrcd.core.records import Estimate, StepResult, Tick
from wrcd.core.slot import Slot, frames, reports
from wrcd.core.terms import CHANNELS
from wrcd.core.validity import Backoff, ValidityMonitor, tick_causes

FORWARD_STEP_US = 1_000_000  # a stamp, or the clock, further ahead of the open tick than this is a step of time
BACKWARD_STEP_US = 10_000  # out of order by less than this is jitter between queues, by more a step of the clock
SILENCE_US = 1_000_000  # without a mapped frame: longer, and nothing that was known before holds


Dues = tuple[int, ...]  # cycles (in µs) of the frames that are due


class Observer:
    """Is shown the records that travel through a core; it changes nothing. This one keeps nothing."""

    def accepted(self, samples: Sequence[Sample], stamp_us: int) -> None:
        """A frame was accepted."""

    def stepped(self, tick: Tick, result: StepResult) -> None:
        """The estimator has taken a tick."""

    def was_reset(self, axle: int) -> None:
        """An axle's estimator starts anew."""

    def estimated(self, tick: int, estimate: Estimate) -> None:
        """What a slot's frames are made from, after a tick."""


class Core:
    """One bus, all its axles."""

    counts: Counts
    health: Health
    estimator: Estimator
    receiver: Receiver
    _open: int | None  # number of the tick that gathers frames
    _inputs: Inputs
    _validity: ValidityMonitor
    _is_reset: list[bool]
    _outbox: Outbox
    _outlier_us: list[int]
    _backoff: Backoff
    events: Events
    _stamp_us: int = NEVER  # newest stamp taken

    def __init__(self, config: Config, estimator: Estimator | None = None, observer: Observer | None = None) -> None:
        self.config = config
        self.counts = Counts()
        self.health = Health()
        self.estimator = estimator or Estimator(config.design, len(config.axles))
        self.receiver = Receiver(config.database, [i.source for i in config.inputs], config.data_ids)
        n = len(config.axles)
        self._n = n
        self._observer = observer
        self._period_us = round(config.design.tick_s * 1e6)
        self._open = None
        self._begin_us = self._end_us = NEVER  # of the open tick
        self._inputs = Inputs(config, self.receiver.ends)
        self._tick = self._inputs.close_tick(0)  # the newest that was closed
        self._validity = ValidityMonitor(config.design.window_ticks, n)
        self._is_reset = [True] * n
        self._outbox = Outbox(config)
        self._outlier_us = [NEVER] * n
        self._backoff = Backoff(n, config.design.tick_s)
        self._reports: list[Report] = []  # of the newest slot
        self.events = Events(config)
        self.explains = True  # what feed_batch() makes comes with its estimate, as what feed() makes
        self.muted = False  # make no frames: nobody would send them
        self._lane = self._make_lane()

    def _make_lane(self) -> FastLane | None:
        if self._observer is not None or not fits(self):  # an observer is shown each tick
            return None
        return FastLane(self, (SILENCE_US, FORWARD_STEP_US, BACKWARD_STEP_US))

    def __deepcopy__(self, memo: dict[int, Any]) -> "Core":
        self.settle()
        twin = memo[id(self)] = copy(self)
        vars(twin).update({name: deepcopy(x, memo) for name, x in vars(self).items() if name != "_lane"})
        twin._lane = twin._make_lane()
        return twin

    @property
    def speed_m_s(self) -> float:
        """The newest speed of the train; NaN before it is known, negative backwards."""
        return self._inputs.speed_m_s

    @property
    def below_min_speed(self) -> bool:
        """Whether the train is known to be slower than an estimate needs."""
        return abs(self._inputs.speed_m_s) < self.config.min_speed_m_s

    @property
    def time_us(self) -> int | None:
        """Begin of the open tick: every tick before it is closed. None before the first frame."""
        return None if self._open is None else self._open * self._period_us

    @property
    def reports(self) -> list[Report]:
        """Of every axle at the newest slot."""
        self.take_told()
        return self._reports

    def take_told(self) -> None:
        """Take what slots have told in the lane."""
        if self._lane is not None and (told := self._lane.reports()):
            self._reports = told

    @property
    def newest_us(self) -> int:
        """Newest stamp of a mapped frame; long ago before the first."""
        return self._stamp_us

    @property
    def next_slot_us(self) -> int:
        """The first end of a tick not closed yet with which frames are due; long ago before the first frame."""
        if self._open is None:
            return NEVER
        period_us = self._period_us
        begin_us = self._open * period_us
        begins = ((begin_us // cycle_us + 1) * cycle_us for cycle_us in self._outbox.cycles_us)
        return min(-(-slot_us // period_us) * period_us for slot_us in begins)

    @property
    def waits(self) -> int:
        """How often an axle that was reset again and again had to wait."""
        return self._backoff.waits

    def settle(self) -> None:
        """Take back what the fast lane has borrowed: before anything else reads or changes the core's state."""
        if self._lane is not None:
            self._lane.give_back()

    @property
    def lane_ticks(self) -> int:
        """How many ticks were closed in the fast lane."""
        return 0 if self._lane is None else self._lane.total_ticks

    def feed_batch(self, batch: FrameBatch) -> list[Outgoing]:
        """Take frames, as feed() does each: in C while nothing happens."""
        out: list[Outgoing] = []
        at, lane = 0, self._lane
        if lane is not None and (self.explains or self.muted):
            lane.tells_nothing()
        while at < len(batch):
            if lane is None or not lane.is_open():
                out += self.feed(batch.frame(at))
                at += 1
                continue
            stop, at = lane.take(batch, at)
            out += lane.made()
            if stop in (DUE, NOTE):
                out += self._after_tick_of(lane, stop)
        if lane is not None and lane.is_lent:
            lane.count()
        return out

    def _after_tick_of(self, lane: FastLane, stop: int) -> list[Outgoing]:
        """What a tick that the lane has closed leaves to do: outliers and resets to note, frames that are due."""
        self.take_told()
        due, number = lane.due, lane.newest
        if stop == NOTE:
            lane.give_back()
            self._note_outliers(number, lane.yaw_rate, lane.result)
        else:
            lane.report()
        out: list[Outgoing] = []
        if due and not self.muted:
            out = self._due((number + 1) * self._period_us, due)
        if lane.is_lent:
            lane.was_told()
        return out

    def feed(self, frame: Frame) -> list[Outgoing]:
        """Take a frame; return what was due before its stamp. What is not mapped changes nothing.

        It is accepted or rejected here, whole, for what its reader or the plausibility checks find.
        """
        self.settle()
        reader = self.receiver.reader(frame)
        if reader is None:
            return []
        stamp_us = frame.stamp_us
        out, samples = self._move_to(stamp_us), reader.read(frame)
        reason: Reason | None
        if isinstance(samples, Reason):
            reason = samples
        elif (reason := self._inputs.check(samples, stamp_us)) is None:
            self._accept(samples, stamp_us)
        if reason is not None:
            self.counts.reject(reader.name, reason)
            self._inputs.reject(reader.concerned(frame, reason), stamp_us, reason)
        return out

    def _accept(self, samples: Sequence[Sample], stamp_us: int) -> None:
        self.counts.accepted += 1
        if stamp_us < self._begin_us:
            self.counts.late += 1
        for sample in samples:
            if self._inputs.accept(sample, stamp_us):
                self._count_clipped(sample)
        if self._observer is not None:
            self._observer.accepted(samples, stamp_us)

    def _count_clipped(self, sample: Sample) -> None:
        source = self.config.inputs[sample.source].source
        for place in source.axles:
            self.counts.clipped[self.config.axles[place].number, source.quantity.words] += 1

    def advance(self, now_us: int) -> list[Outgoing]:
        """Time has come to now_us and every frame stamped before it has been fed: close the ticks that are over.

        A time before the open tick, or more than a second after its begin, means that the clock has stepped.
        """
        self.settle()
        target = now_us // self._period_us
        if self._open is None:
            self._open = target
        begin_us = self._open * self._period_us
        if target * self._period_us - begin_us > FORWARD_STEP_US or begin_us - now_us > BACKWARD_STEP_US:
            self._step_to(target)
        return self._close_up_to(target)

    def _move_to(self, stamp_us: int) -> list[Outgoing]:
        """Close the ticks before a stamp; a step of time starts anew."""
        if self._begin_us <= self._stamp_us <= stamp_us < self._end_us:
            self._stamp_us = stamp_us
            return []
        target = stamp_us // self._period_us
        if self._open is None:
            self._open = target
        begin_us = self._open * self._period_us
        newest_us = begin_us if self._stamp_us == NEVER else self._stamp_us
        if stamp_us - begin_us > FORWARD_STEP_US or newest_us - stamp_us > BACKWARD_STEP_US:
            self._step_to(target)
        out = self._close_up_to(target)
        self._stamp_us = max(self._stamp_us, stamp_us)
        return out

    def _step_to(self, tick: int) -> None:
        """A step of time: go on at a tick, with nothing from before."""
        self.counts.time_steps += 1
        self._open = tick
        self._reset_all()

    def _reset_all(self) -> None:
        """Nothing that was known before holds."""
        self._stamp_us = NEVER
        self._outlier_us = [NEVER] * self._n
        self._inputs.reset()
        self.receiver.reset()
        self._backoff.reset()
        for axle in range(self._n):
            self._reset_axle(axle, Cause.WARMING_UP)

    def _reset_axle(self, axle: int, why: Cause) -> None:
        if not self._is_reset[axle]:
            self.estimator.reset(axle)
            if self._observer is not None:
                self._observer.was_reset(axle)
        self._is_reset[axle] = True
        self._validity.reset(axle, why)

    def _close_up_to(self, target: int) -> list[Outgoing]:
        assert self._open is not None
        out: list[Outgoing] = []
        while self._open < target:
            number = self._open
            due = self._close_tick(number)
            self._open += 1
            if due and not self.muted:
                out += self._due(self._open * self._period_us, due)
        self._begin_us = self._open * self._period_us
        self._end_us = self._begin_us + self._period_us
        return out

    def _close_tick(self, number: int) -> Dues:
        """Run the bank on what a tick brought. Returns what is due at its end."""
        self.counts.ticks += 1
        end_us = (number + 1) * self._period_us
        if self._stamp_us != NEVER and end_us - self._stamp_us > SILENCE_US:
            self._reset_all()
        tick = self._tick = self._inputs.close_tick(end_us)
        causes = tick_causes(self._inputs, tick, end_us)
        if causes != self.events.tick_causes:
            self.events.tick(causes, self._inputs, tick, end_us)
        self._run_tick(number, tick, causes)
        return self._dues(end_us)

    def _dues(self, end_us: int) -> Dues:
        """Whose slots begin within the tick that ends, or with its end."""
        period_us = self._period_us
        return tuple([cycle_us for cycle_us in self._outbox.cycles_us if end_us % cycle_us < period_us])

    def _run_tick(self, number: int, inputs: TickInputs, causes: Sequence[Cause]) -> None:
        """Run the bank on a tick: the axles that have what they need, and need not wait."""
        may_run = abs(inputs.speed_m_s) >= self.config.min_speed_m_s and not inputs.speed_jumped
        waits, silent = self._backoff.waiting, inputs.unavailable
        running = [may_run and axle not in silent and not waits(axle, number) for axle in range(self._n)]
        for axle in range(self._n):
            self._begin_tick(axle, number, inputs, causes[axle], running[axle])
        if not any(running):
            return
        z, ratio = np.reshape(inputs.z, (CHANNELS, -1)), np.array(inputs.torque_ratio)
        there = np.ones(z.shape, dtype=bool) if inputs.present is None else np.reshape(inputs.present, z.shape)
        tick = Tick(number, z, there & running, ratio, abs(inputs.speed_m_s))
        result = self.estimator.step(tick)
        if self._observer is not None:
            self._observer.stepped(tick, result)
        if result.notable:
            self._note_outliers(number, z[YAW], result)

    def _begin_tick(self, axle: int, number: int, inputs: TickInputs, cause: Cause, runs: bool) -> None:
        """Tell an axle's Validity of a tick and what speaks against it; reset the axle if it does not run in it."""
        jumped = inputs.speed_jumped
        # a confirmed speed jump means another signal source: reset every axle
        if jumped and not self._is_reset[axle]:
            self._count_reset(axle, number)
            self.events.restarted(axle, self.events.describe.jumped(axle, abs(inputs.speed_m_s)))
        if runs:
            self._is_reset[axle] = False
            self._validity.update(axle, cause)
            if self._validity.window_full[axle]:
                self._backoff.recovered(axle)
        elif axle in inputs.unavailable:
            self._reset_axle(axle, Cause.INPUT_SILENT)
        else:
            again = jumped or self._backoff.waiting(axle, number)
            self._reset_axle(axle, Cause.RESTARTED if again else Cause.STANDSTILL)

    def _note_outliers(self, number: int, yaw_rate: FloatArray, result: StepResult) -> None:
        """Remember whose measurements were left out in a tick, and reset the axles that need it."""
        for axle in np.flatnonzero(result.outliers).tolist():
            self._outlier_us[axle] = (number + 1) * self._period_us
        for axle in np.flatnonzero(result.needs_reset).tolist():
            self._count_reset(axle, number)
            why = self.estimator.why_reset(result, yaw_rate, axle)
            wait_s = self._backoff.wait_s(axle, number)
            self.events.restarted(axle, self.events.describe.outliers(axle, why, wait_s))
            self._reset_axle(axle, Cause.RESTARTED)

    def _count_reset(self, axle: int, number: int) -> None:
        self.counts.restarts += 1
        self._backoff.was_reset(axle, number)

    def _due(self, end_us: int, due: Dues) -> list[Outgoing]:
        """The frames whose slot begins with this tick's end."""
        slot = self._slot(end_us, due)
        estimate = slot.estimate
        if estimate is not None and self._observer is not None:
            self._observer.estimated(end_us // self._period_us - 1, estimate)
        if slot.adhesion or slot.detail:
            self._reports = reports(slot, self.events.confidences)
            self.events.slot(end_us, self._reports, slot.details, estimate)
        return frames(slot, self._reports, self._outbox)

    def _slot(self, end_us: int, due: Dues) -> Slot:
        """Take down what the frames of a slot are made from."""
        axles, inputs, tick = range(self._n), self._inputs, self._tick
        outbox = self._outbox
        adhesion, detail = outbox.adhesion_due(due), outbox.detail_due(due)
        reports_due = bool(adhesion) or detail
        known = reports_due and True in self._validity.window_full
        pairs = self.estimator.health.state.tolist() if reports_due else []
        standing = [self._validity.standing(axle, pair) for axle, pair in enumerate(pairs)]
        return Slot(
            end_us=end_us,
            estimate=self.estimator.estimate() if known else None,
            due=due,
            adhesion=adhesion,
            detail=detail,
            standing=standing,
            details=self.events.standing(standing, inputs, self._validity, self.estimator.health, end_us)
            if reports_due
            else {},
            age_ms=[inputs.age_ms(axle, end_us) for axle in axles] if reports_due else (),
            torque_ratio=tick.torque_ratio,
            stale=[inputs.quantities(tick.stale, axle) for axle in axles] if detail else (),
            inputs=[self._input_values(axle, end_us) for axle in axles] if detail else (),
            status=list(outbox.status(end_us, due, self.counts, self.health, self.estimator.outliers)),
        )

    def _input_values(self, axle: int, end_us: int) -> dict[str, Value]:
        unchanged = self._inputs.quantities(self._inputs.unchanged(end_us), axle)
        values: dict[str, Value] = {
            "Outlier": float(end_us - self._outlier_us[axle] <= self._outbox.inputs_cycle_us(axle)),
            "Unchanged": float(bool(unchanged)),
        }
        for q, name in NAMES.items():
            register, rejected = self._inputs.reached(q, axle, end_us)
            values |= {f"Reach{name}": float(register), f"Refused{name}": rejected}
        return values

    def shutdown_frames(self, now_us: int) -> list[Frame]:
        """The last frames: every axle NotAvailable, the daemon stopping."""
        self.health.state = "Stopping"
        return list(self._outbox.shutdown_frames(now_us, self.counts, self.health))
