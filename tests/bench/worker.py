"""One core in a process of its own, of whichever tree PYTHONPATH names: fed a block of ticks whenever a line asks.

Started by path, it imports nothing of the tests, and knows where the commit before this layout kept its modules.
Arguments: the stretch, the configuration, the stretch's length. Each line of standard input is a number of ticks; each
line of standard output what they took, in nanoseconds of processor time. The first line tells which wrcd it is, and of
which axles an estimate came out while it warmed up.
"""

import gc
import sys
import time
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import wrcd
from wrcd.bus.frame import Frame
from wrcd.errors import InputError

TICK_US = 5_000
START_US = 1_700_000_000_000_000 - 1_700_000_000_000_000 % 300_000
WARM_UP = 1000  # ticks: the longest window is full, every cycle has been sent, the matrices' nodes are made


def any_of(*names: str) -> Any:
    """The first of these modules that this tree has. Only its files tell: an installed wrcd may have the others."""
    root = Path(wrcd.__file__).parents[1]
    return import_module(next(n for n in names if (root / f"{n.replace('.', '/')}.py").exists()))


def ticks(stretch: list[tuple[int, int, bytes]], length_us: int) -> Iterator[list[Frame]]:
    """The frames of tick after tick, without end."""
    by_tick: list[list[tuple[int, int, bytes]]] = [[] for _ in range(length_us // TICK_US)]
    for at_us, can_id, data in stretch:
        by_tick[at_us // TICK_US].append((at_us, can_id, data))
    begin_us = START_US
    while True:
        for tick in by_tick:
            yield [Frame(begin_us + at_us, can_id, data) for at_us, can_id, data in tick]
        begin_us += length_us


def main(stretch_file: str, config_file: str, length_us: str) -> None:
    load_config = any_of("wrcd.config.config", "wrcd.config").load_config
    core_of = any_of("wrcd.core.core").Core
    try:
        config = load_config(Path(config_file))
    except InputError as e:
        print("error", str(e).replace(config_file, "configuration"), flush=True)
        return
    core = core_of(config)
    lines = (line.split() for line in Path(stretch_file).read_text().splitlines())
    source = ticks([(int(at), int(can_id), bytes.fromhex(data)) for at, can_id, data in lines], int(length_us))
    out: list[Any] = []
    for _ in range(WARM_UP):
        for frame in next(source):
            out += core.feed(frame)
    # Validity lies in the high nibble of byte 1: 1 is Valid
    valid = {o.frame.can_id - 0x090 for o in out if 0x090 < o.frame.can_id < 0x0A0 and o.frame.data[1] >> 4 == 1}
    out.clear()
    gc.collect()
    gc.freeze()  # as the daemon does
    print(wrcd.__file__, *sorted(valid), flush=True)
    if hasattr(core, "feed_batch"):
        core.explains, batch_of = False, import_module("wrcd.bus.batch").FrameBatch.of
    for line in sys.stdin:
        block = [next(source) for _ in range(int(line))]
        if hasattr(core, "feed_batch"):  # as the daemon does
            batches, feed_batch = [batch_of(frames) for frames in block], core.feed_batch
            begin = time.thread_time_ns()
            for batch in batches:
                feed_batch(batch)
        else:
            feed, begin = core.feed, time.thread_time_ns()
            for frames in block:
                for frame in frames:
                    feed(frame)
        print(time.thread_time_ns() - begin, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
