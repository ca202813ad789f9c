"""The bus over a log: rates, gaps and load; and counters that wrap round."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wrcd.bus.dbc import Database, cycle_ms, find_message
from wrcd.bus.frame import EXTENDED
from wrcd.bus.positions import message_key
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import MESSAGES, Numeric
from wrcd.logs.decoder import sent_messages
from wrcd.logs.scan import PLAIN_BYTES, Scan
from wrcd.logs.story_records import BusStatistics, MessageStatistics, Series

SECOND_US = 1_000_000
MIN_LAST_S = 0.1  # of a log's last second, below which a rate says nothing
MAX_SECONDS = 200_000  # two days: of a longer log, whose clock was set perhaps, only the seconds with a frame are shown
BIT_RATE = 500_000  # bit/s, where nobody says another
BEHIND = 13  # bits without stuffing: CRC delimiter, acknowledgement, end of frame, and the three between two frames
HEADS = {False: (19, 22), True: (39, 41)}  # from start of frame to DLC by extended: classical, FD
CRC = 15  # of a classical frame; stuff bits cover it
FD_CRC_16, FD_CRC_64 = 4 + 17 + 6, 4 + 21 + 7  # of up to 16 bytes, of more: stuff count, CRC, its fixed stuff bits


def bits(data_bytes: ArrayLike, extended: ArrayLike, fd: ArrayLike) -> NDArray[np.float64]:
    """Bits of frames on the wire, the three between two frames included, with the mean of fewest and most stuff bits:
    none, and one after the first five and each further four bits that they cover.

    All bits count as of the arbitration's rate: of an FD frame whose data is faster it is the most that it can take.
    """
    payload = 8.0 * np.asarray(data_bytes)
    extended, fd = np.asarray(extended, dtype=bool), np.asarray(fd, dtype=bool)
    (classical, flexible), (classical_29, flexible_29) = HEADS[False], HEADS[True]
    head = np.where(fd, np.where(extended, flexible_29, flexible), np.where(extended, classical_29, classical))
    covered = head + payload + np.where(fd, 0, CRC)
    apart = np.where(fd, np.where(payload > 128, FD_CRC_64, FD_CRC_16), 0)
    out: NDArray[np.float64] = covered + apart + BEHIND + 0.5 * ((covered - 1) // 4)
    return out


def bus(
    scan: Scan, config: Config, databases: Sequence[Database], truth: frozenset[int], own: frozenset[int],
    wrong: Mapping[int, int], bit_rate: int = BIT_RATE,
) -> BusStatistics:  # fmt: skip
    """Statistics of every id; truth and own are keys, wrong the frames by key whose E2E check fails."""
    names, cycles = _known(config, databases)
    mapped = {message_key(find_message(config.database, i.source.message)) for i in config.inputs}
    for _, _, output in sent_messages(config):
        cycles[message_key(find_message(config.database, output.message))] = output.cycle_us / 1000
    seconds = _seconds(scan)
    counts, load = np.zeros(len(seconds)), np.zeros(len(seconds))
    messages = []
    for key, frames in scan.frames.items():
        at = np.searchsorted(seconds, (frames.time_us - scan.begin_us) // SECOND_US)
        counts += np.bincount(at, minlength=len(seconds))
        load += np.bincount(
            at, weights=bits(frames.lengths, bool(key & EXTENDED), frames.lengths > PLAIN_BYTES), minlength=len(seconds)
        )
        role = "input" if key in mapped else "output" if key in own else "truth" if key in truth else "other"
        recorded_us = scan.gaps.taken_out(frames.time_us)
        gaps = np.diff(recorded_us)
        # the silence to the log's end counts: of an input that died it is the gap
        silent = np.append(gaps, scan.end_us - scan.gaps.total_us - recorded_us[-1]) if len(gaps) else gaps
        widest = int(silent.argmax()) if len(gaps) else 0
        messages.append(
            MessageStatistics(
                key,
                names.get(key, ""),
                role,
                len(frames),
                float(1e6 * len(gaps) / max(recorded_us[-1] - recorded_us[0], 1)) if len(gaps) else 0.0,
                float(silent[widest] / 1000) if len(gaps) else float("nan"),
                int(frames.time_us[widest]),
                cycles.get(key, float("nan")),
                wrong.get(key, -1),
            )
        )
    # the last second is as long as the log, not a whole one
    last_s = (scan.end_us - scan.begin_us) / SECOND_US - seconds[-1]
    length_s = np.ones(len(seconds))
    length_s[-1] = last_s if len(seconds) > 1 and last_s > MIN_LAST_S else 1.0
    return BusStatistics(
        tuple(messages),
        scan.begin_us + SECOND_US * seconds,
        (counts / length_s).astype(np.float32),
        (100 * load / length_s / bit_rate).astype(np.float32),
        bit_rate,
        np.array(sorted(scan.errors_us), dtype=np.int64),
    )


def _seconds(scan: Scan) -> NDArray[np.int64]:
    """Numbers of the seconds that have rates."""
    count = (scan.end_us - scan.begin_us) // SECOND_US + 1
    if count <= MAX_SECONDS:
        return np.arange(count, dtype=np.int64)
    found = [np.unique((f.time_us - scan.begin_us) // SECOND_US) for f in scan.frames.values()]
    return np.unique(np.concatenate([np.zeros(1, np.int64), *found]))


def _known(config: Config, databases: Sequence[Database]) -> tuple[dict[int, str], dict[int, float]]:
    """Names and cycles by key; the configuration's DBC wins, then the first."""
    names: dict[int, str] = {}
    cycles: dict[int, float] = {}
    for database in (*reversed(databases), config.database):
        for m in database.messages:
            key = message_key(m)
            names[key] = m.name
            try:
                cycle = cycle_ms(m)
            except ValueError:
                cycle = None
            if cycle:
                cycles[key] = float(cycle)
    return names, cycles


