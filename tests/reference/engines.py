"""Both engines over one log, and the largest difference between them."""

from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.brief import load_source
from tests.reference.filters import (
    Band,
    Filters,
    FourthDifferences,
    LiveFilters,
    Models,
    RunningMean,
    Schedule,
    TrackedSpeed,
)
from tests.reference.rules import FuzzyReference, Row, SlidingWindow
from wrcd.core.configuration import Config
from wrcd.core.core import Core, Observer
from wrcd.estimator.design import Design
from wrcd.estimator.records import Estimate, StepResult, Tick
from wrcd.logs.columns import Stretch
from wrcd.logs.reader import LogReader
from wrcd.logs.time_order import frames_of

FloatArray = NDArray[np.float64]
MAX_INNOVATION = 1e-9  # relative to the largest innovation of the log
MAX_FUZZY = 0.1
DELAY_TICKS = 4


@dataclass(slots=True)
class Findings:
    """What the comparison came to."""

    ticks: int = 0
    partial: int = 0  # ticks of which an axle's only channel, or an absurd sample, was left out
    innovation: float = 0.0  # largest difference
    largest: float = 0.0  # largest innovation
    live_square: float = 0.0  # of the differences to filters that carry their covariances
    square: float = 0.0  # of those filters' innovations
    fast: list[float] = field(default_factory=list)
    inputs: list[FloatArray] = field(default_factory=list)
    fuzzy: float = 0.0

    @property
    def agree(self) -> bool:
        """Whether the engines differ by no more than rounding."""
        return self.innovation <= MAX_INNOVATION * self.largest and self.fuzzy <= MAX_FUZZY


class BothEngines(Observer):
    """The reference beside the engine of the train: an observer of the core, shown the same ticks."""

    def __init__(self, design: Design, axles: int, models: Models, fuzzy_every_ticks: int) -> None:
        self.findings = Findings()
        self._schedule = Schedule(design)
        self._axles = [_Axle(design, models) for _ in range(axles)]
        self._fuzzy_reference = FuzzyReference(design)
        self._tracked = TrackedSpeed(design.tick_s)
        self._every, self._compared = fuzzy_every_ticks, -fuzzy_every_ticks
        self._at_m_s = 1.0

    def was_reset(self, axle: int) -> None:
        """The reference forgets, too."""
        self._axles[axle].reset()
        if not any(a.started for a in self._axles):
            self._tracked.reset()

    def stepped(self, tick: Tick, result: StepResult) -> None:
        """Step the reference and compare the innovations. Which samples to use and which are pulses the fast one
        says."""
        f = self.findings
        f.ticks += 1
        z, e, number = tick.z, result.innovations, tick.number
        self._at_m_s = speed = self._tracked.step(tick.speed_m_s)
        matrices = self._schedule.at(speed)
        for a, axle in enumerate(self._axles):
            used = bool(result.accepted[a])
            calm = used and not result.near_pulse[a]
            reference = axle.filter(z[:, a], used, calm, matrices)
            axle.noise.step(z[:, a], calm)
            whitened = np.array([matrices[3][m] @ reference[m] for m in range(4)])
            axle.started |= used
            if axle.started:
                live_calm = bool(result.live[a]), bool(result.calm[a])
                axle.put(number, whitened, live_calm, float(tick.torque_ratio[a]), speed)
                if number % 16 == 15:
                    noise, held = self._schedule.noise_power(speed), self._schedule.held(speed)
                    axle.window.remember(noise, axle.noise.factor(), held, self._fuzzy_reference.answer)
            live = axle.live.step(axle.z, used, speed)
            f.partial += bool(tick.present[:, a].any()) and not used
            if not used:
                continue
            f.innovation = max(f.innovation, float(np.abs(e[:, :, a] - reference).max()))
            f.largest = max(f.largest, float(np.abs(reference).max()))
            f.live_square += float(np.square(e[:, :, a] - live).sum())
            f.square += float(np.square(live).sum())

    def estimated(self, tick: int, estimate: Estimate) -> None:
        """Now and then keep what an estimate was made from for the comparison."""
        if tick - self._compared >= self._every:
            self._compared = tick
            noise, speed = self._schedule.noise_power(self._at_m_s), self._schedule.held(self._at_m_s)
            for a, axle in enumerate(self._axles):
                inputs = axle.window.inputs(noise, axle.noise.factor(), speed)
                if inputs is not None:
                    self.findings.inputs.append(inputs)
                    self.findings.fast.append(float(estimate.fuzzy[a]))


class _Axle:
    """The reference of one axle."""

    def __init__(self, design: Design, models: Models) -> None:
        self._paper = design.form == "paper"
        self._mean = RunningMean(2 * design.window_ticks)
        self._filters, self.live = Filters(design.states), LiveFilters(models)
        self._band, self.window = Band(design.lowpass), SlidingWindow(design)
        self.noise = FourthDifferences(design.noise_rms)
        self.z = np.zeros(2)
        self.reset()

    def reset(self) -> None:
        """Nothing seen yet."""
        for part in (self._mean, self._filters, self.live, self._band, self.window, self.noise):
            part.reset()
        self.started = False  # whether a measurement was used since
        self._delayed = deque([np.zeros((4, 2))] * DELAY_TICKS)
        self._past = deque([np.zeros(8)] * DELAY_TICKS)

    def filter(self, z: FloatArray, used: bool, teaches: bool, matrices: list[FloatArray]) -> FloatArray:
        """Innovations (4, 2); what is near a pulse teaches no offset."""
        self.z = self._mean.take_off(z, teaches)
        return self._filters.step(self.z, used, matrices)

    def put(
        self, tick: int, whitened: FloatArray, live_calm: tuple[bool, bool], ratio: float, speed_m_s: float
    ) -> None:
        """The window gets the innovations of DELAY_TICKS before, through the band's filter; zeros if not live."""
        self._delayed.append(whitened)
        before = self._delayed.popleft()
        raw = before if live_calm[0] else np.zeros((4, 2))
        w = raw if self._paper else self._band.step(raw)
        self._past.append(w.ravel())
        self.window.put(Row(tick, w.ravel(), self._past.popleft(), raw.ravel(), *live_calm, ratio), speed_m_s)


def compare(log: Path, config: Config, fuzzy_every_s: float) -> Findings:
    """Run both engines over a log."""
    design = config.design
    every = max(1, round(fuzzy_every_s / design.tick_s))
    both = BothEngines(design, len(config.axles), Models(load_source(config.design_file)), every)
    core = Core(config, observer=both)
    with LogReader(log, shows=True) as reader:
        for item in reader.written():
            for frame, _ in frames_of(item) if isinstance(item, Stretch) else (item,):
                core.feed(frame)
    f = both.findings
    if f.inputs:
        reference = FuzzyReference(design).outputs(np.array(f.inputs))
        fast = np.array(f.fast)
        both_speak = np.isfinite(fast) & np.isfinite(reference)
        f.fuzzy = float(np.abs(fast - reference)[both_speak].max(initial=0.0))
    return f
