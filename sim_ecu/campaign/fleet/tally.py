"""What a log's replay comes to: shares, causes, classes over way and time, suspects. Nothing of it grows with the log
but the steps of way and time."""

import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim_ecu.campaign.fleet.suspects import RefusalTally, Suspect, SuspectSpells
from wrcd.bus.codec import Sample, message_key
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.units import Quantity
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core, Observer
from wrcd.core.vocabulary import MESSAGES, SURFACES, Words
from wrcd.logs.decoder import MessageDecoder

STEP_M, STEP_S = 100.0, 10.0
BLOCK = 20_000  # frames of an axle that are held before they are added up
MAX_HOLD_US = 1_000_000  # a speed that nothing has followed for so long is not known any more
VEHICLE = (Quantity.SPEED, Quantity.DIRECTION)
_WORDS = MESSAGES["adhesion"]["Validity"]
assert isinstance(_WORDS, Words)
VALIDITIES = _WORDS.words

NOT_VALID = "not Valid"
CLASSES = (*(name for _, name in SURFACES), NOT_VALID)  # the most slippery last but one
_LOWS = np.array(sorted(low for low, _ in SURFACES))[1:]  # from which the next better one begins
N = len(CLASSES)

FloatArray = NDArray[np.float64]


def classes(valid: NDArray[np.bool_], mu_pct: FloatArray) -> NDArray[np.int64]:
    """The place in CLASSES of each frame (n,): what is not Valid, or says no adhesion, is of none of the surfaces."""
    better = np.searchsorted(_LOWS, mu_pct, side="right")
    return np.where(valid & np.isfinite(mu_pct), N - 2 - better, N - 1)


class Bins:
    """What falls into equal steps (of way or time), by class. It grows as the log goes on."""

    def __init__(self, step: float) -> None:
        self.step = step
        self._sums = np.zeros((0, N))

    def add(self, at: FloatArray, of: NDArray[np.int64], amounts: FloatArray) -> None:
        """Amounts (n,) of classes at places of the way or time (n,), from 0 on."""
        if not len(at):
            return
        steps = (at / self.step).astype(np.int64)
        missing = int(steps.max()) + 1 - len(self._sums)
        if missing > 0:
            self._sums = np.concatenate((self._sums, np.zeros((missing, N))))
        self._sums += np.bincount(steps * N + of, amounts, self._sums.size).reshape(-1, N)

    @property
    def total(self) -> FloatArray:
        """(N,), of all steps."""
        return np.asarray(self._sums.sum(axis=0), dtype=np.float64)

    def merged(self, step: float) -> FloatArray:
        """(n, N) by a step that is a multiple of the own one."""
        return merged(self._sums, round(step / self.step))


def merged(sums: FloatArray, many: int) -> FloatArray:
    """(ceil(n / many), N): so many steps as one; the last may be shorter."""
    if many == 1 or not len(sums):
        return sums
    return np.add.reduceat(sums, np.arange(0, len(sums), many), axis=0)


@dataclass(slots=True)
class AxleTally:
    """One axle's Adhesion frames, added up by blocks."""

    number: int
    decoder: MessageDecoder
    frames: int = 0
    by_validity: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(VALIDITIES), np.int64))
    by_cause: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(Cause), np.int64))
    spells: SuspectSpells = field(default_factory=SuspectSpells)
    way: Bins = field(default_factory=lambda: Bins(STEP_M))
    time: Bins = field(default_factory=lambda: Bins(STEP_S))
    metres: float = 0.0
    _stamps_us: "array[int]" = field(default_factory=lambda: array("q"))
    _data: bytearray = field(default_factory=bytearray)
    _causes: bytearray = field(default_factory=bytearray)

    @property
    def cycle_s(self) -> float:
        """The time that a frame stands for."""
        return self.decoder.cycle_us * 1e-6

    @property
    def newest_us(self) -> int:
        """The stamp of the newest frame that is held, 0: none is."""
        return self._stamps_us[-1] if self._stamps_us else 0

    @property
    def seconds(self) -> float:
        """The time that this axle's frames stand for."""
        return self.frames * self.cycle_s

    def put(self, frame: Frame, cause: Cause) -> bool:
        """Take a frame; whether a block is full."""
        self._stamps_us.append(frame.stamp_us)
        self._data += frame.data
        self._causes.append(cause)
        return len(self._causes) >= BLOCK

    def add_up(self, speed: "Speed") -> None:
        """Add up what is held."""
        n = len(self._causes)
        if not n:
            return
        stamps_us = np.array(self._stamps_us, np.int64)
        causes = np.frombuffer(bytes(self._causes), np.uint8)
        values = self.decoder.read(np.frombuffer(bytes(self._data), np.uint8).reshape(n, -1))
        self._stamps_us, self._data, self._causes = array("q"), bytearray(), bytearray()
        validity = values["Validity"].astype(np.int64).clip(0)
        of = classes(validity == VALIDITIES.index(Validity.VALID), values["MuAvailable"].astype(np.float64))
        seconds: FloatArray = np.full(n, self.cycle_s)
        metres: FloatArray = speed.at(stamps_us) * seconds
        self.by_validity += np.bincount(validity, minlength=len(VALIDITIES))
        self.by_cause += np.bincount(causes, minlength=len(self.by_cause))
        way: FloatArray = np.concatenate(([self.metres], self.metres + np.cumsum(metres)[:-1]), dtype=np.float64)
        time: FloatArray = np.arange(self.frames, self.frames + n, dtype=np.float64) * self.cycle_s
        self.way.add(way, of, metres)
        self.time.add(time, of, seconds)
        self.metres += float(metres.sum())
        self.frames += n