NO_COUNTS = frozenset({"DesignChecksum"})


def moduli(key: str) -> dict[str, float]:
    """The counts of a message (its key in the configuration) that go on from frame to frame, and where they wrap.
    Those of WrcdRejects begin anew with each frame."""
    if key == "rejects_message":
        return {}
    named = {n: k for n, k in MESSAGES[key].items() if isinstance(k, Numeric) and n not in NO_COUNTS}
    return {name: kind.high + 1.0 for name, kind in named.items()}


def restarts(series: Series, key: str) -> NDArray[np.bool_]:
    """Frames before which the daemon was restarted, (n,): a count went back so far that it cannot have wrapped."""
    out = np.zeros(len(series.time_us), dtype=bool)
    for name, modulo in moduli(key).items():
        values = series.values.get(name)
        if values is not None:
            out[1:] |= restarted(values, modulo)
    return out


def added(series: Series, key: str) -> Mapping[str, NDArray[np.float64]]:
    """What was added to each count since the frame before, (n,); after a restart all that was counted since it."""
    anew = restarts(series, key)
    out = {}
    for name, modulo in moduli(key).items():
        values = series.values.get(name)
        if values is not None:
            out[name] = np.concatenate((np.zeros(1), growth(values, modulo, anew[1:])))
    return out


def restarted(values: NDArray[np.float64], modulo: float) -> NDArray[np.bool_]:
    """Where a count, (n,), began anew before a frame, (n - 1,): it fell, and had it wrapped round it would have grown
    by half the modulo or more."""
    steps = np.diff(values)
    out: NDArray[np.bool_] = (steps < 0) & (steps % modulo >= modulo / 2)
    return out


def growth(values: NDArray[np.float64], modulo: float, anew: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
    """By how much a count, (n,), grew from each frame to the next, (n - 1,). Where it began anew (None: as it tells
    itself) what it says has grown since."""
    anew = restarted(values, modulo) if anew is None else anew
    out: NDArray[np.float64] = np.where(anew, values[1:], np.diff(values) % modulo)
    return out
