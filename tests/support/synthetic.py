"""Frames made in memory for any configuration: what its sensors would send on a track that the design expects."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from wrcd.bus.dbc import Message, cycle_ms, data_id, find_message, find_signal
from wrcd.bus.frame import Frame
from wrcd.bus.positions import Branch, frame_length
from wrcd.bus.readers import SignalReader
from wrcd.bus.signals import Output, Source, StatusRule
from wrcd.bus.statuses import rules_of
from wrcd.bus.units import Quantity
from wrcd.bus.writers import Writer
from wrcd.core.configuration import Config
from wrcd.estimator.design import CHANNELS, MODELS, STATES, Design, FloatArray

START_US = 1_700_000_000_000_000
SPEED_M_S, TORQUE_RATIO = 25.0, 0.1  # held within the design's speeds
SEED = 1
# Innovations as a share of what the design reckons with. On a good track the estimator steps blocks of ticks at once;
# on a rough one most ticks are near a pulse, as at joints, and are stepped one by one: the most that a tick costs.
GOOD_TRACK, ROUGH_TRACK = 0.01, 0.03

ValueOf = Callable[[Source], float]


class Synthetic:
    """All input frames of a configuration, tick by tick, the statuses that come in messages of their own included.

    A wheelset's measurements are what the design's last model expects of itself: x' = Phi (x + K e), z = H x + e,
    with innovations e of their design size. So they are limited to the band of a real wheelset, and pass every check.
    """

    def __init__(self, config: Config, roughness: float = GOOD_TRACK) -> None:
        d = config.design
        self._period_us = round(1e6 * d.tick_s)
        wanted = SPEED_M_S if config.constant_speed_m_s is None else config.constant_speed_m_s
        self._speed_m_s = float(np.clip(wanted, d.speeds_m_s[0], d.speeds_m_s[-1]))
        self._signals = wheelsets(d, self._speed_m_s, len(config.axles), roughness)
        self._constant = {
            Quantity.TORQUE: TORQUE_RATIO * 2 * d.normal_N * d.r_0,
            Quantity.SPEED: self._speed_m_s,
            Quantity.BRAKE_TORQUE: 0.0,
            Quantity.AXLE_LOAD: 2 * d.normal_N,
            Quantity.DIRECTION: 1.0,
            Quantity.WHEEL_RADIUS: d.r_0,
        }
        sources = [i.source for i in config.inputs]
        rules = [r for s in sources for r in rules_of(find_message(config.database, s.message), s)]
        read = [s.message for s in sources]
        # a status before what it is about
        names = dict.fromkeys([r.message for r in rules if r.message not in read] + read)
        self._messages = [_Sender(config, name, self._period_us, sources, rules) for name in names]
        self._measured: dict[Quantity, FloatArray] = {}  # (n,) each, of the tick
        self._number = START_US // self._period_us

    def ticks(self, count: int) -> Iterator[list[Frame]]:
        """The frames of each of the next ticks."""
        for _ in range(count):
            begin_us = self._number * self._period_us
            self._number += 1
            self._measured = dict(zip((Quantity.YAW_RATE, Quantity.LAT_ACCEL), next(self._signals), strict=True))
            out: list[Frame] = []
            for place, message in enumerate(self._messages):
                stamp_us = begin_us + place * self._period_us // (len(self._messages) + 1)
                out += message.frames(begin_us, stamp_us, self._value)
            yield out

    def _value(self, s: Source) -> float:
        if s.part:  # the first part is all of it
            return 0.0
        return (
            float(self._measured[s.quantity][s.axles[0]])
            if s.quantity in self._measured
            else self._constant[s.quantity]
        )


class _Sender:
    """One message that carries inputs or a status, sent once in each of its cycles; with multiplexers, all that it
    carries, frame after frame."""

    def __init__(
        self, config: Config, name: str, period_us: int, sources: list[Source], rules: list[StatusRule]
    ) -> None:
        self._message = message = find_message(config.database, name)
        self._cycle_us = max((cycle_ms(message) or 0) * 1000, period_us)
        self._period_us = period_us
        identity = config.data_ids[name] if name in config.data_ids else data_id(message)
        self._writer = Writer(message, Output(name, self._cycle_us, identity))
        self._signals = [(SignalReader(0, s, message), s) for s in sources if s.message == name]
        self._well = {r.signal: min(r.ok, default=0) for r in rules if r.message == name}
        length = frame_length(message)
        branches = [Branch(message, find_signal(message, s), length).example for s in self._well]
        branches += [reader.branch.example for reader, _ in self._signals]
        self._branches = [self._whole(b) for n, b in enumerate(branches) if b and b not in branches[:n]]
        self._sent = 0

    def _whole(self, branch: Mapping[str, int]) -> dict[str, int]:
        """Multiplexers' values, those of which it does not matter included: one that there is."""
        usual: dict[str, int] = {}
        for s in self._message.signals:
            if s.multiplexer_signal is not None:
                usual.setdefault(s.multiplexer_signal, min(s.multiplexer_ids or [0]))
        return {**usual, **branch}

    def frames(self, begin_us: int, stamp_us: int, value: ValueOf) -> Iterator[Frame]:
        """The frames of the tick that begins at begin_us, if it is due in it."""
        if begin_us // self._cycle_us == (begin_us - self._period_us) // self._cycle_us:
            return
        raw = {**self._well, **{s.signal: encoded(reader, s, self._message, value(s)) for reader, s in self._signals}}
        for branch in self._branches or [{}]:
            yield self._writer.raw_frame(stamp_us, self._sent, {**raw, **branch})
            self._sent += 1
            stamp_us += 1


def encoded(reader: SignalReader, source: Source, message: Message, value: float) -> float:
    """The raw value that a reader takes for the nearest to a quantity, in SI units."""
    signal = find_signal(message, source.signal)
    if source.quantity is Quantity.DIRECTION and signal.choices:
        return next((raw for raw in signal.choices if reader.read(raw) == value), 0)
    physical = min(max(value / reader.factor, reader.low), reader.high)
    raw = (physical - float(reader.offset)) / float(reader.scale)
    if signal.is_float:
        return raw
    whole = round(raw)
    while whole in reader.unusable:
        whole += 1
    return whole


def wheelsets(d: Design, speed_m_s: float, axles: int, roughness: float) -> Iterator[FloatArray]:
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
