"""What a bus has carried so far, as columns. No terminal, no clock: frames and the time until which all of them are
there go in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.dbc import Database, Message, cycle_ms, find_message
from wrcd.bus.frame import EXTENDED
from wrcd.bus.positions import frame_length, is_fd, message_key
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.core.configuration import AxleConfig, Config
from wrcd.logs.decoder import MessageDecoder, OwnFrames
from wrcd.logs.mapped_inputs import MappedInputs
from wrcd.logs.scan import NO_FRAMES, PLAIN_BYTES, Frames, Scan, are_good, rows_by_key
from wrcd.logs.statistics import BIT_RATE, bits
from wrcd.logs.story import ESTIMATED, Estimated, story_axle
from wrcd.logs.story_events import STALE_AFTER
from wrcd.logs.story_records import (
    AdhesionRecord,
    BusStatistics,
    Detail,
    Gaps,
    HealthRecord,
    Record,
    Series,
    Story,
    StoryAxle,
    Times,
    TruthRecord,
    newest,
)
from wrcd.logs.truth import truth, truths
from wrcd.monitor.buffers import ERROR, FD, REMOTE, Batch, ColumnBuffer, Held
from wrcd.monitor.history import History

REASONS = ("", *(r.value for r in Reason))  # a place in them is what InputHealth's Refused signals carry, too
HOLD_S = 3600.0  # of columns; frames as they came are kept for MAX_FRAMES
MAX_FRAMES = 2_000_000  # 70 MB, of a bus with long FD frames 180 MB
STEP_US = 1_000_000  # a stamp further behind the newest than this is a step of the clock
SECOND_US = 1_000_000
BIN_US = 100_000  # the bus is counted by
DEFAULT_CYCLE_US = 5_000  # of a message for which nobody states one
TRUTH_CYCLE_US = 20_000
MAX_REFUSED = 20_000  # of a message, whose times are kept
MAX_AGE_US = 1_000_000  # a value older than that is not shown
AGE_SPAN_US = 10_000_000  # looked back over for the newest frame that carries a multiplexed input
REPORTED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE, Quantity.SPEED)  # by InputHealth, in its order
# what a person reads: a unit and its factor from SI
UNITS: Mapping[Quantity, tuple[str, float]] = {
    Quantity.YAW_RATE: ("rad/s", 1.0), Quantity.LAT_ACCEL: ("m/s²", 1.0), Quantity.TORQUE: ("kN m", 1e-3),
    Quantity.BRAKE_TORQUE: ("kN m", 1e-3), Quantity.SPEED: ("km/h", 3.6), Quantity.AXLE_LOAD: ("kN", 1e-3),
    Quantity.WHEEL_RADIUS: ("mm", 1e3), Quantity.DIRECTION: ("", 1.0),
}  # fmt: skip
AROUND_STORY_US = 120_000_000  # before and after a moment: of what is held, that goes into a story
SomeRecord = TypeVar("SomeRecord", bound=Record)
_TIMES, _NUMBERS, _PLACES = np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros(0, np.int8)
NO_ADHESION = AdhesionRecord(
    _TIMES, _PLACES, _NUMBERS, _NUMBERS, _NUMBERS, _NUMBERS, _PLACES, _PLACES, _PLACES, _NUMBERS
)
NO_BUS = BusStatistics((), _TIMES, _NUMBERS, _NUMBERS, 0, _TIMES)


def _rows(hold_us: int, cycle_us: int) -> int:
    return hold_us // max(cycle_us, 1_000) * 5 // 4 + 100


class WatchedMessage:
    """A message that is known: its good frames, and when and why others were refused here. identity None: not under
    E2E."""

    def __init__(self, message: Message, identity: int | None, hold_us: int, cycle_us: int = 0) -> None:
        self.key, self._data_id = message_key(message), identity
        self._length, self._flags = frame_length(message), FD if is_fd(message) else 0
        self._width = max(self._length, PLAIN_BYTES)
        cycle_us = cycle_us or round(1000 * (cycle_ms(message) or 0)) or DEFAULT_CYCLE_US
        self._good = ColumnBuffer(_rows(hold_us, cycle_us))
        self._refused = ColumnBuffer(MAX_REFUSED)
        self.refusals = 0  # all of them

    def take(self, frames: Frames, flags: NDArray[np.uint8]) -> Frames:
        """Take frames, and return the good ones."""
        reasons = np.zeros(len(frames), dtype=np.int8)
        if self._data_id is not None:
            reasons[~are_good(frames, self._length, self._data_id)] = REASONS.index(Reason.CRC.value)
        reasons[frames.lengths != self._length] = REASONS.index(Reason.LENGTH.value)
        reasons[flags & (REMOTE | FD) != self._flags] = REASONS.index(Reason.KIND.value)
        bad = reasons > 0
        if bad.any():
            self.refusals += int(bad.sum())
            self._refused.append({"time_us": frames.time_us[bad], "reason": reasons[bad]})
            frames = frames.part(~bad)
        data = frames.data[:, : self._width]
        if data.shape[1] < self._width:
            data = np.pad(data, ((0, 0), (0, self._width - data.shape[1])))
        frames = Frames(frames.time_us, frames.lengths, data)
        self._good.append(frames.columns())
        return frames

    def within(self, begin_us: int, end_us: int) -> Frames:
        """Return good frames from a time to another."""
        if not len(self._good):
            return NO_FRAMES
        return Frames(**self._good.part(slice(*np.searchsorted(self._good["time_us"], (begin_us, end_us + 1)))))

    def rate_hz(self, at_us: int) -> float:
        """Return good frames a second, of the second before a time."""
        first, end = np.searchsorted(self._good["time_us"], (at_us - SECOND_US, at_us), side="right")
        return float(end - first) * 1e6 / SECOND_US

    def age_us(self, at_us: int) -> int | None:
        """Return how long before a time its newest good frame came; None where there is none."""
        times = self._good["time_us"]
        end = int(np.searchsorted(times, at_us, side="right"))
        return at_us - int(times[end - 1]) if end else None

    def refused_within(self, at_us: int) -> dict[str, int]:
        """Return how many frames were refused in the second before a time, by reason."""
        first, end = np.searchsorted(self._refused["time_us"], (at_us - SECOND_US, at_us), side="right")
        places, counts = np.unique(self._refused["reason"][first:end], return_counts=True)
        return {REASONS[place]: n for place, n in zip(places.tolist(), counts.tolist(), strict=True)}


@dataclass(frozen=True, slots=True)
class BusNow:
    """Of the second before a time."""

    frames_per_s: float
    load_pct: float
    errors: int  # error frames


class BusLoad:
    """Frames and bits by tenths of a second."""

    def __init__(self, bit_rate: int, hold_us: int) -> None:
        self.bit_rate = bit_rate
        self.frames = self.errors = 0  # all of them
        self._bins = ColumnBuffer(hold_us // BIN_US * 3)  # a tenth that a batch's end cuts has two rows

    def take(self, batch: Batch, times: Times) -> None:
        """Count frames; times never step back."""
        error = (batch.flags & ERROR) > 0
        bins, place = np.unique(times // BIN_US, return_inverse=True)
        n = len(bins)
        self.frames += int(len(batch) - error.sum())
        self.errors += int(error.sum())
        data_bytes = np.where(batch.flags & REMOTE, 0, batch.length)
        taken = np.where(error, 0.0, bits(data_bytes, batch.key & EXTENDED > 0, batch.flags & FD > 0))
        counted = {
            name: np.bincount(place, weights=w, minlength=n)
            for name, w in (("frames", ~error), ("bits", taken), ("errors", error))
        }
        self._bins.append({"time_us": bins * BIN_US, **counted})

    def at(self, at_us: int) -> BusNow:
        """Return how it was at a time."""
        end_us = at_us // BIN_US * BIN_US  # the tenth that is not over does not count
        rows = slice(*np.searchsorted(self._bins["time_us"], (end_us - SECOND_US, end_us)))
        frames, whole, errors = (float(self._bins[name][rows].sum()) for name in ("frames", "bits", "errors"))
        seconds = SECOND_US / 1e6
        return BusNow(frames / seconds, 100.0 * whole / seconds / self.bit_rate, int(errors))


class DaemonMessage:
    """A message of the daemon's that is no axle's: its values by name."""

    def __init__(self, decoder: MessageDecoder) -> None:
        self.name, self._limit_us = decoder.name, STALE_AFTER * decoder.cycle_us
        self._values = ColumnBuffer(4000)

    def take(self, series: Series) -> None:
        """Take frames."""
        self._values.append({"time_us": series.time_us, **series.values})

    def __len__(self) -> int:
        return len(self._values)

    def at(self, at_us: int) -> dict[str, float] | None:
        """Return the values of the newest frame before a time, where it is not too old."""
        k = newest(self._values["time_us"], at_us, self._limit_us)
        return None if k is None else {name: float(v[k]) for name, v in self._values.part().items()}

    def until(self, at_us: int) -> Series:
        """Return all up to a time."""
        end = int(np.searchsorted(self._values["time_us"], at_us, side="right"))
        return Series(values=(found := self._values.part(slice(end))), time_us=found.pop("time_us", _TIMES))


class AxleModel:
    """What frames contain of one wheelset: a StoryAxle that grows, at most hold_us of it, and its history."""

    def __init__(self, config: AxleConfig, hold_us: int) -> None:
        self.number = config.number
        self.cycle_us = config.adhesion.cycle_us
        self.has_detail = config.detail is not None
        self.health_cycle_us = config.inputs.cycle_us if config.inputs else hold_us
        cycles_us: dict[type[Record], int] = {
            AdhesionRecord: self.cycle_us, Detail: config.detail.cycle_us if config.detail else self.cycle_us,
            HealthRecord: self.health_cycle_us, TruthRecord: TRUTH_CYCLE_US,
        }  # fmt: skip
        self._buffers = {kind: ColumnBuffer(_rows(hold_us, cycle_us)) for kind, cycle_us in cycles_us.items()}
        self.history = History(self.cycle_us)
        self.has_come = False  # an input of its own, or an Adhesion frame that is not NotAvailable

    def take(self, own: OwnFrames, frames: Scan) -> None:
        """Take what good frames tell of it."""
        found = (own.adhesion(frames, self.number), own.detail(frames, self.number), own.health(frames, self.number))
        self._keep(*found)

    def _keep(self, adhesion: AdhesionRecord | None, detail: Detail | None, health: HealthRecord | None) -> None:
        if adhesion is not None:
            self.has_come |= bool((adhesion.validity != 0).any())
        for record in (adhesion, detail, health):
            if record is not None:
                self.append(record)

    def append(self, record: Record) -> None:
        """Take newer rows of a record."""
        self._buffers[type(record)].append(record.columns())

    def know(self, axle: StoryAxle) -> None:
        """Take what a core made of a log, in place of the daemon's frames."""
        for kind in (AdhesionRecord, Detail, HealthRecord):
            self._buffers[kind].clear()
        self._keep(axle.adhesion, axle.detail, axle.health)
        self.history.know(axle.events)

    @property
    def held(self) -> StoryAxle:
        """Return what is held, without events: views, to be read before the next frames are taken."""
        adhesion = self._record(AdhesionRecord) or NO_ADHESION
        return StoryAxle(
            self.number, adhesion, self._record(Detail), self._record(HealthRecord), self._record(TruthRecord), ()
        )

    def _record(self, kind: type[SomeRecord]) -> SomeRecord | None:
        buffer = self._buffers[kind]
        return kind(**buffer.part()) if len(buffer) else None


