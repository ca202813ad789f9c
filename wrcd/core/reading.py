"""Mapped frames to quantities, one by one or many at once, as the core reads them: for who looks at a log, and makes no
estimate."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from wrcd.bus.batch import FrameBatch
from wrcd.bus.dbc import Database
from wrcd.bus.e2e import crc_of_data_id
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import Mapped
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source
from wrcd.core.configuration import Input
from wrcd.core.counts import REASONS
from wrcd.core.layouts import layouts
from wrcd.core.state import Train
from wrcd.core.tables import input_tables
from wrcd.native import library

NOT_MAPPED = -1
Records = np.ndarray[Any, Any]


class Sample(NamedTuple):
    """A value in SI units. Degraded if its sender says so, contested if another seems to send it, too."""

    source: int  # place among the receiver's sources
    value: float
    degraded: bool = False
    contested: bool = False


class Receiver:
    """All mapped messages. follows: E2E counters; without it each frame stands for itself.

    data_ids: of E2E, by message (None: not protected); of a message that is not among them, the DBC's.
    """

    def __init__(
        self, database: Database, sources: Sequence[Source], data_ids: Mapping[str, int | None] | None = None,
        follows: bool = True,
    ) -> None:  # fmt: skip
        self.mapped, self._follows = Mapped(database, sources, data_ids), follows
        tables = input_tables(self.mapped, [Input(s, 0) for s in sources])
        settings = np.zeros(1, dtype=layouts()["settings"])
        settings["messages"], settings["inputs"] = len(self.mapped.messages), len(sources)
        settings["statuses"] = len(self.mapped.statuses)
        self._train = Train(tables | {"settings": settings}, (0, 0, 0))
        self._numbers = np.array([s.number for s in self.mapped.signals], np.int32)
        self.reset()

    def reset(self) -> None:
        """After a step of time or a long silence: take every counter as it comes, and believe no status of before."""
        library().wrcd_forget_senders(self._train.pointer)

    def read_all(self, frames: FrameBatch) -> tuple[Records, Records]:
        """Why each frame is refused (n,): a number of REASONS, or NOT_MAPPED; and the values as C's samples, in the
        frames' order, `input` being the place among the sources: those of refused frames are NaN."""
        n, most = len(frames), len(frames) * max(1, max((len(m.signals) for m in self.mapped.messages), default=1))
        reasons, samples = np.zeros(n, np.int32), np.zeros(most, dtype=layouts()["sample"])
        count = library().wrcd_read(
            self._train.pointer, frames.records, frames.stride, n,
            self._follows, reasons.ctypes.data, samples.ctypes.data,
        )  # fmt: skip
        samples = samples[:count]
        if count:
            samples["input"] = self._numbers[samples["input"]]
        return reasons, samples

    def read(self, frame: Frame) -> list[Sample] | Reason | None:
        """Samples, the reason of a rejection, or None for a frame that is not mapped."""
        (reason,), samples = self.read_all(FrameBatch.of((frame,)))
        if reason:
            return None if reason == NOT_MAPPED else REASONS[int(reason)]
        return [
            Sample(int(s["input"]), float(s["value"]), bool(s["is_degraded"]), bool(s["is_contested"])) for s in samples
        ]


class Checker:
    """The chain of counters of one message under E2E Profile 11, as the core follows it. others: data ids of which a
    frame may come under the wrong id."""

    def __init__(self, data_id: int, others: tuple[int, ...] = ()) -> None:
        tables = {name: np.zeros(1, dtype=layouts()[name]) for name in ("settings", "message")}
        tables["settings"]["messages"], tables["message"]["is_protected"] = 1, 1
        tables["message"]["crc_start"], tables["message"]["others"] = crc_of_data_id(data_id), len(others)
        tables |= {"number": np.array([*map(crc_of_data_id, others), 0], np.int64)}
        tables |= {"word": np.zeros(1, np.int64), "rule": np.zeros(1, np.int32)}
        self._train = Train(tables, (0, 0, 0))
        self.reset()

    def reset(self) -> None:
        """Start anew: the next frame's counter is taken as it comes."""
        library().wrcd_forget_senders(self._train.pointer)

    @property
    def state(self) -> Any:
        """The record of the chain (WRCD_MESSAGE_STATE in wrcd/core/c/wrcd.h)."""
        return self._train.state["message_state"][0]

    def check(self, data: bytes, stamp_us: int = 0) -> Reason | None:
        """None if the frame may be used, else why not. The length has been checked. Without stamps no silence is
        seen."""
        return REASONS[int(library().wrcd_e2e_check(self._train.pointer, 0, data, len(data), stamp_us))]
