"""Gathers what a core takes and makes, some seconds at once, for exported files: groups of channels by our names."""

import struct
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd import __version__
from wrcd.bus.dbc import find_signal
from wrcd.bus.units import Quantity
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import Change
from wrcd.core.reports import Made
from wrcd.core.vocabulary import MESSAGES, Words
from wrcd.errors import InputError, need
from wrcd.logs.decoder import MessageDecoder, decoders
from wrcd.logs.export_files import About, ExportChannel, ExportGroup, McapFile, Mf4File, Rows
from wrcd.logs.feed import Part
from wrcd.logs.reader import LogReader
from wrcd.logs.story_events import NewChanges
from wrcd.logs.time_order import MonotonicTime

BLOCK_US = 10_000_000  # of the log, held in memory
# by key of the vocabulary: the name of the packaged DBC's message
NAMES = {
    "adhesion": "Adhesion", "detail": "AdhesionDetail", "inputs": "InputHealth", "own": "AdhesionOwn",
    "status_message": "WrcdStatus", "rejects_message": "WrcdRejects", "link_message": "WrcdLink",
}  # fmt: skip
INPUTS = {
    Quantity.YAW_RATE: "YawRate", Quantity.LAT_ACCEL: "LatAccel", Quantity.TORQUE: "Torque", Quantity.SPEED: "Speed",
    Quantity.BRAKE_TORQUE: "BrakeTorque", Quantity.AXLE_LOAD: "AxleLoad", Quantity.DIRECTION: "Direction",
    Quantity.WHEEL_RADIUS: "WheelRadius",
}  # fmt: skip
UNITS = {"m/s2": "m/s²", "N m": "Nm", "1": ""}  # of ours, as the field writes them
VALIDITIES, CAUSES = list(Validity), list(Cause)


def sent_groups(config: Config) -> Iterator[tuple[MessageDecoder, ExportGroup]]:
    """Each message that the daemon sends, and its group."""
    for decoder in decoders(config):
        of = f"_A{decoder.axle}" if decoder.axle else ""
        channels = tuple(_channel(decoder, name) for name in decoder.names)
        about = f"frames of {decoder.name}, every {decoder.cycle_us / 1000:g} ms"
        yield decoder, ExportGroup(NAMES[decoder.kind] + of, channels, about, of)


def _channel(decoder: MessageDecoder, name: str) -> ExportChannel:
    ours = MESSAGES[decoder.kind][name]
    comment = find_signal(decoder.message, decoder.signals[name].name).comment or ""
    if isinstance(ours, Words):
        return ExportChannel(name, words=ours.words, comment=comment)
    return ExportChannel(name, ours.unit, comment=comment)


def _input_groups(config: Config) -> Iterator[ExportGroup]:
    """A group for each mapped signal, in the order of the configuration's inputs."""
    sources = [i.source for i in config.inputs]
    parts = {(s.quantity, s.axles) for s in sources if s.part}
    for s in sources:
        of = "".join(f"_A{config.axles[place].number}" for place in s.axles)
        if len(s.axles) == len(config.axles) and s.quantity in (Quantity.SPEED, Quantity.DIRECTION):
            of = ""  # the vehicle's
        if (s.quantity, s.axles) in parts:
            of += f"_{s.part + 1}"
        unit = UNITS.get(s.quantity.unit, s.quantity.unit)
        about = f"accepted frames of {s.message}.{s.signal}, at the axle: sign and gear ratio applied"
        yield ExportGroup(INPUTS[s.quantity] + of, (ExportChannel(INPUTS[s.quantity], unit),), about, of)


def _change_rows(axle: int, changes: Sequence[Change]) -> Rows:
    """The changes of an axle's Validity, and why."""
    channels = (
        ExportChannel("Validity", words=tuple(v.value for v in VALIDITIES), comment="from now on"),
        ExportChannel("Cause", words=tuple(c.label for c in CAUSES), comment="of not being Valid"),
        ExportChannel("Detail", is_text=True, comment="the input and its figures against their limits"),
    )
    of = f"_A{axle}"
    return Rows(
        ExportGroup(f"Changes{of}", channels, "a row for each change of Validity or of its cause", f"_Changes{of}"),
        np.array([c.time_us for c in changes], np.int64),
        (
            np.array([VALIDITIES.index(c.after) for c in changes], np.int8),
            np.array([CAUSES.index(c.cause) for c in changes], np.int8),
            [c.detail if c.cause else "" for c in changes],
        ),
    )


@dataclass(slots=True)
class _Block:
    """Accepted samples of one input, or with a decoder the frames made of one message."""

    group: ExportGroup
    decoder: MessageDecoder | None = None
    stamps_us: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))
    data: bytearray = field(default_factory=bytearray)

    def take(self) -> Rows:
        """All of them by time (jitter between queues may have swapped some); they are let go of."""
        stamps_us = np.array(self.stamps_us, np.int64)
        order = np.argsort(stamps_us, kind="stable")
        columns: Sequence[NDArray[np.float64] | NDArray[np.int8]] = [np.array(self.values, np.float64)]
        if self.decoder is not None:
            found = self.decoder.read(np.frombuffer(bytes(self.data), np.uint8).reshape(len(stamps_us), -1))
            columns = [found[c.name] for c in self.group.channels]
        self.stamps_us, self.values, self.data = array("q"), array("d"), bytearray()
        return Rows(self.group, stamps_us[order], [c[order] for c in columns])


