"""A log into a model: what its frames say, or, where no daemon's are among them, what the core makes of it."""

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wrcd.bus.columns import Stretch
from wrcd.bus.dbc import Database
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, read_log, read_stretches
from wrcd.bus.log_order import TimeOrder, on_channel
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.recorder.resume import Saved, load, state_file
from wrcd.tools.feed import outgoing, outgoing_of_stretches, progress
from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.model import STEP_US, Model
from wrcd.tools.story.gather import ESTIMATED, SENT

MAX_AT_ONCE = 5_000  # frames that are drawn one by one
LONG_S = 30 * 86_400.0  # of a log all is kept; its columns grow as they are needed

Item = Stretch | tuple[Frame, str]


def model_of_log(
    log: Path, config: Config, databases: Sequence[Database], channel: str | None, bit_rate: int
) -> tuple[Model, list[str]]:
    """The model, and what is odd about the log. Raises InputError where it cannot be read."""
    model, warnings = _read(log, config, databases, channel, bit_rate, None)
    if not any(len(a.adhesion.time_us) for a in model.axles):
        model, warnings = _read(log, config, databases, channel, bit_rate, Core(config))
        warnings.insert(0, "the log has no frame of a daemon: estimated here")
    return model, warnings


def _read(
    log: Path, config: Config, databases: Sequence[Database], channel: str | None, bit_rate: int, core: Core | None
) -> tuple[Model, list[str]]:
    model = Model(config, databases, bit_rate=bit_rate, hold_s=LONG_S)
    model.is_estimated = core is not None
    model.source = SENT if core is None else ESTIMATED
    damage, order = Damage(), TimeOrder(log)
    batches: Iterator[tuple[Batch, Batch | None]]
    if core is not None and state_file(log).exists():
        frames = on_channel(read_log(log, damage), channel, log)
        batches = _resumed(core, progress(frames, log), load(state_file(log), core))
    else:
        batches = _batches(progress(order.put(on_channel(read_stretches(log, damage), channel, log)), log), core)
    for batch, estimated in batches:
        model.take(batch, 0, estimated)
    model.update()
    return model, [*damage.warnings(log), *order.warnings()]


def _batches(items: Iterator[Item], core: Core | None) -> Iterator[tuple[Batch, Batch | None]]:
    for item in _cut(items):
        batch = Batch.of_stretch(item) if isinstance(item, Stretch) else Batch.of_frames([item[0]])
        made = [] if core is None else [o.frame for o, _ in outgoing_of_stretches(core, (item,))]
        yield batch, Batch.of_frames(made) if made else None


def _resumed(core: Core, frames: Iterator[tuple[Frame, str]], saved: Saved) -> Iterator[tuple[Batch, Batch | None]]:
    """From the state beside a recorder's log, as the daemon's loop was when the log began."""
    drawn: list[Frame] = []
    backs: list[int] = []  # places in it where the clock was set back: batches end there

    def drawing() -> Iterator[tuple[Frame, str]]:
        for frame, channel in frames:
            if drawn and frame.stamp_us < drawn[-1].stamp_us - STEP_US:
                backs.append(len(drawn))
            drawn.append(frame)
            yield frame, channel

    made: list[Frame] = []
    for o, _ in outgoing(core, drawing(), saved):
        # the frame drawn last is what this was made at
        ends = backs or [len(drawn) - 1] * (len(drawn) > MAX_AT_ONCE)
        for first, end in itertools.pairwise([0, *ends]):
            yield Batch.of_frames(drawn[first:end]), Batch.of_frames(made)
            made = []
        if ends:
            del drawn[: ends[-1]]
            backs.clear()
        made.append(o.frame)
    for first, end in itertools.pairwise([0, *backs, len(drawn)]):
        yield Batch.of_frames(drawn[first:end]), Batch.of_frames(made)
        made = []


def _cut(items: Iterator[Item]) -> Iterator[Item]:
    """Stretches end where the clock was set back: what is estimated of each is put in order by its stamps."""
    for item in items:
        if isinstance(item, Stretch):
            steps = np.flatnonzero(np.diff(item.stamps_us) < -STEP_US) + 1
            for first, end in itertools.pairwise([0, *steps.tolist(), len(item)]):
                yield item.part(first, end)
        else:
            yield item
