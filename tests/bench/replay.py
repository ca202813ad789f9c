"""Replay of logs and the rig's simulation, in simulated seconds a second; memory of a long log against a short one."""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import can

from sim_ecu.play.player import Player
from tests.bench.core import ROOT, environment
from tests.bench.timing import Figure, Goal, Row, Times, show
from tests.bench.workload import scenario, write_log
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

SHORT_S, BLF_S, LONG_S = 60.0, 120.0, 600.0
# what a command took, imports and processes of its own included, and the most memory it held; of an older tree, too
CHILD = """
import contextlib, importlib, io, json, resource, sys, time
begin = time.perf_counter()
with contextlib.redirect_stdout(io.StringIO()):
    try:
        main = importlib.import_module(sys.argv[1] + ".cli.main").main
    except ModuleNotFoundError:
        from wrcd.tools.cli import main
    status = main(sys.argv[2:])
others = resource.getrusage(resource.RUSAGE_CHILDREN)
took, cpu = time.perf_counter() - begin, time.process_time() + others.ru_utime + others.ru_stime
lines = open("/proc/self/status").read().splitlines()
most_kb = next(int(x.split()[1]) for x in lines if x.startswith("VmHWM:"))
print(json.dumps({"wall_s": took, "cpu_s": cpu, "most_mb": most_kb / 1024}))
sys.exit(status)
"""


def measured(command: Sequence[str], folder: Path, tree: Path = ROOT, program: str = "wrcd") -> dict[str, float]:
    """What a command of a program took in a process of its own: wall_s, cpu_s, most_mb."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", CHILD, program, *command], env=environment(tree), cwd=folder,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    out: dict[str, float] = json.loads(done.stdout)
    return out


def replayed(log: Path, tree: Path = ROOT) -> tuple[float, float, Path]:
    """Seconds and megabytes that a replay took, and the frames it made."""
    out = next(p for i in count() if not (p := log.with_name(f"sent-{i}.log")).exists())
    took = measured(["replay", str(log), "-o", str(out)], log.parent, tree)
    return took["wall_s"], took["most_mb"], out


def write_blf(log: Path, blf: Path) -> None:
    """The same frames as Vector's binary log."""
    with can.BLFWriter(blf) as writer:
        for f, _ in read_log(log, Damage()):
            writer.on_message_received(
                can.Message(timestamp=f.stamp_us * 1e-6, arbitration_id=f.can_id, data=f.data, is_extended_id=False)
            )


def rows(before: Path | None) -> Iterator[Row]:
    """Logs of one, two and ten minutes, then the simulation."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        show("logs are written")
        logs = {s: folder / f"{s:g}.log" for s in (SHORT_S, BLF_S, LONG_S)}
        for seconds, log in logs.items():
            write_log(log, seconds)
        write_blf(logs[BLF_S], logs[BLF_S].with_suffix(".blf"))
        show("replay of a minute" + (f", and by {before}" if before else ""))
        short = [replayed(logs[SHORT_S]) for _ in range(3)]
        row = Row("replay of four axles' log", f"candump, {SHORT_S:g} s", unit="s")
        row.times["ours"] = Times(tuple(s for s, _, _ in short))
        if before is not None:
            old = [replayed(logs[SHORT_S], before) for _ in range(3)]
            row.times["before"] = Times(tuple(s for s, _, _ in old))
            row.compare("ours", "before")
            if old[0][2].read_bytes() != short[0][2].read_bytes():
                row.note = "the frames made differ from those of before"
        row.figures.append(_speed(SHORT_S, row.times["ours"], None))
        yield row
        show("replay of ten minutes")
        took_s, most_mb, _ = replayed(logs[LONG_S])
        row = Row("replay of four axles' log", f"candump, {LONG_S:g} s", unit="s", times={"ours": Times((took_s,))})
        if before is not None:
            row.times["before"] = Times((replayed(logs[LONG_S], before)[0],))
            row.compare("ours", "before", Goal("≤", 0.1))
        more_mb = most_mb - min(mb for _, mb, _ in short)
        row.figures = [
            _speed(LONG_S, row.times["ours"], Goal("≥", 200)),
            Figure("most resident memory", most_mb, unit="MB"),
            Figure("more than for a minute", more_mb, Goal("≤", 10), unit="MB"),
        ]
        yield row
        show("replay of a .blf")
        took = Times(tuple(replayed(logs[BLF_S].with_suffix(".blf"))[0] for _ in range(2)))
        row = Row("replay of four axles' log", f".blf, {BLF_S:g} s", unit="s", times={"ours": took})
        if before is not None:
            row.times["before"] = Times(tuple(replayed(logs[BLF_S].with_suffix(".blf"), before)[0] for _ in range(2)))
            row.compare("ours", "before", Goal("≤", 0.25))
        row.figures.append(_speed(BLF_S, took, Goal("≥", 25)))
        yield row
    show("simulation")
    yield _simulation()


def _speed(seconds: float, took: Times, goal: Goal | None) -> Figure:
    return Figure("simulated seconds a second", seconds / took.minimum, goal)


def _simulation() -> Row:
    """The rig's four nonlinear wheelsets and their frames, once compiled."""
    s = scenario()
    took = []
    for _ in range(4):
        begin = time.perf_counter()
        for _ in Player(s):
            pass
        took.append(time.perf_counter() - begin)
    row = Row("simulation", f"four wheelsets with their frames, {s.duration_s:g} s", unit="s")
    row.times["ours"] = Times(tuple(took[1:]))
    row.figures.append(_speed(s.duration_s, row.times["ours"], None))
    return row
