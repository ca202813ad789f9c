"""`wrcd check --speed`: what the core costs on this computer, on frames made in memory. No bus, no rig."""

import gc
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrcd.bus.codec import STATUS, USABLE, Value, Writer, normalise_label, unusable
from wrcd.bus.dbc import Message, Signal, cycle_ms, find_message, find_signal
from wrcd.bus.frame import Frame
from wrcd.bus.units import Quantity, factor
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.estimator.design import CHANNELS, MODELS, STATES, Design, FloatArray
from wrcd.tools.progress import Progress

# Measured by this very command with the default design, ticks of 5 ms.
REFERENCE_CPU = "Intel Xeon (family 6, model 167), one of two shared virtual cores"
REFERENCE_DATE = "2026-11-22"
REFERENCE_US = {1: 207.0, 4: 306.0, 6: 364.0, 8: 394.0}  # axles: microseconds a tick

BUDGET_S = 8.0  # of the whole command: less than ten seconds with the start
BLOCK_S = 1.0  # of the core's own time: every cycle of outgoing frames comes once
MIN_BLOCKS = 3
START_US = 1_700_000_000_000_000
SPEED_M_S, TORQUE_RATIO = 25.0, 0.1  # held within the design's speeds
SEED = 1
# Innovations as a share of what the design reckons with. On a good track the estimator steps blocks of ticks at once;
# on a rough one most ticks are near a pulse, as at joints, and are stepped one by one: the most that a tick costs.
GOOD_TRACK, ROUGH_TRACK = 0.01, 0.03


@dataclass(frozen=True, slots=True)
class Speed:
    """Microseconds a tick: of processor time, the median of the blocks' means, and the same on a rough track; of real
    time, the longest single tick, with whatever else the computer did meanwhile.

    valid and estimating are numbers of axles: those whose newest Adhesion frame is Valid, and those with an estimate.
    """

    axles: int
    tick_s: float
    blocks: int
    tick_us: float
    rough_us: float
    largest_us: float
    estimating: tuple[int, ...]
    valid: tuple[int, ...]

    @property
    def share(self) -> float:
        """Of one core at the configured tick."""
        return self.tick_us / (1e6 * self.tick_s)

    @property
    def ratio(self) -> float:
        """How many times as long as on the reference machine, with as many axles."""
        return self.tick_us / reference_us(self.axles)


def reference_us(axles: int) -> float:
    """Microseconds a tick on the reference machine; linear between the numbers of axles that were measured."""
    return float(np.interp(axles, list(REFERENCE_US), list(REFERENCE_US.values())))


class Synthetic:
    """All input frames of a configuration, tick by tick.

    A wheelset's measurements are what the design's last model expects of itself: x' = Phi (x + K e), z = H x + e,
    with innovations e of their design size. So they are limited to the band of a real wheelset, and pass every check.
    """

    def __init__(self, config: Config, roughness: float = GOOD_TRACK) -> None:
        d = config.design
        self._period_us = round(1e6 * d.tick_s)
        self._n = len(config.axles)
        wanted = SPEED_M_S if config.constant_speed_m_s is None else config.constant_speed_m_s
        self._speed_m_s = float(np.clip(wanted, d.speeds_m_s[0], d.speeds_m_s[-1]))
        self._signals = _wheelsets(d, self._speed_m_s, self._n, roughness)
        self._constant = {
            Quantity.TORQUE: TORQUE_RATIO * 2 * d.normal_N * d.r_0,
            Quantity.SPEED: self._speed_m_s,
            Quantity.BRAKE_TORQUE: 0.0,
            Quantity.AXLE_LOAD: 2 * d.normal_N,
            Quantity.DIRECTION: 1.0,
            Quantity.WHEEL_RADIUS: d.r_0,
        }
        names = dict.fromkeys(i.source.message for i in config.inputs)
        self._messages = [_Input(config, name, self._period_us) for name in names]
        self._measured: dict[Quantity, FloatArray] = {}  # (n,) each, of the tick
        self._number = START_US // self._period_us

    def ticks(self, count: int) -> Iterator[list[Frame]]:
        """The frames of each of the next ticks."""
        for _ in range(count):
            begin_us = self._number * self._period_us
            self._number += 1
            self._measured = dict(zip((Quantity.YAW_RATE, Quantity.LAT_ACCEL), next(self._signals), strict=True))
            out = []
            for place, message in enumerate(self._messages):
                stamp_us = begin_us + place * self._period_us // (len(self._messages) + 1)
                frame = message.frame(begin_us, stamp_us, self._value)
                if frame is not None:
                    out.append(frame)
            yield out

    def _value(self, q: Quantity, axle: int) -> float:
        return float(self._measured[q][axle]) if q in self._measured else self._constant[q]


