"""From measurements to adhesion, for all axles at once: bank step -> residual RMS -> rules -> memory -> adhesion.

Ticks come in blocks of up to BLOCK_TICKS, which is what the window sums up. While nothing happens - every running axle
has both measurements, no pulse, no outlier, all running means settled - a block is stepped as a whole, with linear
recursions as matrix products (recursion.py). If anything else shows in it, everything is taken back and the block is
stepped tick by tick, which can do all. Both give the same numbers but for rounding.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.estimator.answer import Answers, Draft, joined, split
from wrcd.estimator.design import MODELS, Design, FloatArray, IntArray
from wrcd.estimator.paper.bank import Bank, BoolArray, SpeedFilter
from wrcd.estimator.paper.window import BLOCK_TICKS, Lengths, Statistics, Window, quiet
from wrcd.estimator.records import Estimate, StepResult, Ticks
from wrcd.estimator.recursion import Sections
from wrcd.estimator.signals.gate import Gate, Outliers
from wrcd.estimator.signals.joints import HOLD_TICKS, MAX_PULSE, Joints
from wrcd.estimator.signals.noise import NoiseLevel, Offset
from wrcd.estimator.trust.changes import ChangeDetector
from wrcd.estimator.trust.health import SPAN_TICKS, PairHealth
from wrcd.estimator.trust.memory import ANOTHER_STEPS, STEP_TICKS, Remembered, remember

OFFSET_WINDOWS = 2  # memory of the sensors' offsets, in windows


@dataclass(init=False, repr=False, eq=False)
class Estimator:
    """Steps the bank and answers. Never raises on data: what is unknown comes out as NaN.

    At the end of every block of ticks the newest part of the window is compared with the rest; where the rail or the
    torque has changed, the rest is dropped, so that the estimate follows in a fraction of the window and says so by a
    wider interval. While nothing changes the words on it are fused.
    """

    _bank: Bank
    _offset: Offset
    _gate: Gate
    _window: Window
    _speed: SpeedFilter
    _lowpass: Sections
    _joints: Joints
    _noise: NoiseLevel
    _speed_m_s: float
    _complete: BoolArray  # whether the newest tick's measurements were used
    _delayed: FloatArray
    _delayed_live: BoolArray
    _delayed_clear: BoolArray
    started: BoolArray  # whether a measurement was used since the last reset
    health: PairHealth
    _memory: FloatArray  # (6, n) what is Remembered
    outliers: int = 0  # samples left out so far

    def __init__(self, design: Design, axles: int) -> None:
        self.design = design
        self.axles = axles
        self._bank = Bank(design, axles)
        self._offset = Offset(OFFSET_WINDOWS * design.window_ticks, axles)
        self._gate = Gate(axles)
        self._speed = SpeedFilter(design.tick_s)
        self._joints = Joints(design.highpass, float(design.noise_rms[1]), axles)
        self._noise = NoiseLevel(design.noise_rms, axles)
        self._lowpass = Sections(design.lowpass, 2 * MODELS, axles)
        self._window = Window(Lengths(design).longest, axles)
        self._changes, self._answers = ChangeDetector(design), Answers(design, axles)
        self.health = PairHealth(design.health, design.noise_rms, design.tick_s, axles, design.wheelbase_m)
        self._grid = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        self._speed_m_s = self._grid[0]
        self._wrcd = design.form == "wrcd"
        self._complete = np.zeros(axles, dtype=bool)
        # innovations wait HOLD_TICKS, oldest first, until it is known whether a pulse follows
        self._delayed = np.zeros((HOLD_TICKS, MODELS, 2, axles))
        self._delayed_live = np.zeros((HOLD_TICKS, axles), dtype=bool)
        self._delayed_clear = np.zeros((HOLD_TICKS, axles), dtype=bool)
        self._memory = np.zeros((len(Remembered._fields), axles))
        self.started = np.zeros(axles, dtype=bool)
        self._small = (self._offset.newest_share * MAX_PULSE)[:, None]
        self._settled: BoolArray | None = None  # (n,): which axles a whole block can be stepped of; None: look
        self._all: BoolArray = np.ones((BLOCK_TICKS, axles), dtype=bool)

    @property
    def is_possible(self) -> bool:
        """Whether what is remembered is a number: a state from a file may hold others, and they would stay."""
        m = Remembered(*self._memory)
        return bool(np.isfinite(self._memory).all() and (m.age_s >= 0.0).all() and (m.peak_age_s >= 0.0).all())

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self._complete[axle] = self.started[axle] = False
        self._delayed[..., axle] = 0.0
        self._delayed_live[:, axle] = self._delayed_clear[:, axle] = False
        for part in (
            self._offset, self._gate, self._bank, self._joints, self._noise, self._lowpass, self._window, self.health
        ):  # fmt: skip
            part.reset(axle)
        self._settled = None
        self._memory = self._memory.copy()  # drafts that are held back keep what they took
        self._memory[:, axle] = 0.0
        if not self.started.any():  # the speed is all axles': it goes on while one of them does
            self._speed.reset()

    def why_reset(self, result: StepResult, yaw_rate: FloatArray, axle: int) -> Outliers:
        """Of an axle that needs it, after the step (n yaw rates) that showed it and before its reset."""
        return self._gate.why_reset(result.innovations[-1, :, :, axle], float(yaw_rate[axle]), axle)

    def block_end(self, tick: int) -> bool:
        """Whether a block ends with a tick: ticks up to there, and no further, may be stepped at once."""
        return (tick + 1) % BLOCK_TICKS == 0

    def step(self, ticks: Ticks, first: int = 0) -> StepResult:
        """Step ticks from `first` on: all that are left if nothing happens in them, else one. No block_end() may lie
        within them. The result tells how many they were; call reset() for the axles that need it before going on."""
        result = self._step_settled(ticks, first) or self._step_one(ticks, first)
        newest = ticks.number + first + len(result) - 1
        if self._wrcd and (newest + 1) % BLOCK_TICKS == 0:
            with quiet():
                changed = self._changes.changed(self._window, self._speed_m_s)
            if changed.any():
                self._window.truncate(self._changes.recent_blocks, changed)
        if self._wrcd and (newest + 1) % STEP_TICKS == 0:
            self._remember(looks=(newest + 1) % SPAN_TICKS == 0)
        return result

    def _remember(self, looks: bool) -> None:
        """The rules' word of this moment is fused with those before; and sometimes the sensors are looked at."""
        draft = self.draft()
        with quiet():
            usual, recent = self._answers.answers(draft)
            step_s = STEP_TICKS * self.design.tick_s
            ticks = draft.blocks[0] * BLOCK_TICKS
            whole, window_s = ticks >= self.design.window_ticks, ticks * self.design.tick_s
            memory = remember(
                Remembered(*self._memory), usual.word, whole, window_s, recent.word, recent.live_share,
                100.0 * draft.lasting, step_s, self._speed_m_s,
            )  # fmt: skip
            if looks:
                self.health.look(self._speed_m_s, draft.now, usual.inputs)
        self._memory = np.array(memory)
        another = memory.another >= ANOTHER_STEPS
        if another.any():
            self._window.truncate(self._changes.recent_blocks, another)

    def _step_settled(self, ticks: Ticks, first: int) -> StepResult | None:
        """All ticks from `first` on at once; None, and nothing has changed, if that cannot be."""
        m = len(ticks) - first
        running, exempt = self._stepped_at_once(ticks, first)
        if running is None:
            return None
        z = ticks.z[first:] if exempt is None else np.where(running, ticks.z[first:], 0.0)
        before = self._speed.checkpoint(), self._offset.checkpoint(), self._joints.checkpoint(), self._bank.x
        speeds = [self._speed.step(v) for v in ticks.speeds_m_s[first:]]
        with np.errstate(over="ignore", invalid="ignore"):
            deviation = self._offset.step_settled(z)
            usual = bool((np.abs(deviation) <= self._small).all()) and self._joints.step_settled(z[:, 1])
            if usual:
                e, w = self._bank.step_all(deviation, speeds)
                usual = self._gate.step_settled(e, z[:, 0], exempt)
        if not usual:
            speed, offset, joints, self._bank.x = before
            self._speed.rollback(speed)
            self._offset.rollback(offset)
            self._joints.rollback(joints)
            return None
        self._speed_m_s = speeds[-1]
        self._noise.step_settled(z)
        idle = None if running.all() else ~running
        if self.health.judges:
            self.health.pairs.step_settled(z, None if idle is None else running)
        yes = self._all[:m] if idle is None else self._all[:m] & running
        no = ~self._all[:m]
        in_window = yes & np.isfinite(ticks.torque_ratio[first:])
        live, calm = self._put(ticks, first, w, in_window, no, no)
        if idle is not None:
            for axle in np.flatnonzero(idle).tolist():  # their running powers fade on nothing
                self._joints.reset(axle)
                self._noise.reset(axle)
        return StepResult(e, w, yes, no, no, in_window, live, calm, no[0])

    def _stepped_at_once(self, ticks: Ticks, first: int) -> tuple[BoolArray | None, BoolArray | None]:
        """Which axles (n,) run, if all that do are settled and have all measurements, else None; and which, if any,
        the gate is not to judge: those that do not run, and those whose filters still swing after a pulse."""
        m = len(ticks) - first
        if self._settled is None:
            parts = (self._offset, self._gate, self._joints, self._noise, self.health)
            self._settled = self._complete & np.logical_and.reduce([part.settled for part in parts])
        present = ticks.present[first:]
        running, exempt = self._settled, None
        if not (present.all() and running.all()):
            running = np.logical_and.reduce(present, axis=(0, 1))
            idle = ~np.logical_or.reduce(present, axis=(0, 1)) & ~self.started
            if not ((running & self._settled) | idle).all() or not running.any():
                return None, None
            exempt = idle
        swinging = self._joints.recovering_after(1)
        if swinging.any():
            if (swinging != self._joints.recovering_after(m)).any():
                return None, None
            exempt = swinging if exempt is None else swinging | exempt
        return running, exempt

    def _step_one(self, ticks: Ticks, at: int) -> StepResult:
        """One tick, whatever it brings.

        An axle without both measurements, or with an outlier in either, is predicted over.
        """
        self._settled = None
        z, present = ticks.z[at], ticks.present[at]
        self._speed_m_s = speed = self._speed.step(ticks.speeds_m_s[at])
        # one channel alone is not enough: with its part of a gain made for two, a filter would be unstable
        whole = np.logical_and.reduce(present)
        bank, offset = self._bank.x, self._offset.checkpoint()
        small = np.abs(self._offset.deviation(z)) <= MAX_PULSE[:, None]
        # the acceleration alone: held while a wheelset hunts, it would have steps, and those are pulses
        pulse, near = self._joints.step(z[1], whole & small[1])
        e, w = self._filter(z, whole, near, speed)
        swings = self._joints.recovering & np.logical_and.reduce(small)
        outliers = self._gate.outliers(e, z[0], whole & ~swings)
        left_out = np.logical_or.reduce(outliers)
        accepted = whole & ~left_out
        seen = e
        if left_out.any():
            self.outliers += int(outliers.sum())
            self._bank.x = bank
            self._offset.rollback(offset)
            e, w = self._filter(z, accepted, near, speed)
        needs_reset = self._gate.learn(e, z[0], accepted & ~swings, outliers)
        needs_reset |= ~np.isfinite(self._bank.x).all(axis=(0, 1))
        self._noise.step(z, accepted & ~near)
        if self.health.judges:
            self.health.pairs.step(z, accepted & ~near)
        self.started |= accepted
        # Keep the first innovation after a gap out of the window: it spans several ticks. A sensor slower than the
        # ticks, for which no gain here is made, therefore never gives an estimate.
        in_window = accepted & self._complete & np.isfinite(ticks.torque_ratio[at]) & ~needs_reset
        self._complete = accepted.copy()  # reset() changes it, and not the record
        live, calm = self._put(ticks, at, w[None], in_window[None], pulse[None], near[None])
        seen = np.where(left_out, seen, e)
        return StepResult(
            seen[None], w[None], accepted[None], left_out[None], near[None], in_window[None], live, calm, needs_reset
        )

    def _filter(
        self, z: FloatArray, axles: BoolArray, near: BoolArray, speed_m_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """The bank with the measurements of some axles (n,); those near a pulse teach no offset."""
        deviation = self._offset.step(z, np.broadcast_to(axles & ~near, z.shape))
        return self._bank.step(deviation, np.broadcast_to(axles, z.shape), speed_m_s)

    def _put(
        self, ticks: Ticks, first: int, w: FloatArray, in_window: BoolArray, pulse: BoolArray, near: BoolArray
    ) -> tuple[BoolArray, BoolArray]:
        """m ticks' innovations (m, 4, 2, n) enter the window HOLD_TICKS late; those about a pulse and those that must
        stay out as zeros. A pulse is reported one tick at a time. Returns what entered: live and calm (m, n)."""
        m = len(w)
        if pulse.any():
            self._delayed_clear &= ~pulse
        if m == HOLD_TICKS:
            raw, delayed_live, clear = self._delayed, self._delayed_live, self._delayed_clear
            self._delayed, self._delayed_live, self._delayed_clear = w, in_window.copy(), ~near
        else:
            queues = ((self._delayed, w), (self._delayed_live, in_window), (self._delayed_clear, ~near))
            (raw, self._delayed), (delayed_live, self._delayed_live), (clear, self._delayed_clear) = (
                _shifted(queue, new) for queue, new in queues
            )
        live: BoolArray = delayed_live & clear
        if not live.all():
            raw = np.where(live[:, None, None], raw, 0.0)
        w = self._lowpass.step(raw.reshape(m, -1, self.axles)).reshape(raw.shape) if self._wrcd else raw
        calm: BoolArray = live & ~self._joints.recovering
        ratio = ticks.torque_ratio[first : first + m]
        self._window.put(ticks.number + first, w, raw, self.started, delayed_live, live, calm, ratio)
        return live, calm

    def estimate(self) -> Estimate:
        """The adhesion that the window's residuals and torque speak for."""
        return self._answers.estimate(self.draft())

    def draft(self) -> Draft:
        """What an estimate of this moment is made from."""
        with quiet():
            factor = self._noise.sensor_factor()
            return self._answers.draft(self._window, factor, self._speed_m_s, self._in_grid, self._memory)

    def estimates(self, drafts: Sequence[Draft]) -> list[Estimate]:
        """Estimates of several moments at once."""
        if len(drafts) == 1:
            return [self._answers.estimate(drafts[0])]
        return split(self._answers.estimate(joined(drafts)), len(drafts))

    def torque_now(self) -> FloatArray:
        """(n,): torque ratio of the moment; NaN where it is not known."""
        with quiet():
            return self._answers.torque_now(self._window)

    def inputs_of(self, blocks: IntArray, now: FloatArray) -> tuple[FloatArray, Statistics]:
        """What the rules are given (m, COLUMNS) of windows of so many blocks (m,), and the windows' statistics; see
        Answers.inputs_of."""
        with quiet():
            return self._answers.inputs_of(self._window, blocks, now, self._noise.sensor_factor(), self._in_grid)

    def steps(self) -> FloatArray:
        """Decades (n, 4) by which the newest part's residuals lie above those of the rest of the usual window."""
        with quiet():
            return self._changes.steps(self._window)

    @property
    def _in_grid(self) -> float:
        """The speed, held within the design's grid."""
        low, high = self._grid
        return min(max(self._speed_m_s, low), high)


def step_through(estimator: Estimator, ticks: Ticks, stops: Iterable[int] = (), resets: bool = False) -> Iterator[int]:
    """Step any number of ticks, block by block; resets: whether axles are reset that need it. Yields after each of the
    stops, places among the ticks that grow."""
    at = 0
    for stop in (*stops, len(ticks) - 1):
        while at <= stop:
            end = at + 1
            while end <= stop and not estimator.block_end(ticks.number + end - 1):
                end += 1
            block, first = ticks.part(at, end), 0
            while first < len(block):
                result = estimator.step(block, first)
                first += len(result)
                for axle in np.flatnonzero(result.needs_reset).tolist() if resets else ():
                    estimator.reset(axle)
            at = end
        yield stop


def _shifted(queue: NDArray[Any], new: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """What leaves a queue of ticks, and the queue, as new ones come."""
    both = np.concatenate((queue, new))
    return both[: len(new)], both[len(new) :]
