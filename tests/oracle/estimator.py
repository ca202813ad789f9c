"""The estimator's oracle: the chain of its stages, for all axles at once. It shares the design with the estimator in C,
and no number and no arithmetic."""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from tests.oracle.bands import Bands
from tests.oracle.bank import Bank, SpeedFilter
from tests.oracle.health import SPAN_BLOCKS, SPAN_TICKS, PairHealth
from tests.oracle.interval import Answers, Draft
from tests.oracle.memory import ANOTHER_STEPS, STEP_TICKS, ChangeDetector, Remembered, remember
from tests.oracle.residuals import BLOCK_TICKS, PLAIN_IN_BANDS, Lengths, Window, quiet
from tests.oracle.signals import HOLD_TICKS, MAX_PULSE, Gate, Joints, NoiseLevel, Offset, Sections
from tests.oracle.slides import Slides
from tests.support.stepped import Outliers, Tick
from wrcd.core.design import BoolArray, Design, FloatArray, IntArray
from wrcd.core.records import Estimate
from wrcd.core.terms import MODELS, PairState

OFFSET_WINDOWS = 2  # memory of the sensors' offsets, in windows


@dataclass(frozen=True, slots=True)
class Stepped:
    """What one tick brought, as StepResult has it."""

    innovations: FloatArray
    whitened: FloatArray
    accepted: BoolArray
    outliers: BoolArray
    near_pulse: BoolArray
    live: BoolArray
    calm: BoolArray
    needs_reset: BoolArray

    @property
    def notable(self) -> bool:
        """Whether anything was left out, or needs a reset."""
        return bool(self.outliers.any() or self.needs_reset.any())