class _Input:
    """One message that carries inputs, sent once in each of its cycles."""

    def __init__(self, config: Config, name: str, period_us: int) -> None:
        message = find_message(config.database, name)
        self._writer = Writer(message)
        self._cycle_us = max((cycle_ms(message) or 0) * 1000, period_us)
        self._period_us = period_us
        self._sources = [
            (i.source.signal, i.source.quantity, i.source.axles[0], find_signal(message, i.source.signal))
            for i in config.inputs
            if i.source.message == name
        ]
        self._fixed = _status(message)

    def frame(self, begin_us: int, stamp_us: int, value: Callable[[Quantity, int], float]) -> Frame | None:
        """The frame of the tick that begins at begin_us, or None where none is due."""
        slot = begin_us // self._cycle_us
        if slot == (begin_us - self._period_us) // self._cycle_us:
            return None
        values: dict[str, Value] = dict(self._fixed)
        for name, q, axle, signal in self._sources:
            forward = _forward(signal) if q is Quantity.DIRECTION else None
            values[name] = forward or value(q, axle) / factor(signal.unit, q)
        return self._writer.frame(stamp_us, slot, values)


def _status(message: Message) -> dict[str, Value]:
    """What says that the sender is well, where the message has a status."""
    status = next((s for s in message.signals if s.name == STATUS), None)
    if status is None:
        return {}
    labels = [str(label) for label in (status.choices or {}).values() if normalise_label(label) in USABLE]
    return {STATUS: labels[0] if labels else 0.0}


def _forward(signal: Signal) -> str | None:
    """The word for forwards, where the direction has words."""
    words = [str(label) for label in (signal.choices or {}).values() if not unusable(label)]
    return next((w for w in words if not any(back in w.lower() for back in ("rev", "back"))), None)


def _wheelsets(d: Design, speed_m_s: float, axles: int, roughness: float) -> Iterator[FloatArray]:
    """z (2, n) of tick after tick, as the last model (the linear region) expects them; each axle has its own noise."""
    Phi, K, H = (t[int(np.argmin(np.abs(d.speeds_m_s - speed_m_s))), MODELS - 1] for t in (d.Phi, d.K, d.H))
    # R S^-1 = I - H K, with R the sensors' noise: the size of the innovations follows from the gain
    S = np.linalg.solve(np.eye(CHANNELS) - H @ K, np.diag(np.square(d.noise_rms)))
    size = np.linalg.cholesky(0.5 * (S + S.T))
    rng = np.random.default_rng(SEED)
    x = np.zeros((STATES, axles))
    while True:
        e = roughness * size @ rng.standard_normal((CHANNELS, axles))
        z = H @ x + e
        x = Phi @ (x + K @ e)
        yield z


def measure(config: Config, progress: Progress | None = None) -> Speed:
    """Feed cores for BUDGET_S of this computer's time: three quarters of it a good track, the rest a rough one."""
    progress = progress or Progress()
    usual = _run(config, GOOD_TRACK, 0.75 * BUDGET_S, progress)
    rough = _run(config, ROUGH_TRACK, 0.25 * BUDGET_S, progress)
    progress.end()
    validity = {
        a.number: _validity(find_message(config.database, a.adhesion.message), usual.newest) for a in config.axles
    }
    return Speed(
        axles=len(config.axles),
        tick_s=config.design.tick_s,
        blocks=len(usual.means_us),
        tick_us=statistics.median(usual.means_us),
        rough_us=statistics.median(rough.means_us),
        largest_us=1e-3 * max(usual.longest_ns, rough.longest_ns),
        estimating=tuple(a for a, v in validity.items() if v in ("Valid", "Degraded")),
        valid=tuple(a for a, v in validity.items() if v == "Valid"),
    )


