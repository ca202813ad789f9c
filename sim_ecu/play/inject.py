"""Measurements become frames, with faults on the way. The same scenario and faults give the same frames."""

import heapq
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from sim_ecu.play.encoder import SAMPLE_US, SensorSample, Sent
from sim_ecu.play.faults import Fault
from sim_ecu.play.frame_faults import FrameFault, frame_fault
from sim_ecu.play.mapped import Train
from sim_ecu.play.train import PACKAGED

SPIKE_EVERY_US = 100_000
_Key = tuple[str, int]  # signal and axle; the speed's axle is 0


def other_axle(axle: int, numbers: Sequence[int]) -> int:
    """The one that an axle is swapped with: the scenario's next."""
    return numbers[(numbers.index(axle) + 1) % len(numbers)]


def inject(
    samples: Iterable[SensorSample], faults: Sequence[Fault], numbers: Sequence[int], seed: int, truth: bool = True,
    train: Train = PACKAGED,
) -> Iterator[tuple[int, list[Sent]]]:  # fmt: skip
    """The frames of every sample in the order of their due times, each sample in two halves so that a player that
    sends a half at once keeps frames beside each other that the faults put there."""
    encoder = train.encoder(numbers, truth)
    signal_faults, frame_faults = at_work(faults, numbers, seed, train)
    held: list[tuple[int, int, Sent]] = []  # what is due later; a number keeps the order of those due at once
    order = itertools.count()
    for measured in _measured(samples, signal_faults):
        frames = list(encoder.frames(measured))
        for fault in frame_faults:
            frames = fault.take(frames)
        beside = [f for fault in frame_faults if fault.on(measured.due_us) for f in fault.beside(measured)]
        for f in itertools.chain(frames, beside):
            heapq.heappush(held, (f.due_us, next(order), f))
        for half in (measured.due_us, measured.due_us + SAMPLE_US // 2):
            yield half, list(_until(held, half + SAMPLE_US // 2))
    if held:
        yield held[0][0], [heapq.heappop(held)[2] for _ in range(len(held))]


def at_work(
    faults: Sequence[Fault], numbers: Sequence[int], seed: int, train: Train
) -> tuple[list["SignalFault"], list[FrameFault]]:
    """The faults of signals and those of frames. Raises InputError for one that this train's messages leave no way
    to."""
    signal_faults = [SignalFault(f, numbers, train) for f in faults if f.kind in CHANGES]
    frame_faults = [
        frame_fault(f, [seed, 3, k], numbers, other_axle(f.axle, numbers), train)
        for k, f in enumerate(faults)
        if f.kind not in CHANGES
    ]
    return signal_faults, frame_faults


def _measured(samples: Iterable[SensorSample], faults: Sequence["SignalFault"]) -> Iterator[SensorSample]:
    """The samples with the faults of their signals."""
    before: SensorSample | None = None
    for sample in samples:
        measured = sample
        for s in faults:
            if s.fault.on(sample.due_us):
                measured = s.change(measured, before or sample)
        before = sample
        yield measured


def _until(held: list[tuple[int, int, Sent]], due_us: int) -> Iterator[Sent]:
    while held and held[0][0] < due_us:
        yield heapq.heappop(held)[2]


class SignalFault:
    """A fault of what sensors say: the change of one value, for each of its signals."""

    def __init__(self, fault: Fault, numbers: Sequence[int], train: Train) -> None:
        self.fault = fault
        self.keys: list[_Key] = [(s, 0 if s == "speed" else fault.axle) for s in fault.signals]
        self.other = other_axle(fault.axle, numbers)
        self.stands: dict[_Key, float] = {}  # all values before the fault
        self.rng = np.random.default_rng([fault.begin_us, fault.axle, *fault.of.encode()])  # no two are alike
        self.cycle_us = {s: train.cycle_us(s, fault.axle) for s in fault.signals}

    def change(self, sample: SensorSample, before: SensorSample) -> SensorSample:
        """The sample as it looks with the fault; before is the one before it."""
        self.stands = self.stands or _values(before)
        values = _values(sample)
        since_us = sample.due_us - self.fault.begin_us
        values |= {key: CHANGES[self.fault.kind](self, key, values, since_us) for key in self._keys_changed()}
        readings = tuple(
            replace(
                r,
                yaw_rate=values["yaw_rate", r.number],
                lat_accel=values["lateral_acceleration", r.number],
                torque=values["torque", r.number],
            )
            for r in sample.readings
        )
        return SensorSample(sample.due_us, values["speed", 0], readings)

    def _keys_changed(self) -> list[_Key]:
        if self.fault.kind != "swap-wiring":
            return self.keys
        return [(s, a) for s, _ in self.keys for a in (self.fault.axle, self.other)]


def _values(sample: SensorSample) -> dict[_Key, float]:
    values: dict[_Key, float] = {("speed", 0): sample.speed_m_s}
    for r in sample.readings:
        values["yaw_rate", r.number] = r.yaw_rate
        values["lateral_acceleration", r.number] = r.lat_accel
        values["torque", r.number] = r.torque
    return values


def _dead(f: SignalFault, key: _Key, values: dict[_Key, float], _since_us: int) -> float:
    noise = f.fault.size(key[0])
    return noise * float(f.rng.standard_normal()) if noise > 0.0 else values[key]


# What a sensor says instead, by the fault, whose value it is, all values, and the time since its begin in us
CHANGES: dict[str, Callable[[SignalFault, _Key, dict[_Key, float], int], float]] = {
    "reverse": lambda _f, key, values, _t: -values[key],
    "dead": _dead,
    "bias": lambda f, key, values, _t: values[key] + f.fault.size(key[0]),
    "drift": lambda f, key, values, t: values[key] + f.fault.size(key[0]) * t * 1e-6,
    "freeze": lambda f, key, _values, _t: f.stands[key],
    "spike": lambda f, key, values, t: values[key] + (t % SPIKE_EVERY_US < f.cycle_us[key[0]]) * f.fault.size(key[0]),
    "swap-wiring": lambda f, key, values, _t: values[key[0], f.other if key[1] == f.fault.axle else f.fault.axle],
}