class Oracle:
    """Steps the bank and answers. Never raises on data: what is unknown comes out as NaN.

    At the end of every BLOCK_TICKS the newest part of the window is compared with the rest; where the rail or the
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
    speed_m_s: float  # filtered
    _complete: BoolArray  # whether the newest tick's measurements were used
    _delayed: FloatArray
    _delayed_live: BoolArray
    _delayed_clear: BoolArray
    started: BoolArray  # whether a measurement was used since the last reset
    _bands: Bands
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
        self._bands, self.health = Bands(design, axles), PairHealth(design.health, axles)
        self._grid = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        self.speed_m_s = self._grid[0]
        self._wrcd = design.form == "wrcd"
        self._complete = np.zeros(axles, dtype=bool)
        # innovations wait HOLD_TICKS, oldest first, until it is known whether a pulse follows
        self._delayed = np.zeros((HOLD_TICKS, MODELS, 2, axles))
        self._delayed_live = np.zeros((HOLD_TICKS, axles), dtype=bool)
        self._delayed_clear = np.zeros((HOLD_TICKS, axles), dtype=bool)
        self._memory = np.zeros((len(Remembered._fields), axles))
        self.slides = Slides(axles)
        self.started = np.zeros(axles, dtype=bool)
        self.deviation = np.zeros((2, axles))  # of the newest measurements from their offset

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self._complete[axle] = self.started[axle] = False
        self._delayed[..., axle] = 0.0
        self._delayed_live[:, axle] = self._delayed_clear[:, axle] = False
        for part in (
            self._offset, self._gate, self._bank, self._joints, self._noise, self._lowpass, self._window, self._bands
        ):  # fmt: skip
            part.reset(axle)
        if axle ^ 1 < self.axles:
            self._window.forget_partner(axle ^ 1)
        self._memory[:, axle] = 0.0
        self.slides.reset(axle)
        if not self.started.any():  # the speed is all axles': it goes on while one of them does
            self._speed.reset()

    def why_reset(self, result: Stepped, yaw_rate: FloatArray, axle: int) -> Outliers:
        """Of an axle that needs it, after the step (n yaw rates) that showed it and before its reset."""
        return self._gate.why_reset(result.innovations[:, :, axle], float(yaw_rate[axle]), axle)

    def step(self, tick: Tick) -> Stepped:
        """One tick, whatever it brings; call reset() for the axles that need it before the next.

        An axle without both measurements, or with an outlier in either, is predicted over.
        """
        z, yaw_rate = tick.z, tick.z[0]
        self.speed_m_s = speed = self._speed.step(tick.speed_m_s)
        # one channel alone is not enough: with its part of a gain made for two, a filter would be unstable
        whole = np.logical_and.reduce(tick.present)
        small = np.abs(self._offset.deviation(z)) <= MAX_PULSE[:, None]
        # the acceleration alone: held while a wheelset hunts, it would have steps, and those are pulses
        pulse, near = self._joints.step(z[1], whole & small[1])
        before = copy(self._offset)  # its steps make new arrays
        self.deviation = self._offset.step(z, np.broadcast_to(whole & ~near, z.shape))
        innovations, w = self._bank.step(self.deviation, whole, speed)
        swings = self._joints.recovering & np.logical_and.reduce(small)
        outliers = self._gate.outliers(innovations, yaw_rate, whole & ~swings)
        left_out = np.logical_or.reduce(outliers)
        accepted = whole & ~left_out
        if left_out.any():
            self.outliers += int(outliers.sum())
            self._offset = before
            self.deviation = self._offset.step(z, np.broadcast_to(accepted & ~near, z.shape))
            for axle in np.flatnonzero(left_out).tolist():
                self._bank.leave_out(axle)
        e, w = (np.where(accepted, x, 0.0) for x in (innovations, w))
        needs_reset = self._gate.learn(e, yaw_rate, accepted & ~swings, outliers)
        needs_reset |= [not self._bank.finite(axle) for axle in range(self.axles)]
        self._noise.step(z, accepted & ~near)
        self.started |= accepted
        # Keep the first innovation after a gap out of the window: it spans several ticks. A sensor slower than the
        # ticks, for which no gain here is made, therefore never gives an estimate.
        in_window = accepted & self._complete & np.isfinite(tick.torque_ratio) & ~needs_reset
        self._complete = accepted.copy()  # reset() changes it, and not the record
        live, calm = self._put(tick, w, in_window, pulse, near)
        if self._wrcd:
            self._window.add(self._bands.step(z, accepted & ~near, self.speed_m_s))
        self._look_back(tick.number + 1)
        return Stepped(innovations, w, accepted, left_out, near, live, calm, needs_reset)

    def _look_back(self, ticks: int) -> None:
        """After so many ticks: whether the rail has changed, at a block's end; the memory, and the sensors."""
        if not self._wrcd:
            return
        if ticks % BLOCK_TICKS == 0:
            with quiet():
                changed = self._changes.changed(self._window, self.speed_m_s)
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
            sound = self.health.state == PairState.SOUND
            self.slides.look(self._answers.estimate(draft), sound, draft.lasted, step_s)
            whole = draft.blocks[0] * BLOCK_TICKS >= self.design.window_ticks
            memory = remember(
                Remembered(*self._memory), usual.word, whole, recent.word, recent.live_share,
                draft.in_use_pct(recent.mu_from_rules_pct), step_s, self.speed_m_s,
            )  # fmt: skip
            if looks:
                sums = self._window.kept(0, SPAN_BLOCKS)[PLAIN_IN_BANDS]
                self.health.look(sums, self._bands.goes_on, self.speed_m_s, draft.now, usual.inputs)
        self._memory = np.array(memory)
        another = memory.another >= ANOTHER_STEPS
        if another.any():
            self._window.truncate(self._changes.recent_blocks, another)

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
            found = self._answers.estimate(self._draft())
            return replace(found, half_width_pp=found.half_width_pp + self.slides.wider_pp(found))

    def _draft(self) -> Draft:
        """What an estimate of this moment is made from. Within quiet()."""
        factor = self._noise.sensor_factor()
        sound = self.health.partner_sound
        return self._answers.draft(self._window, factor, self.speed_m_s, self._in_grid, self._memory, sound)

    def torque_now(self) -> FloatArray:
        """(n,): torque ratio of the moment; NaN where it is not known."""
        with quiet():
            return self._answers.torque_now(self._window)

    def inputs_of(self, blocks: IntArray, now: FloatArray) -> FloatArray:
        """What the rules are given (m, COLUMNS) of windows of so many blocks (m,): all axles with one length after all
        with another. now (n,): torque ratio of the moment."""
        with quiet():
            factor, sound = self._noise.sensor_factor(), self.health.partner_sound
            return self._answers.inputs_of(self._window, blocks, now, factor, self._in_grid, sound)[0]

    def steps(self) -> FloatArray:
        """Decades (n, 4) by which the newest part's residuals lie above those of the rest of the usual window."""
        with quiet():
            return self._changes.steps(self._window)

    def features(self) -> FloatArray:
        """(n, FEATURES) that pairs of sensors are judged by, after a look: they stay those of the newest span in which
        an axle had data."""
        return self.health.features(self.speed_m_s, self.torque_now())

    @property
    def _in_grid(self) -> float:
        """The speed, held within the design's grid."""
        low, high = self._grid
        return min(max(self.speed_m_s, low), high)