@dataclass(slots=True)
class _Run:
    """Mean of each block, the longest tick in real time, and the newest frame of each id that was made."""

    means_us: list[float]
    longest_ns: int
    newest: dict[int, Frame]


def _run(config: Config, roughness: float, budget_s: float, progress: Progress) -> _Run:
    """Feed a core of its own, at least MIN_BLOCKS blocks after its window is full.

    Frames are made before a block begins: only what the core does with them is timed.
    """
    d = config.design
    core, source = Core(config), Synthetic(config, roughness)
    block = max(1, round(BLOCK_S / d.tick_s))
    begin = time.perf_counter()
    for frames in source.ticks(round(d.longest_s / d.tick_s) + block):
        for frame in frames:
            core.feed(frame)
    gc.collect()
    gc.freeze()  # as the daemon does when it is ready
    out = _Run([], 0, {})
    try:
        while len(out.means_us) < MIN_BLOCKS or time.perf_counter() - begin < budget_s:
            progress.at("speed", min((time.perf_counter() - begin) / budget_s, 1.0))
            cpu_ns, longest_ns, sent = _timed(core, list(source.ticks(block)))
            out.means_us.append(1e-3 * cpu_ns / block)
            out.longest_ns = max(out.longest_ns, longest_ns)
            out.newest |= {frame.can_id: frame for frame in sent}
    finally:
        gc.unfreeze()
    return out


def _timed(core: Core, ticks: list[list[Frame]]) -> tuple[int, int, list[Frame]]:
    """Nanoseconds of this thread's processor time for all ticks, of real time for the longest, and the frames made."""
    longest_ns, sent = 0, list[Frame]()
    feed, clock = core.feed, time.perf_counter_ns
    begin_cpu_ns = time.thread_time_ns()
    for frames in ticks:
        begin_ns = clock()
        made = [o for frame in frames for o in feed(frame)]
        longest_ns = max(longest_ns, clock() - begin_ns)
        sent += [o.frame for o in made]
    return time.thread_time_ns() - begin_cpu_ns, longest_ns, sent


def _validity(message: Message, newest: dict[int, Frame]) -> str:
    """The word of the newest Adhesion frame's Validity."""
    frame = newest.get(message.frame_id)
    if frame is None:
        return "NotAvailable"
    values = message.decode(frame.data)
    assert isinstance(values, dict)
    return str(values["Validity"])


def describe(s: Speed) -> list[str]:
    """Lines for a person."""
    return [
        f"speed          {s.tick_us:.0f} µs a tick of {1e3 * s.tick_s:g} ms ({s.axles} axle{'s' * (s.axles > 1)}, "
        f"median of {s.blocks} blocks of {BLOCK_S:g} s): {100 * s.share:.1f} % of a core",
        f"               {s.rough_us:.0f} µs a tick on a rough track",
        f"               longest tick {1e-3 * s.largest_us:.2f} ms, interruptions by others included",
        f"               {s.ratio:.2f} times the reference, {reference_us(s.axles):.0f} µs ({REFERENCE_CPU}, "
        f"{REFERENCE_DATE})",
        f"computer       {cpu()}",
        f"estimates      axles {_list(s.estimating)}; Valid: {_list(s.valid)}"
        + ("" if len(s.estimating) == s.axles else "; the others cost less than they will"),
    ]


def speed(config: Config) -> int:
    """Measure and print. 1 where an axle gave no estimate: then the figure lacks a part of the work."""
    s = measure(config, progress=Progress())
    print("\n".join(describe(s)))
    return 0 if len(s.estimating) == s.axles else 1


def _list(numbers: tuple[int, ...]) -> str:
    return ", ".join(map(str, numbers)) or "none"


def cpu() -> str:
    """The processor's name, as the kernel tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    # "model name" on x86, "Model" on most ARM boards
    names = (line.partition(":")[2].strip() for line in lines if line.lower().startswith(("model name", "model\t\t:")))
    return next((n for n in names if not n.isdigit()), "unknown processor")
