"""From start to READY, resident memory, imported modules, and the running daemon's share of a core."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tests.bench.core import BEFORE, OURS, ROOT, environment
from tests.bench.frames import packed
from tests.bench.on_pair import END, pair, resident_kb
from tests.bench.timing import Figure, Goal, Row, Times, show
from tests.bench.workload import frames

STARTS, RUNS = 7, 3
WARM_UP_S, TRAFFIC_S = 3.0, 5.0  # the window fills and the estimator settles first
WAIT_S = 20.0
FORBIDDEN = ("scipy", "matplotlib", "skfuzzy", "filterpy", "numba", "sim_ecu")
VIRTUAL = ("-m", "wrcd.cli", "run", "-i", "virtual", "-c", "bench")


@dataclass(frozen=True, slots=True)
class Started:
    """What one daemon told: seconds to READY, of real and of processor time, its modules, memory in KiB, share of a
    core under traffic."""

    ready_s: float
    cpu_s: float
    modules: tuple[str, ...] = ()
    most_kb: int = 0
    resident_kb: int = 0
    share: float = 0.0


def start(
    arguments: Sequence[str],
    tree: Path = ROOT,
    end: socket.socket | None = None,
    traffic: socket.socket | None = None,
) -> Started:
    """Start a tree's daemon, wait for READY, feed it where there is something to feed, and stop it."""
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        address = f"{folder}/notify"
        notify.bind(address)
        notify.settimeout(WAIT_S)
        begin = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, *arguments], env=environment(tree) | {"NOTIFY_SOCKET": address}, cwd=tree, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL,
            preexec_fn=None if end is None else lambda: os.dup2(end.fileno(), END, inheritable=True),
            pass_fds=() if end is None else (END,),
        )  # fmt: skip
        try:
            while notify.recv(256) != b"READY=1":
                pass
            ready_s = time.perf_counter() - begin
            cpu_s, held_kb, share = _cpu_s(process.pid), 0, 0.0
            if traffic is not None:
                share = _feed(traffic, process.pid)
                held_kb = resident_kb(process.pid)["VmRSS"]
            process.send_signal(signal.SIGTERM)
            out, _ = process.communicate(timeout=WAIT_S)
        finally:
            with suppress(ProcessLookupError):
                process.kill()
        told = json.loads(out) if end is not None else {}
        return Started(ready_s, cpu_s, tuple(told.get("modules", ())), told.get("VmHWM", 0), held_kb, share)


def _cpu_s(pid: int) -> float:
    """User and system time of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _feed(traffic: socket.socket, pid: int) -> float:
    """The stretch in real time; what the daemon sends is read and thrown away. Returns the share of a core that the
    process took in the last TRAFFIC_S."""
    stop = threading.Event()
    traffic.settimeout(0.1)

    def read() -> None:
        while not stop.is_set():
            with suppress(TimeoutError):
                traffic.recv(64)

    reader = threading.Thread(target=read)
    reader.start()
    try:
        begin = time.perf_counter()
        first_us, settled = None, (0.0, 0.0)
        for f in frames():
            first_us = f.stamp_us if first_us is None else first_us
            at_s = (f.stamp_us - first_us) * 1e-6
            if at_s > WARM_UP_S + TRAFFIC_S:
                break
            if at_s > WARM_UP_S and settled == (0.0, 0.0):
                settled = _cpu_s(pid), time.perf_counter()
            time.sleep(max(at_s - (time.perf_counter() - begin), 0.0))
            with suppress(TimeoutError):
                traffic.send(packed(f))
        return (_cpu_s(pid) - settled[0]) / (time.perf_counter() - settled[1])
    finally:
        stop.set()
        reader.join()


def over_pair(traffic: bool, tree: Path = ROOT) -> Started:
    """A tree's daemon as on SocketCAN."""
    inside, outside = pair()
    with inside, outside:
        return start(("-m", "tests.bench.on_pair"), tree, inside, outside if traffic else None)


def rows(before: Path | None) -> Iterator[Row]:
    """Start by SocketCAN's path and on python-can's virtual bus in turn, then one daemon under traffic; beside an
    older tree's, in turn."""
    trees = {OURS: ROOT} | ({} if before is None else {BEFORE: before})
    of_before = "" if before is None else f", and that of {before}"
    show(f"start to READY{of_before}")
    starts: dict[str, list[Started]] = {OURS: [], "virtual": [], BEFORE: []}
    for _ in range(STARTS):
        for who, tree in trees.items():
            starts[who].append(over_pair(traffic=False, tree=tree))
        starts["virtual"].append(start(VIRTUAL))
    row = Row("start to READY", "SocketCAN's path, and python-can's virtual bus", unit="s")
    row.times = {who: Times(tuple(s.ready_s for s in every)) for who, every in starts.items() if every}
    row.compare(OURS, BEFORE, Goal("≤", 1))
    row.figures.append(Figure("start to READY", row.times[OURS].minimum, Goal("≤", 0.4), unit="s"))
    row.figures.append(Figure("of it processor time", min(s.cpu_s for s in starts[OURS]), unit="s"))
    row.note = "a socket over loopback in the place of the raw CAN socket; the goal is for an idle machine: the minimum"
    yield row
    show(f"the daemon under {TRAFFIC_S:g} s of traffic{of_before}")
    runs = [{who: over_pair(traffic=True, tree=tree) for who, tree in trees.items()} for _ in range(RUNS)]
    running = runs[0][OURS]
    found = [m for m in FORBIDDEN if m in running.modules]
    row = Row("the running daemon", "four axles, real time", unit="% of a core")
    row.times = {who: Times(tuple(100 * run[who].share for run in runs)) for who in trees}
    row.compare(OURS, BEFORE, Goal("≤", 0.25))
    row.figures += [
        Figure("share of a core, its system calls included", row.times[OURS].median, unit="%"),
        Figure("most resident memory (VmHWM)", running.most_kb / 1024, Goal("≤", 50), unit="MB"),
        Figure("resident memory (VmRSS)", running.resident_kb / 1024, unit="MB"),
    ]
    if before is not None:
        row.figures.append(Figure("resident memory before (VmRSS)", runs[0][BEFORE].resident_kb / 1024, unit="MB"))
    row.figures += [
        Figure("modules imported", len(running.modules)),
        Figure(f"of {', '.join(FORBIDDEN)}", len(found), Goal("≤", 0)),
    ]
    row.note = f"imported: {', '.join(found)}" if found else ""
    yield row