@dataclass(frozen=True, slots=True)
class InputNow:
    """One input at a time. None: not known."""

    quantity: Quantity
    rate_hz: float
    age_ms: float | None
    timeout_ms: float
    reach: int | None  # of the daemon: eight bits, newest lowest
    refused: str  # by reason: "crc 12/s", as counted here; else the daemon's newest reason
    value: float | None
    unit: str

    @property
    def is_stale(self) -> bool:
        """Whether it is past its time-out, or never came."""
        return self.age_ms is None or self.age_ms > self.timeout_ms


class BusModel:
    """One bus. databases: further DBCs, of which the rig's truth is taken. hold_s: for so long columns are kept."""

    def __init__(
        self, config: Config, databases: Sequence[Database] = (), *, bit_rate: int = BIT_RATE, hold_s: float = HOLD_S,
        max_frames: int = MAX_FRAMES,
    ) -> None:  # fmt: skip
        hold_us = round(hold_s * 1e6)
        self.config = config
        self.axles = [AxleModel(a, hold_us) for a in config.axles]
        self.load = BusLoad(bit_rate, hold_us)
        self.held = Held(max_frames)  # frames as they came
        self.inputs = MappedInputs(config)
        self.now_us = 0  # until when everything that came is here, in the monitor's own time
        self.begin_us: int | None = None  # of the first frame
        self.clock_steps = 0
        self.source = "frames of the bus"  # what its axles' columns are
        self.is_estimated = False  # they are no frames of the bus, but made here
        self.is_whole = True  # all of a log could be read
        self.has_truth = False
        self._own = OwnFrames(config)
        self._correction_us = 0  # what makes time of stamps: a clock that steps back must not turn time round
        self._looked_us = 0  # for inputs that have come
        self.watched: dict[int, WatchedMessage] = {}
        self.of_axle: dict[int, list[WatchedMessage]] = {a.number: [] for a in self.axles}  # the daemon's about it
        for key, m in self.inputs.messages.items():
            message = find_message(config.database, m.name)
            self.watched[key] = WatchedMessage(message, m.data_id, hold_us)
        self.daemon: dict[str, DaemonMessage] = {}  # its own messages, by the vocabulary's name
        for decoder in self._own.decoders.values():
            watched = WatchedMessage(decoder.message, decoder.data_id, hold_us, decoder.cycle_us)
            self.watched[watched.key] = watched
            if decoder.axle:
                self.of_axle[decoder.axle].append(watched)
            else:
                self.daemon[decoder.kind] = DaemonMessage(decoder)
        self.slowest_us = max((d.cycle_us for d in self._own.decoders.values()), default=0)
        self._truths = {n: m for n, m in truths(databases).items() if message_key(m) not in self.watched}
        for message in self._truths.values():
            truth(Scan(Path()), message)  # raises InputError
        self._keys = np.array([*self.watched, *map(message_key, self._truths.values())], dtype=np.int64)

    def take(self, batch: Batch, until_us: int) -> None:
        """Take frames in the order of their arrival, and until when there are no others (0: not known)."""
        if len(batch):
            if self.begin_us is None:
                self.begin_us = self.now_us = self._looked_us = int(batch.stamp_us[0])
            times = self._times(batch.stamp_us)
            self.held.add(batch)
            self.load.take(batch, times)
            self._sort(batch, times)
            self.now_us = max(self.now_us, int(times[-1]))
        if until_us:
            self.now_us = max(self.now_us, until_us + self._correction_us)

    def take_estimated(self, estimated: Estimated, gaps: Gaps) -> None:
        """Take what a core made of the frames: that was never on the bus, and only the axles have it."""
        self.source, self.is_estimated, sent = ESTIMATED, True, estimated.sent
        whole = replace(sent, begin_us=self.begin_us or sent.begin_us, end_us=self.now_us, gaps=gaps)
        for axle in self.axles:
            adhesion = self._own.adhesion(sent, axle.number)
            made = story_axle(axle.number, adhesion, self._own, sent, None, whole, estimated)
            if made is not None:
                axle.know(made)

    @property
    def axles_that_came(self) -> list[AxleModel]:
        """Those that an input or an estimate has come of; where there is none yet, all that are configured."""
        return [a for a in self.axles if a.has_come] or self.axles

    def update(self) -> None:
        """Bring what is made of many frames up to date."""
        frames = self.inputs_within(self._looked_us, self.now_us)
        self._looked_us = self.now_us
        for place, axle in enumerate(self.axles):
            axle.has_come = axle.has_come or self.inputs.any_frame(frames, place)
            axle.history.update(axle.held, self.now_us)

    def _times(self, stamps: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the monitor's own time: the stamps, and a step of the clock back is no step."""
        times = stamps + self._correction_us
        latest = np.maximum.accumulate(np.concatenate(([self.now_us], times)))
        back = latest[:-1] - times
        if (back > STEP_US).any():
            k = int(np.argmax(back > STEP_US))
            self.clock_steps += 1
            self._correction_us += int(latest[k]) - int(times[k])
            self.now_us = int(latest[k])
            return np.concatenate((latest[1 : k + 1], self._times(stamps[k:])))
        return latest[1:]

    def _sort(self, batch: Batch, times: NDArray[np.int64]) -> None:
        keys = self.inputs.named(batch.key)
        rows = np.flatnonzero((batch.flags & ERROR == 0) & np.isin(keys, self._keys))
        found = Scan(Path())
        for key, places in rows_by_key(keys[rows]):
            part = rows[places]
            frames = Frames(times[part], batch.length[part].astype(np.uint8), batch.data[part])
            watched = self.watched.get(key)
            frames = frames if watched is None else watched.take(frames, batch.flags[part])
            if len(frames):
                found.frames[key] = frames
        for kind, message in self.daemon.items():
            if (series := self._own.series(found, kind)) is not None:
                message.take(series)
        for axle in self.axles:
            if not self.is_estimated:
                axle.take(self._own, found)
            if (true := truth(found, self._truths.get(axle.number))) is not None:
                axle.append(true)
                self.has_truth = True

    def inputs_within(self, begin_us: int, end_us: int) -> Scan:
        """Return the good frames of mapped messages of a time, as those of a log."""
        frames = {key: self.watched[key].within(begin_us, end_us) for key in self.inputs.messages}
        first_us, last_us = max(begin_us, self.begin_us or 0), min(end_us, self.now_us)
        return Scan(Path(), begin_us=first_us, end_us=last_us, frames={k: f for k, f in frames.items() if len(f)})

    def inputs_at(self, axle: AxleModel, at_us: int) -> list[InputNow]:
        """Return an axle's inputs at a time, the vehicle's among them."""
        health, place, out = axle.held.health, self.axles.index(axle), []
        row = None if health is None else newest(health.time_us, at_us, STALE_AFTER * axle.health_cycle_us)
        recent = self.inputs_within(at_us - MAX_AGE_US, at_us)
        for i in self.config.inputs:
            if place not in i.source.axles:
                continue
            watched = self.watched[message_key(find_message(self.config.database, i.source.message))]
            rate_hz, age_us, counted = watched.rate_hz(at_us), watched.age_us(at_us), watched.refused_within(at_us)
            reach, refused = None, [f"{reason} {n}/s" for reason, n in counted.items()]
            if health is not None and row is not None and i.source.quantity in REPORTED:
                column = REPORTED.index(i.source.quantity)
                reach, reason = int(health.reach[row, column]), int(health.refused[row, column])
                if 0 < reason < len(REASONS) and REASONS[reason] not in counted:
                    refused.append(REASONS[reason])
            unit, scale = UNITS[i.source.quantity]
            times, values = self.inputs.values(recent, i)
            if self.inputs.is_multiplexed(i):
                rate_hz = float((times > at_us - SECOND_US).sum()) * 1e6 / SECOND_US
                if not len(times):
                    times = self.inputs.values(self.inputs_within(at_us - AGE_SPAN_US, at_us), i)[0]
                age_us = at_us - int(times[-1]) if len(times) else None
            values = values[np.isfinite(values)]
            out.append(
                InputNow(
                    i.source.quantity, rate_hz, None if age_us is None else age_us / 1000,
                    i.timeout_us / 1000, reach, ", ".join(refused), float(values[-1]) * scale if len(values) else None,
                    unit,
                )
            )  # fmt: skip
        return out

    def story(self, axle: AxleModel, at_us: int) -> Story:
        """Return what is held of an axle around a time, as the story of a log."""
        begin_us, end_us = at_us - AROUND_STORY_US, at_us + AROUND_STORY_US
        near = axle.history.events(begin_us, end_us) or axle.history.events()
        falls = tuple(f for f in axle.history.falls() if begin_us < f.end_us < end_us)
        frames = self.inputs_within(begin_us, end_us)
        torque = self.inputs.torque(frames, self.axles.index(axle))
        return Story(
            frames.log, "", self.source, self.begin_us or 0, self.now_us, (replace(axle.held, events=tuple(near)),),
            self.inputs.speed(frames), None, {} if torque is None else {axle.number: torque}, None, None, None, NO_BUS,
            falls, (), (), self.config,
        )  # fmt: skip

    def damaged(self, axle: AxleModel, at_us: int) -> int:
        """Return how many of the daemon's frames about an axle were refused here in the second before a time."""
        return sum(sum(w.refused_within(at_us).values()) for w in self.of_axle[axle.number])
