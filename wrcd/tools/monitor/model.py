"""What a bus has said so far. No terminal, no clock: frames and the time until which all of them are there go in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.dbc import Database, Message, data_id
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.tools.bus_load import BIT_RATE
from wrcd.tools.monitor.axle import INPUTS, AxleModel, row_at
from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.bus import Bus
from wrcd.tools.monitor.held import Held
from wrcd.tools.monitor.inputs import InputNow, Inputs
from wrcd.tools.monitor.table import Table
from wrcd.tools.monitor.watched import Judge, Watched
from wrcd.tools.said import Said, said
from wrcd.tools.story.scan import Scan

HOLD_S = 3600.0  # of columns; frames as they came are kept for MAX_FRAMES
MAX_FRAMES = 2_000_000  # 70 MB, of a bus with long FD frames 180 MB
STEP_US = 1_000_000  # a stamp further behind the newest than this is a step of the clock
TRUTH = "SimTruth_A{}"  # the rig's message
STALE_CYCLES = 3  # a frame older than so many cycles tells nothing of now


@dataclass(slots=True)
class Heard:
    """Frames of the daemon's that are not an axle's: values by name, each with its frames' times."""

    said: Said
    table: Table = field(init=False)

    def __post_init__(self) -> None:
        columns = dict.fromkeys(self.said.names, (np.float64, 0))
        self.table = Table({"time_us": (np.int64, 0), **columns}, 4000)

    def at(self, at_us: int) -> tuple[int, Mapping[str, float]] | None:
        """When the newest frame before a time came, and what it said."""
        k = int(np.searchsorted(self.table["time_us"], at_us, side="right")) - 1
        if k < 0:
            return None
        return int(self.table["time_us"][k]), {name: float(self.table[name][k]) for name in self.said.names}


