"""Stories made by hand, and the ride that tests of stories share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wrcd.bus.dbc import Database
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.logs.story_events import VALIDITIES, of_frames
from wrcd.logs.story_records import (
    AdhesionRecord,
    BusStatistics,
    Detail,
    Event,
    HealthRecord,
    MessageStatistics,
    Series,
    Story,
    StoryAxle,
    TruthRecord,
)

BEGIN_US = 1_700_000_000_000_000
SLOT_US = 20_000
VALID, DEGRADED, NOT_AVAILABLE = (
    VALIDITIES.index(v) for v in (Validity.VALID, Validity.DEGRADED, Validity.NOT_AVAILABLE)
)
# dry, leaf film from 5 s to 8 s, dry
LEAF_RIDE = """
duration_s = 11.0
speed_m_s = 25.0
[[rail]]
curve = "A"
[[rail]]
from_m = 125.0
curve = "F"
[[rail]]
from_m = 200.0
curve = "A"
[drive]
torque_N_m = [[0.0, 0.0], [1.0, 19000.0]]
"""


def adhesion(
    mu: ArrayLike, validity: ArrayLike = VALID, half: ArrayLike = 1.0, used: ArrayLike = 2.0
) -> AdhesionRecord:
    """One frame a slot; arrays (n,) or single numbers."""
    values = np.asarray(mu, dtype=np.float32)
    n = len(values)

    def column(x: ArrayLike, kind: type) -> NDArray[Any]:
        return np.broadcast_to(np.asarray(x), (n,)).astype(kind)

    width = column(half, np.float32)
    return AdhesionRecord(
        BEGIN_US + SLOT_US * np.arange(1, n + 1, dtype=np.int64), column(validity, np.int8), values,
        column(used, np.float32), (values - width).clip(0), values + width, column(6, np.int8), column(1, np.int8),
        column(1, np.int8), column(19, np.float32),
    )  # fmt: skip


def kept(a: AdhesionRecord, *rows: int | slice) -> AdhesionRecord:
    """Some of the frames, as np.r_ takes them."""
    return a.part(np.r_[rows])


def detail(slots: int, cause: ArrayLike = 0, winner: ArrayLike = 1, rule: ArrayLike = 1) -> Detail:
    """AdhesionDetail of so many slots of Adhesion: a frame for every fifth."""
    m = slots // 5

    def column(x: ArrayLike, kind: type) -> NDArray[Any]:
        return np.broadcast_to(np.asarray(x), (m,)).astype(kind)

    return Detail(
        BEGIN_US + 5 * SLOT_US * np.arange(1, m + 1, dtype=np.int64),
        np.tile(np.array([-10, -20, -30, -40], np.float32), (m, 1)),
        column(winner, np.int8), column(rule, np.int16), column(cause, np.int8), np.zeros((m, 4), bool),
    )  # fmt: skip


def truth(mu: ArrayLike) -> TruthRecord:
    """One frame a slot."""
    values = np.asarray(mu, dtype=np.float32)
    return TruthRecord(
        BEGIN_US + SLOT_US * np.arange(1, len(values) + 1, dtype=np.int64), values, (values / 2).astype(np.float32)
    )


def axle(
    a: AdhesionRecord, d: Detail | None = None, health: HealthRecord | None = None, true: TruthRecord | None = None,
    number: int = 1, events: Sequence[Event] | None = None,
) -> StoryAxle:  # fmt: skip
    """An axle with the events that its frames tell."""
    end_us = int(a.time_us[-1])
    found = of_frames(number, a, d, health, SLOT_US, BEGIN_US, end_us) if events is None else tuple(events)
    return StoryAxle(number, a, d, health, true, found)


def story(
    config: Config, *axles: StoryAxle, status: Series | None = None, rejects: Series | None = None,
    link: Series | None = None, messages: Sequence[MessageStatistics] = (), errors_us: Sequence[int] = (),
) -> Story:  # fmt: skip
    """A story of these axles, without falls and verdict."""
    end_us = max((int(a.adhesion.time_us[-1]) for a in axles), default=BEGIN_US + 1_000_000)
    bus = BusStatistics(
        tuple(messages), np.array([BEGIN_US], np.int64), np.array([100], np.float32),
        np.array([10], np.float32), 500_000, np.array(errors_us, np.int64),
    )  # fmt: skip
    return Story(
        Path("made.log"), "can0", "frames of the log", BEGIN_US, end_us, tuple(axles), None, None, {}, status, rejects,
        link, bus, (), (), (), config,
    )  # fmt: skip


def series(**values: Sequence[float]) -> Series:
    """One frame a second."""
    n = len(next(iter(values.values())))
    return Series(
        BEGIN_US + 1_000_000 * np.arange(1, n + 1, dtype=np.int64), {k: np.array(v, float) for k, v in values.items()}
    )


def counts(config: Config, name: str, *values: int) -> Series:
    """A message of the daemon's own with one count."""
    return series(**{name: [float(v) for v in values]})


def at_s(seconds: float) -> int:
    """A time in microseconds."""
    return BEGIN_US + round(seconds * 1e6)


def event(begin_s: float, end_s: float, validity: Validity, cause: Cause = Cause.NONE, text: str = "") -> Event:
    """An event of axle 1."""
    return Event(1, at_s(begin_s), at_s(end_s), validity, cause, text)


def renamed(made: Story, log: str) -> Story:
    """The same of another log."""
    return replace(made, log=Path(log))


@dataclass(frozen=True)
class Ride:
    """The rig's log, the same with the frames that a replay sends, the events that it tells, and both as stories."""

    log: Path
    both: Path
    rows: Path
    events: Path
    truth: Database
    estimated: Story
    sent: Story


def merged(*logs: Path) -> str:
    """Lines of candump logs by their stamps; of one stamp, those of the earlier log first."""
    return "".join(sorted((line for log in logs for line in log.read_text().splitlines(keepends=True)), key=stamp))


def stamp(line: str) -> str:
    """Of a candump line."""
    return line[1:18]