class Speed:
    """The vehicle's speed as its accepted frames say, or as the configuration states."""

    def __init__(self, constant_m_s: float | None) -> None:
        self._constant = constant_m_s
        self._stamps_us: array[int] = array("q")
        self._values: array[float] = array("d")

    def put(self, stamp_us: int, speed_m_s: float) -> None:
        """An accepted frame's."""
        self._stamps_us.append(stamp_us)
        self._values.append(abs(speed_m_s))

    def at(self, stamps_us: NDArray[np.int64]) -> FloatArray:
        """The newest value at each time; 0 where there is none."""
        if self._constant is not None:
            return np.full(len(stamps_us), abs(self._constant))
        if not len(self._stamps_us):
            return np.zeros(len(stamps_us))
        known = np.maximum.accumulate(np.array(self._stamps_us, np.int64))
        places = np.searchsorted(known, stamps_us, side="right") - 1
        newest = places.clip(0)
        fresh = (places >= 0) & (stamps_us - known[newest] <= MAX_HOLD_US)
        return np.where(fresh, np.array(self._values)[newest], 0.0)

    def forget(self, before_us: int) -> None:
        """Let go of what no later time can need."""
        old = int(np.searchsorted(np.array(self._stamps_us, np.int64), before_us - MAX_HOLD_US))
        self._stamps_us, self._values = self._stamps_us[old:], self._values[old:]


class Tally(Observer):
    """An observer of a core that replays a log."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self.axles: dict[int, AxleTally] = {}  # by Frame.key
        for a in config.axles:
            message = find_message(config.database, a.adhesion.message)
            decoder = MessageDecoder(message, a.adhesion, "adhesion", a.number)
            self.axles[message_key(message)] = AxleTally(a.number, decoder)
        self.speed = Speed(config.constant_speed_m_s)
        self._messages = [i.source.message for i in config.inputs]
        quantities = [i.source.quantity for i in config.inputs]
        self._speed_source = quantities.index(Quantity.SPEED) if Quantity.SPEED in quantities else -1
        self._of = {a.number: a for a in self.axles.values()}
        self._reported = self.taken = 0  # changes, accepted frames
        self.refusals = RefusalTally()
        self.correction_us = 0  # to what stamps are in the time that goes on

    def accepted(self, samples: Sequence[Sample], stamp_us: int) -> None:
        """Note the speed."""
        for s in samples:
            if s.source == self._speed_source and math.isfinite(s.value):
                self.speed.put(stamp_us + self.correction_us, s.value)
        self.taken += 1
        if samples:
            self.refusals.accepted[self._messages[samples[0].source]] += 1

    def sent(self, core: Core, frame: Frame, cause: Cause) -> None:
        """Take a frame that the core made, its stamp in the time that goes on."""
        axle = self.axles.get(frame.key)
        if axle is None:
            return
        if axle.put(frame, cause):
            self.add_up()
        self.look(core, frame.stamp_us)

    def look(self, core: Core, stamp_us: int) -> None:
        """Note what the core has refused and reported since the look before."""
        self.refusals.look(core.counts.rejected_by_message, stamp_us)
        events = core.events
        if events.total != self._reported:
            for change in events.since(self._reported):
                self._of[change.axle].spells.change(change.time_us + self.correction_us, change.cause, change.detail)
            self._reported = events.total

    def end(self, core: Core, stamp_us: int) -> None:
        """The log is over."""
        self.add_up()
        self.look(core, stamp_us)
        for axle in self.axles.values():
            axle.spells.change(stamp_us, Cause.NONE, "")

    def add_up(self) -> None:
        """Add up what is held of every axle."""
        newest_us = max((a.newest_us for a in self.axles.values()), default=0)
        for axle in self.axles.values():
            axle.add_up(self.speed)
        self.speed.forget(newest_us)

    def with_frames(self) -> list[AxleTally]:
        """The axles of which a frame came, good or not. Where there is none of any, all."""
        came = self.refusals.messages
        own: dict[int, set[str]] = {a.number: set() for a in self._config.axles}
        for i in self._config.inputs:
            if i.source.quantity not in VEHICLE:
                for place in i.source.axles:
                    own[self._config.axles[place].number].add(i.source.message)
        return [a for a in self.axles.values() if own[a.number] & came] or list(self.axles.values())

    def suspects(self, begin_us: int, end_us: int) -> Iterator[Suspect]:
        """Yield what was named in the log, from its begin to its end: sensors, then refused frames."""
        for axle in self.with_frames():
            yield from axle.spells.suspects(axle.number, begin_us)
        axles: dict[str, int] = {}
        for i in self._config.inputs:
            one = self._config.axles[i.source.axles[0]].number if len(i.source.axles) == 1 else 0
            axles[i.source.message] = one if axles.get(i.source.message, one) == one else 0
        yield from self.refusals.suspects(axles, begin_us, end_us)