class Model:
    """One bus. databases: further DBCs, of which the rig's truth is taken. hold_s: for so long, None for ever."""

    def __init__(
        self,
        config: Config,
        databases: Sequence[Database] = (),
        *,
        bit_rate: int = BIT_RATE,
        hold_s: float = HOLD_S,
        max_frames: int = MAX_FRAMES,
    ) -> None:
        hold_us = round(hold_s * 1e6)
        self.config = config
        self.axles = [AxleModel(a, hold_us) for a in config.axles]
        self.bus = Bus(bit_rate, hold_us)
        self.inputs = Inputs(config, hold_us)
        self.now_us = 0  # until when everything that came is here, in the monitor's own time
        self.begin_us: int | None = None  # of the first frame
        self.clock_steps = 0
        self.source = "frames of the bus"  # what its axles' columns are
        self.is_estimated = False  # they are no frames of the bus, but made here
        self.has_truth = False
        self.held = Held(max_frames)  # frames as they came
        self.outputs: dict[str, Heard] = {}  # the daemon's own, by the vocabulary's name
        self._correction_us = 0  # what makes time of stamps: a clock that steps back must not turn time round
        self._axle = {a.number: a for a in self.axles}
        self._said: dict[int, Said] = {}
        self._truth: dict[int, tuple[AxleModel, Said]] = {}
        watched: dict[int, Watched] = dict(self.inputs.watched)
        ids = {
            o.message: o.data_id
            for o in (*(o for a in config.axles for o in (a.adhesion, a.detail, a.inputs, a.ahead)), config.status,
                      config.rejects, config.link)
            if o is not None
        }  # fmt: skip
        by_name = {m.name: m for m in config.database.messages}
        for one in said(config):
            assert one.kind is not None
            watched[one.key] = Watched(by_name[one.name], ids[one.name], hold_us, one.cycle_us)
            self._said[one.key] = one
            if not one.kind.axle:
                self.outputs[one.kind.name] = Heard(one)
        for database in databases:
            for message in database.messages:
                axle = next((a for a in self.axles if message.name == TRUTH.format(a.number)), None)
                found = Said(message)
                if axle is not None and found.key not in watched and {"MuAvailable", "MuUsed"} <= set(found.names):
                    watched[found.key] = Watched(message, _identity(message), hold_us)
                    self._truth[found.key] = axle, found
        self.watched: Mapping[int, Watched] = watched
        self._judge = Judge(watched)

    def take(self, batch: Batch, until_us: int, estimated: Batch | None = None) -> None:
        """Frames in the order of their arrival, and until when there are no others (0: not known). estimated: what a
        core made of them; that was never on the bus, and only the axles' columns take it."""
        both = batch
        was_there = np.ones(len(batch), dtype=bool)
        if estimated is not None and len(estimated):
            both = Batch.joined([batch, estimated])
            order = np.argsort(both.stamp_us, kind="stable")
            both, was_there = both.only(order), order < len(batch)
        if len(both):
            times = self._times(both.stamp_us)
            if len(batch):
                seen, seen_times = both.only(was_there), times[was_there]
                if self.begin_us is None:
                    self.begin_us = int(seen_times[0])
                self.held.add(batch)
                self.bus.take(seen, seen_times)
                self._sort(seen, seen_times)
            if len(batch) < len(both):
                self._sort_estimated(both.only(~was_there), times[~was_there])
            self.now_us = max(self.now_us, int(times[-1]))
        until_us += self._correction_us
        if until_us > self.now_us:
            self.now_us = until_us

    @property
    def axles_that_came(self) -> list[AxleModel]:
        """Those that an input or an estimate has come of; where there is none yet, all that are configured."""
        return [a for a in self.axles if a.has_come] or self.axles

    def update(self) -> None:
        """Bring what is made of many frames up to date."""
        for place, axle in enumerate(self.axles):
            axle.has_come = axle.has_come or self.inputs.any_frame(place)
            axle.update(self.now_us)

    def _times(self, stamps: NDArray[np.int64]) -> NDArray[np.int64]:
        """The monitor's own time: the stamps, and a step of the clock back is no step."""
        times = stamps + self._correction_us
        newest = np.maximum.accumulate(np.concatenate(([self.now_us], times)))
        back = newest[:-1] - times
        if (back > STEP_US).any():
            k = int(np.argmax(back > STEP_US))
            self.clock_steps += 1
            head = newest[1 : k + 1]
            at_us = int(newest[k])
            self._correction_us += at_us - int(times[k])
            if k:
                self.now_us = max(self.now_us, int(head[-1]))
            return np.concatenate((head, self._times(stamps[k:])))
        return newest[1:]

    def _sort(self, batch: Batch, times: NDArray[np.int64]) -> None:
        places, reasons = self._judge.judge(batch)
        order = np.argsort(places, kind="stable")
        ordered = places[order]
        edges = np.flatnonzero(np.diff(ordered, prepend=-1, append=len(self._judge.keys)))
        for first, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            key = int(self._judge.keys[ordered[first]])
            rows = order[first:end]
            self.watched[key].take(times[rows], reasons[rows], batch.data[rows])
            good = rows[reasons[rows] == 0]
            if len(good):
                self._take(key, times[good], batch, good)

    def _sort_estimated(self, batch: Batch, times: NDArray[np.int64]) -> None:
        for key in np.unique(batch.key).tolist():
            one, rows = self._said.get(key), batch.key == key
            if one is not None and one.kind is not None and one.kind.axle:
                self._axle[one.kind.axle].take(one.kind.name, times[rows], one.read(batch.data[rows]))

    def _take(self, key: int, times: NDArray[np.int64], batch: Batch, rows: NDArray[np.int64]) -> None:
        one = self._said.get(key)
        if one is not None and one.kind is not None and not (self.is_estimated and one.kind.axle):
            values = one.read(batch.data[rows])
            if one.kind.axle:
                self._axle[one.kind.axle].take(one.kind.name, times, values)
            else:
                self.outputs[one.kind.name].table.append(time_us=times, **values)
        elif key in self._truth:
            axle, truth = self._truth[key]
            axle.take_truth(times, truth.read(batch.data[rows]))
            self.has_truth = True

    def inputs_within(self, begin_us: int, end_us: int) -> Scan:
        """The good frames of mapped messages of a time, as those of a log."""
        frames = {key: w.frames(begin_us, end_us) for key, w in self.inputs.watched.items()}
        first_us, last_us = max(begin_us, self.begin_us or 0), min(end_us, self.now_us)
        return Scan(Path(), begin_us=first_us, end_us=last_us, frames={k: f for k, f in frames.items() if len(f)})

    def inputs_at(self, axle: AxleModel, at_us: int) -> list[InputNow]:
        """An axle's inputs at a time."""
        health = axle.health
        of = self.config.axles[self.axles.index(axle)].inputs
        row = None if of is None else row_at(health.time_us, at_us, STALE_CYCLES * of.cycle_us)
        return self.inputs.at(self.axles.index(axle), health, row, at_us)

    def damaged(self, axle: AxleModel, at_us: int, over_us: int = 1_000_000) -> int:
        """How many of the daemon's frames about an axle were refused here before a time."""
        kinds = {key: one.kind for key, one in self._said.items()}
        of = [self.watched[key] for key, kind in kinds.items() if kind is not None and kind.axle == axle.number]
        return sum(sum(w.refused_within(at_us, over_us).values()) for w in of)


def _identity(message: Message) -> int | None:
    try:
        return data_id(message)
    except ValueError as e:
        raise InputError(str(e), key="--dbc") from None


__all__ = ["HOLD_S", "INPUTS", "Heard", "Model"]
