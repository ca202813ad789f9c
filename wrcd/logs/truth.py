"""What a rig says of the adhesion, through a second DBC (messages SimTruth_A1 … with MuAvailable and MuUsed), and how
far an estimate is from it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.dbc import Database, Message, data_id
from wrcd.bus.positions import message_key
from wrcd.errors import InputError
from wrcd.logs.decoder import MessageDecoder
from wrcd.logs.scan import Scan, good_frames
from wrcd.logs.story_events import VALID_PLACE
from wrcd.logs.story_records import StoryAxle, TruthRecord, newest_values

NAME = re.compile(r"SimTruth_A(\d+)")
SIGNALS = {"MuAvailable", "MuUsed"}


def truths(databases: Sequence[Database]) -> dict[int, Message]:
    """The messages that carry the truth, by axle; of several DBCs the first wins."""
    out: dict[int, Message] = {}
    for database in databases:
        for m in database.messages:
            found = NAME.fullmatch(m.name)
            if found and {s.name for s in m.signals} >= SIGNALS and m.name not in database.unsound:
                out.setdefault(int(found[1]), m)
    return out


def truth(scan: Scan, message: Message | None) -> TruthRecord | None:
    """The truth of an axle, None if the log has none. Raises InputError for a message that is protected in another way
    than ours."""
    if message is None:
        return None
    decoder, frames = MessageDecoder(message), scan.of(message_key(message))
    try:
        identity = data_id(message)
    except ValueError as e:
        raise InputError(str(e), key="--dbc") from None
    frames = good_frames(frames, decoder.length, identity)
    if not len(frames):
        return None
    values = decoder.read(frames.data)
    return TruthRecord(frames.time_us, values["MuAvailable"].astype(np.float32), values["MuUsed"].astype(np.float32))


MAX_AGE_US = 100_000  # of a truth that an Adhesion frame is compared with


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Of an axle's Valid frames with a truth, n of them; errors in percentage points, estimate less truth."""

    frames: int
    mean_error_pp: float
    mean_absolute_pp: float
    bounded: int  # frames whose interval has bounds
    held_share: float  # of these, those whose interval holds the truth; NaN without any
    worst_pp: float  # the most that was claimed beyond the truth; 0: never
    worst_at_us: int
    worst_said_pct: float
    worst_truth_pct: float
    lie_s: float  # how long the interval lay wholly above the truth


def truth_at(axle: StoryAxle, time_us: NDArray[np.int64]) -> NDArray[np.float64]:
    """The true available adhesion at some times, in percent; NaN where none came within MAX_AGE_US before."""
    t = axle.truth
    if t is None:
        return np.full(len(time_us), np.nan)
    return newest_values(t.time_us, t.available_pct, time_us, MAX_AGE_US)


def accuracy(axle: StoryAxle) -> Accuracy | None:
    """None without a Valid frame that has a truth."""
    a = axle.adhesion
    truth = truth_at(axle, a.time_us)
    rows = np.flatnonzero((a.validity == VALID_PLACE) & np.isfinite(a.available_pct) & np.isfinite(truth))
    if not len(rows):
        return None
    available, true = a.available_pct[rows].astype(np.float64), truth[rows]
    error = available - true
    low, high = a.low_pct[rows], a.high_pct[rows]
    bounded = np.isfinite(low)
    held = bounded & (low <= true) & (true <= high)
    worst = int(error.argmax())
    cycle_us = float(np.median(np.diff(a.time_us))) if len(a.time_us) > 1 else 0.0
    return Accuracy(
        len(rows),
        float(error.mean()),
        float(np.abs(error).mean()),
        int(bounded.sum()),
        float(held.sum() / bounded.sum()) if bounded.any() else float("nan"),
        max(float(error[worst]), 0.0),
        int(a.time_us[rows[worst]]),
        float(available[worst]),
        float(true[worst]),
        float((bounded & (low > true)).sum() * cycle_us * 1e-6),
    )