Exporter = Mf4File | McapFile
# libraries and writers by extra
EXPORTERS: dict[str, tuple[str, Callable[[Path, About], Exporter]]]
EXPORTERS = {"mf4": ("asammdf", Mf4File), "mcap": ("mcap", McapFile)}


class GatherExports:
    """An observer of a core: what it takes and makes within a part of a log goes to files. Its close writes what is
    left and finishes them."""

    def __init__(self, config: Config, files: Mapping[str, Path]) -> None:
        """files: by their extras."""
        self._config, self._files = config, files
        self._exporters: dict[str, Exporter] = {}  # by extra
        self.failed: list[str] = []  # why a file could not be written: it is removed
        self._samples = [_Block(group) for group in _input_groups(config)]
        self._frames = {d.key: (d.axle, _Block(group, d)) for d, group in sent_groups(config)}
        self._changes: dict[int, list[Change]] = {}  # by axle
        self._begin_us, self._end_us = -(1 << 62), 1 << 62
        self._due_us: int | None = None  # when the block is full
        self._new_changes: NewChanges | None = None
        self._clock = MonotonicTime()

    def begin(self, core: Core, part: Part, reader: LogReader, first_us: int) -> None:
        """Make the files, for what is gathered from now on of a log, in the time that goes on. first_us: the time of
        the log's first frame. Raises InputError for a file that can't be made."""
        self._new_changes = NewChanges(core)
        self._clock = reader.clock
        self._places = [s.number for s in core.mapped.signals]  # among the configuration's inputs
        self._begin_us = self._begin_us if part.begin_us is None else part.begin_us
        self._end_us = self._end_us if part.end_us is None else part.end_us
        places = {place for place, a in enumerate(self._config.axles) if a.number in part.axles}
        self._wanted = [not places.isdisjoint(i.source.axles) for i in self._config.inputs]
        self._frames = {key: (axle, f) for key, (axle, f) in self._frames.items() if axle in (0, *part.axles)}
        self._changes = {number: [] for number in sorted(part.axles)}
        design = self._config.design
        facts = {
            "program": f"wrcd {__version__}",
            "design": f"{design.name} {design.checksum}",
            "log": reader.path.name,
            "configuration": Path(self._config.file).name,
        }
        for extra, path in self._files.items():
            self._exporters[extra] = EXPORTERS[extra][1](path, About(first_us, facts))

    def accepted(self, samples: Any) -> None:
        """Keep values of accepted frames, the core's records."""
        columns = (samples[name].tolist() for name in ("stamp_us", "input", "value"))
        for stamp_us, number, value in zip(*columns, strict=True):
            if self._begin_us <= stamp_us < self._end_us:
                self._keep(stamp_us + self._clock.correction_us, self._places[number], value)

    def _keep(self, time_us: int, number: int, value: float) -> None:
        if self._wanted[number]:
            held = self._samples[number]
            held.stamps_us.append(time_us)
            held.values.append(value)
        if self._due_us is None:
            self._due_us = time_us + BLOCK_US
        elif time_us > self._due_us:
            self.flush()
            self._due_us = time_us + BLOCK_US

    def sent(self, made: Made) -> None:
        """Keep frames that were made."""
        for o in made:
            if (found := self._frames.get(o.frame.key)) is not None:
                found[1].stamps_us.append(self._clock.made(o.frame.stamp_us))
                found[1].data += o.frame.data

    def look(self) -> None:
        """Keep the changes of Validity since the look before."""
        assert self._new_changes is not None
        for change in self._new_changes.take():
            if change.axle in self._changes and self._begin_us <= change.time_us < self._end_us:
                self._changes[change.axle].append(replace(change, time_us=self._clock.made(change.time_us)))

    def flush(self) -> None:
        """Hand on what there is."""
        held = [*self._samples, *(f for _, f in self._frames.values())]
        rows = [h.take() for h in held if len(h.stamps_us)]
        rows += [_change_rows(axle, changes) for axle, changes in self._changes.items() if changes]
        for changes in self._changes.values():
            changes.clear()
        if rows:
            self._each(lambda exporter: exporter.write(rows))

    def close(self) -> None:
        """Finish the files."""
        self.flush()
        self._each(lambda exporter: exporter.close())

    def _each(self, act: Callable[[Exporter], None]) -> None:
        """Of every file. One that its library fails to write is removed; what else is written goes on."""
        for extra, exporter in list(self._exporters.items()):
            try:
                act(exporter)
            except OSError as e:
                with suppress(OSError):
                    exporter.abandon()
                e.filename = str(self._files[extra])
                raise
            except (ArithmeticError, ValueError, TypeError, struct.error) as e:
                del self._exporters[extra]
                exporter.abandon()
                self._files[extra].unlink(missing_ok=True)
                self.failed.append(f"{self._files[extra]}: --{extra}: cannot be written: {e or type(e).__name__}")


def gathering_for(files: Mapping[str, Path | None], config: Config) -> GatherExports | None:
    """What feeds the files, by their extras, None if there are none. Raises InputError without an extra's library, or
    for another suffix."""
    wanted = {extra: path for extra, path in files.items() if path is not None}
    for extra, path in wanted.items():
        need([EXPORTERS[extra][0]], extra, f"--{extra}")
        if path.suffix.lower() != f".{extra}":
            raise InputError(
                f"is no name of such a file: its readers go by the suffix .{extra}", file=path, key=f"--{extra}",
                hint=f"{path.stem}.{extra}",
            )  # fmt: skip
    return GatherExports(config, wanted) if wanted else None
