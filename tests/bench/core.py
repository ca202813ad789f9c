"""The whole core per tick, of this tree and of an older one: each in a process of its own, asked in turn."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from tests.bench.timing import Case, Figure, Goal, Row, Times, in_turn, show
from tests.bench.workload import LENGTH_US, TICK_US, write_stretch
from tests.support.bus_load import bits_per_s, frames_per_s, of_axles
from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.config.config import packaged

ROOT = Path(__file__).parents[2]
WORKER = Path(__file__).with_name("worker.py")
ROUGH = 4  # axles on a rough track, one of which slides: the last row
AXLES = (1, 2, 4, 6, 8)
BEFORE_AXLES = (1, 4)
BLOCK_TICKS = 200  # a second: every cycle of outgoing frames comes once
BUDGET_S = 25.0
GROUP = "the whole core, µs a tick"
OURS, BEFORE = "ours", "before"
RATES = (200, 1000)  # ticks a second
KBIT_S = 500.0


class Worker:
    """A process that feeds its core on demand."""

    def __init__(self, tree: Path, stretch: Path, config: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(WORKER), str(stretch), str(config), str(LENGTH_US)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment(tree),
        )  # fmt: skip
        first = self._answer().split()
        if not first or first[0] == "error":
            self._process.communicate()
            raise RuntimeError(" ".join(first[1:]) or f"the core of {tree} does not start")
        self.tree = Path(first[0]).parents[1]
        self.valid = tuple(map(int, first[1:]))

    def _answer(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def ticks(self, count: int) -> int:
        """Feed so many ticks. Returns nanoseconds."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{count}\n")
        self._process.stdin.flush()
        return int(self._answer())

    def __enter__(self) -> "Worker":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.communicate()


def environment(tree: Path) -> dict[str, str]:
    """What `wrcd run` sets, and which tree is imported."""
    return os.environ | {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def rows(before: Path | None) -> Iterator[Row]:
    """By axles; against an older tree where its path is given."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder, workers, skipped = Path(name), dict[str, Worker](), dict[str, str]()
        for axles, rough in (*((axles, False) for axles in AXLES), (ROUGH, True)):
            row_name = _name(axles, rough)
            show(f"the core of {row_name} starts")
            stretch, config = folder / f"{row_name}.txt", folder / f"{axles}.toml"
            write_stretch(stretch, axles, rough)
            config.write_text(packaged(axles))
            for who, tree in ((OURS, ROOT), (BEFORE, before)):
                if tree is None or (who == BEFORE and axles not in BEFORE_AXLES):
                    continue
                try:
                    w = workers[f"{who} {row_name}"] = stack.enter_context(Worker(tree, stretch, config))
                except RuntimeError as e:
                    skipped[row_name] = f"skipped: {e}"
                    continue
                assert w.tree == tree.resolve(), f"{w.tree} instead of {tree}"
                if len(w.valid) < axles:
                    skipped[row_name] = f"{who}: Valid were only axles {w.valid}"
        show("the whole core, in turn" + (f", and that of {before}" if before else ""))
        times = in_turn({k: Case(w.ticks, BLOCK_TICKS) for k, w in workers.items()}, BUDGET_S)
        for axles, rough in (*((axles, False) for axles in AXLES), (ROUGH, True)):
            row_name = _name(axles, rough)
            row = Row(GROUP, row_name, note=skipped.get(row_name, ""))
            row.times = {who: times[f"{who} {row_name}"] for who in (OURS, BEFORE) if f"{who} {row_name}" in times}
            row.compare(OURS, BEFORE)
            if OURS in row.times:
                _add_share(row, axles, rough)
            against = {"8 axles": Goal("≤", 1.7), _name(ROUGH, True): Goal("≤", 1.3)}.get(row_name)
            if against is not None and OURS in row.times:
                this, four = times[f"ours {row_name}"], times["ours 4 axles"]
                name_of = f"{row_name} / 4 axles"
                row.figures.append(Figure(name_of, this.over(four), against, this.minimum / four.minimum))
            yield row


def _name(axles: int, rough: bool) -> str:
    return f"{axles} axles" + (", a rough track, one slides" if rough else "")


def _add_share(row: Row, axles: int, rough: bool) -> None:
    tick_us = row.times[OURS].median
    goal = Goal("≤", 40) if axles == 4 and not rough else None
    row.figures.append(Figure("a tick", tick_us, goal, unit="µs"))
    row.figures.append(Figure(f"share of a core, ticks of {TICK_US / 1000:g} ms", 100 * tick_us / TICK_US, unit="%"))


def table(core_us: Sequence[tuple[int, Times]]) -> Iterator[str]:
    """The table of docs/reference/cost.md: a line of Markdown for each number of axles that was measured."""
    rates = "".join(f" share at {rate} ticks/s |" for rate in RATES)
    yield f"| axles | frames/s in | frames/s out | bus load at {KBIT_S:g} kbit/s | core, µs a tick |{rates}"
    yield "|---|---|---|---|---|" + "---|" * len(RATES)
    for axles, times in core_us:
        every = of_axles(load_dbc(resources.DBC), None, axles)
        into, out = (frames_per_s([m for m in every if ("WRCD" in m.senders) is sent]) for sent in (False, True))
        low, high = (100 * bits_per_s(every, stuffed) / (1e3 * KBIT_S) for stuffed in (False, True))
        shares = "".join(f" {100e-6 * times.median * rate:.1f} % |" for rate in RATES)
        yield f"| {axles} | {into:.0f} | {out:.0f} | {low:.0f} … {high:.0f} % | {times.median:.0f} |{shares}"
