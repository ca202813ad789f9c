"""From measurements to adhesion, for all axles at once: bank step -> residual RMS -> rules -> memory -> adhesion."""

from collections.abc import Iterable, Iterator
from copy import copy
from typing import ClassVar, Protocol

import numpy as np

from wrcd.estimator.answer import Answers, Draft
from wrcd.estimator.design import MODELS, Design, FloatArray, IntArray
from wrcd.estimator.paper.bank import Bank, BoolArray, SpeedFilter
from wrcd.estimator.paper.window import BLOCK_TICKS, Lengths, Window, quiet
from wrcd.estimator.records import Estimate, StepResult, Tick, Ticks
from wrcd.estimator.recursion import Sections
from wrcd.estimator.signals.gate import Gate, Outliers
from wrcd.estimator.signals.joints import HOLD_TICKS, MAX_PULSE, Joints
from wrcd.estimator.signals.noise import NoiseLevel, Offset
from wrcd.estimator.trust.changes import ChangeDetector
from wrcd.estimator.trust.health import SPAN_TICKS, PairHealth
from wrcd.estimator.trust.memory import ANOTHER_STEPS, STEP_TICKS, Remembered, remember

OFFSET_WINDOWS = 2  # memory of the sensors' offsets, in windows


class Estimator:
    """Steps the bank and answers. Never raises on data: what is unknown comes out as NaN.

    At the end of every BLOCK_TICKS the newest part of the window is compared with the rest; where the rail or the
    torque has changed, the rest is dropped, so that the estimate follows in a fraction of the window and says so by a
    wider interval. While nothing changes the words on it are fused.
    """

    engine: ClassVar[str] = "Reference"  # in WrcdStatus's words
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
    _memory: FloatArray  # (5, n) what is Remembered
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

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self._complete[axle] = self.started[axle] = False
        self._delayed[..., axle] = 0.0
        self._delayed_live[:, axle] = self._delayed_clear[:, axle] = False
        for part in (
            self._offset, self._gate, self._bank, self._joints, self._noise, self._lowpass, self._window, self.health
        ):  # fmt: skip
            part.reset(axle)
        self._memory[:, axle] = 0.0
        if not self.started.any():  # the speed is all axles': it goes on while one of them does
            self._speed.reset()

    def why_reset(self, result: StepResult, yaw_rate: FloatArray, axle: int) -> Outliers:
        """Of an axle that needs it, after the step (n yaw rates) that showed it and before its reset."""
        return self._gate.why_reset(result.innovations[:, :, axle], float(yaw_rate[axle]), axle)

    def step(self, tick: Tick) -> StepResult:
        """One tick, whatever it brings; call reset() for the axles that need it before the next.

        An axle without both measurements, or with an outlier in either, is predicted over.
        """
        z, yaw_rate = tick.z, tick.z[0]
        self._speed_m_s = speed = self._speed.step(tick.speed_m_s)
        # one channel alone is not enough: with its part of a gain made for two, a filter would be unstable
        whole = np.logical_and.reduce(tick.present)
        before = copy(self._bank), copy(self._offset)  # their steps make new arrays
        small = np.abs(self._offset.deviation(z)) <= MAX_PULSE[:, None]
        # the acceleration alone: held while a wheelset hunts, it would have steps, and those are pulses
        pulse, near = self._joints.step(z[1], whole & small[1])
        innovations, w = self._filter(z, whole, near, speed)
        swings = self._joints.recovering & np.logical_and.reduce(small)
        outliers = self._gate.outliers(innovations, yaw_rate, whole & ~swings)
        left_out = np.logical_or.reduce(outliers)
        accepted = whole & ~left_out
        e = innovations
        if left_out.any():
            self.outliers += int(outliers.sum())
            self._bank, self._offset = before
            e, w = self._filter(z, accepted, near, speed)
        needs_reset = self._gate.learn(e, yaw_rate, accepted & ~swings, outliers)
        needs_reset |= ~np.isfinite(self._bank.x).all(axis=(0, 1))
        self._noise.step(z, accepted & ~near)
        if self.health.judges:
            self.health.pairs.step(z, accepted & ~near)
        self.started |= accepted
        # Keep the first innovation after a gap out of the window: it spans several ticks. A sensor slower than the
        # ticks, for which no gain here is made, therefore never gives an estimate.
        in_window = accepted & self._complete & np.isfinite(tick.torque_ratio) & ~needs_reset
        self._complete = accepted.copy()  # reset() changes it, and not the record
        live, calm = self._put(tick, w, in_window, pulse, near)
        self._look_back(tick.number + 1)
        return StepResult(innovations, w, accepted, left_out, near, live, calm, needs_reset)

    def run(self, ticks: Ticks, first: int, end: int, resets: bool) -> None:
        """Step ticks first … end - 1 of them; resets: whether axles are reset that need it."""
        for k in range(first, end):
            needs_reset = self.step(ticks.tick(k)).needs_reset
            for axle in np.flatnonzero(needs_reset).tolist() if resets else ():
                self.reset(axle)

    def _look_back(self, ticks: int) -> None:
        """After so many ticks: whether the rail has changed, at a block's end; the memory, and the sensors."""
        if not self._wrcd:
            return
        if ticks % BLOCK_TICKS == 0:
            with quiet():
                changed = self._changes.changed(self._window, self._speed_m_s)
            if changed.any():
                self._window.truncate(self._changes.recent_blocks, changed)
        if ticks % STEP_TICKS == 0:
            self._remember(looks=ticks % SPAN_TICKS == 0)

    def _remember(self, looks: bool) -> None:
        """The rules' word of this moment is fused with those before; and sometimes the sensors are looked at."""
        with quiet():
            draft = self._draft()
            (usual, recent), _, _ = self._answers.answers(draft)
            step_s = STEP_TICKS * self.design.tick_s
            whole = draft.blocks[0] * BLOCK_TICKS >= self.design.window_ticks
            memory = remember(
                Remembered(*self._memory), usual.word, whole, recent.word, recent.live_share, 100.0 * draft.lasting,
                step_s, self._speed_m_s,
            )  # fmt: skip
            if looks:
                self.health.look(self._speed_m_s, draft.now, usual.inputs)
        self._memory = np.array(memory)
        another = memory.another >= ANOTHER_STEPS
        if another.any():
            self._window.truncate(self._changes.recent_blocks, another)

    def _filter(
        self, z: FloatArray, axles: BoolArray, near: BoolArray, speed_m_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """The bank with the measurements of some axles (n,); those near a pulse teach no offset."""
        deviation = self._offset.step(z, np.broadcast_to(axles & ~near, z.shape))
        return self._bank.step(deviation, np.broadcast_to(axles, z.shape), speed_m_s)

    def _put(
        self, tick: Tick, w: FloatArray, in_window: BoolArray, pulse: BoolArray, near: BoolArray
    ) -> tuple[BoolArray, BoolArray]:
        """Innovations (4, 2, n) enter the window HOLD_TICKS late; those about a pulse and those that must stay out as
        zeros. Returns what entered: live and calm (n,)."""
        heard, raw = self._delayed_live[0], self._delayed[0]
        live: BoolArray = heard & self._delayed_clear[0] & ~pulse
        self._delayed = np.concatenate((self._delayed[1:], w[None]))
        self._delayed_live = np.concatenate((self._delayed_live[1:], in_window[None]))
        self._delayed_clear = np.concatenate((self._delayed_clear[1:] & ~pulse, ~near[None]))
        raw = np.where(live, raw, 0.0)
        w = self._lowpass.step(raw.reshape(-1, self.axles)).reshape(raw.shape) if self._wrcd else raw
        calm: BoolArray = live & ~self._joints.recovering
        self._window.put(tick.number, w, raw, self.started, heard, live, calm, tick.torque_ratio)
        return live, calm

    def estimate(self) -> Estimate:
        """The adhesion that the window's residuals and torque speak for."""
        with quiet():
            return self._answers.estimate(self._draft())

    def _draft(self) -> Draft:
        """What an estimate of this moment is made from. Within quiet()."""
        factor = self._noise.sensor_factor()
        return self._answers.draft(self._window, factor, self._speed_m_s, self._in_grid, self._memory)

    def torque_now(self) -> FloatArray:
        """(n,): torque ratio of the moment; NaN where it is not known."""
        with quiet():
            return self._answers.torque_now(self._window)

    def inputs_of(self, blocks: IntArray, now: FloatArray) -> FloatArray:
        """What the rules are given (m, COLUMNS) of windows of so many blocks (m,): all axles with one length after all
        with another. now (n,): torque ratio of the moment."""
        with quiet():
            return self._answers.inputs_of(self._window, blocks, now, self._noise.sensor_factor(), self._in_grid)[0]

    def steps(self) -> FloatArray:
        """Decades (n, 4) by which the newest part's residuals lie above those of the rest of the usual window."""
        with quiet():
            return self._changes.steps(self._window)

    def features(self) -> FloatArray:
        """(n, FEATURES) that pairs of sensors are judged by, after a look: they stay those of the newest span in which
        an axle had data."""
        return self.health.features(self._speed_m_s, self.torque_now())

    @property
    def _in_grid(self) -> float:
        """The speed, held within the design's grid."""
        low, high = self._grid
        return min(max(self._speed_m_s, low), high)


class Runs(Protocol):
    """An estimator of either engine, or several."""

    def run(self, ticks: Ticks, first: int, end: int, resets: bool) -> None:
        """As Estimator.run()."""


def step_through(estimator: Runs, ticks: Ticks, stops: Iterable[int] = (), resets: bool = False) -> Iterator[int]:
    """Step any number of ticks; resets: whether axles are reset that need it. Yields after each of the stops, places
    among the ticks that grow."""
    first = 0
    for stop in (*stops, len(ticks) - 1):
        estimator.run(ticks, first, stop + 1, resets)
        first = stop + 1
        yield stop
