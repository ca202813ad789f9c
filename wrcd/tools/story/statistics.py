"""The bus over a log: rates, gaps and load."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import message_key
from wrcd.bus.dbc import Database, cycle_ms, find_message
from wrcd.bus.frame import EXTENDED
from wrcd.core.configuration import Config
from wrcd.tools.bus_load import BIT_RATE, bits
from wrcd.tools.story.records import BusStatistics, MessageStatistics
from wrcd.tools.story.scan import PLAIN_BYTES, Scan

SECOND_US = 1_000_000
MIN_LAST_S = 0.1  # of a log's last second, below which a rate says nothing
MAX_SECONDS = 200_000  # two days: of a longer log, whose clock was set perhaps, only the seconds with a frame are told


def bus(
    scan: Scan, config: Config, databases: Sequence[Database], truth: frozenset[int], own: frozenset[int],
    wrong: Mapping[int, int], bit_rate: int = BIT_RATE,
) -> BusStatistics:  # fmt: skip
    """Statistics of every id; truth and own are keys, wrong the frames by key whose E2E check fails."""
    names, cycles = _known(config, databases)
    mapped = {message_key(find_message(config.database, i.source.message)) for i in config.inputs}
    for output in _outputs(config):
        cycles[message_key(find_message(config.database, output[0]))] = output[1] / 1000
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
        gaps = np.diff(frames.time_us)
        # the silence to the log's end counts: of an input that died it is the gap
        silent = np.append(gaps, scan.end_us - frames.time_us[-1]) if len(gaps) else gaps
        widest = int(silent.argmax()) if len(gaps) else 0
        messages.append(
            MessageStatistics(
                key,
                names.get(key, ""),
                role,
                len(frames),
                float(1e6 * len(gaps) / max(frames.time_us[-1] - frames.time_us[0], 1)) if len(gaps) else 0.0,
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
    """Numbers of the seconds that rates are told of."""
    count = (scan.end_us - scan.begin_us) // SECOND_US + 1
    if count <= MAX_SECONDS:
        return np.arange(count, dtype=np.int64)
    found = [np.unique((f.time_us - scan.begin_us) // SECOND_US) for f in scan.frames.values()]
    return np.unique(np.concatenate([np.zeros(1, np.int64), *found]))


def _known(config: Config, databases: Sequence[Database]) -> tuple[dict[int, str], dict[int, float]]:
    """Names and cycles by key; the configuration's DBC wins."""
    names: dict[int, str] = {}
    cycles: dict[int, float] = {}
    for database in (*databases, config.database):
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


def _outputs(config: Config) -> list[tuple[str, int]]:
    """Messages that the daemon sends, and their cycles in microseconds."""
    outputs = [o for a in config.axles for o in (a.adhesion, a.detail, a.inputs, a.ahead)]
    outputs += [config.status, config.rejects, config.link]
    return [(o.message, o.cycle_us) for o in outputs if o is not None]
