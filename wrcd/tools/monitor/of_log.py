"""A log into a model: what its frames say, or, where no daemon's are among them, what the core makes of it."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wrcd.bus.columns import Stretch
from wrcd.bus.dbc import Database
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, read_stretches
from wrcd.bus.log_order import TimeOrder, on_channel
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.tools.feed import outgoing_of_stretches, progress
from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.model import Model

LONG_S = 30 * 86_400.0  # of a log all is kept; its columns grow as they are needed

Item = Stretch | tuple[Frame, str]


def model_of_log(
    log: Path, config: Config, databases: Sequence[Database], channel: str | None, bit_rate: int
) -> tuple[Model, list[str]]:
    """The model, and what is odd about the log. Raises InputError where it cannot be read."""
    model, warnings = _read(log, config, databases, channel, bit_rate, None)
    if not any(len(a.adhesion.time_us) for a in model.axles):
        model, warnings = _read(log, config, databases, channel, bit_rate, Core(config))
        model.source = "estimated here"
        warnings.insert(0, "the log has no frame of a daemon: estimated here")
    return model, warnings


def _read(
    log: Path, config: Config, databases: Sequence[Database], channel: str | None, bit_rate: int, core: Core | None
) -> tuple[Model, list[str]]:
    model = Model(config, databases, bit_rate=bit_rate, hold_s=LONG_S)
    damage, order = Damage(), TimeOrder(log)
    items = order.put(on_channel(read_stretches(log, damage), channel, log))
    for batch in _batches(progress(items, log), core):
        model.take(batch, 0)
    model.update()
    model.source = "frames of the log"
    return model, [*damage.warnings(log), *order.warnings()]


def _batches(items: Iterator[Item], core: Core | None) -> Iterator[Batch]:
    for item in items:
        batch = Batch.of_stretch(item) if isinstance(item, Stretch) else Batch.of_frames([item[0]])
        if core is not None:
            made = [o.frame for o, _ in outgoing_of_stretches(core, (item,))]
            batch = _merged(batch, Batch.of_frames(made)) if made else batch
        yield batch


def _merged(one: Batch, other: Batch) -> Batch:
    """Both, in order of time."""
    width = max(one.data.shape[1], other.data.shape[1])
    columns = []
    for name in Batch.__slots__:
        a, b = getattr(one, name), getattr(other, name)
        if name == "data":
            a, b = (np.pad(d, ((0, 0), (0, width - d.shape[1]))) for d in (a, b))
        columns.append(np.concatenate([a, b]))
    order = np.argsort(columns[0], kind="stable")
    return Batch(*(c[order] for c in columns))
