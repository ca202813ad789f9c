"""What wrcd costs on this computer, as tables in Markdown: `make bench`. Figures alone: nothing is judged.

With BEFORE=DIR another checkout, of the tag `studies` or later, is measured in turn with this one, and each figure is
followed by the ratio of the two. Best alone on the computer: a ratio bears other work, a time less so.

A time is processor time of one thread, where nothing else is said: the shortest block and the median.
"""

import argparse
import gc
import json
import os
import platform
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from itertools import count, groupby, takewhile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
AXLES = (1, 2, 4, 6, 8)
RATES = (200, 1000)  # ticks a second
WARM_UP_TICKS, BLOCK_TICKS, BLOCKS = 1000, 200, 15  # a block is a second: every cycle of outgoing frames comes once
STARTS, REPLAYS, LOG_S = 5, 3, 300
SETTLE_S, TRAFFIC_S, WAIT_S = 3.0, 10.0, 60.0
THIS, BEFORE = "this", "before"
COMMAND = "import sys; from wrcd.cli.main import main; status = main(sys.argv[1:])"
AND_MEMORY = "; open('status', 'w').write(open('/proc/self/status').read()); sys.exit(status)"
ON_PAIR = "from tests.support.can_socket import use_pair; use_pair({}); " + COMMAND


def main() -> int:
    """Measure and print."""
    p = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    p.add_argument("--before", type=Path, metavar="DIR", help="another checkout, measured in turn with this one")
    p.add_argument("--core", nargs=2, metavar=("FRAMES", "CONFIG"), help=argparse.SUPPRESS)
    args = p.parse_args()
    if args.core:
        return core(*args.core)
    trees = {THIS: ROOT} | ({} if args.before is None else {BEFORE: args.before.resolve()})
    print(f"Measured on {machine()}.\n")
    for part in (cores, replays, starts, running):
        print("\n".join(part(trees)) + "\n", flush=True)
    return 0


def machine() -> str:
    """Which processor, how many, how busy, which Python."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown CPU")
    load = f"a load of {os.getloadavg()[0]:.1f} before"
    return f"{model}, {os.cpu_count()} cores with {load}, Python {platform.python_version()}"


def environment(tree: Path) -> dict[str, str]:
    """What `wrcd run` sets, and which tree is imported."""
    return os.environ | {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def figure(found: dict[str, list[float]], unit: str, digits: int = 3) -> str:
    """Shortest and median of this tree, and the median of the ratios of what ran one after another."""
    ours = found[THIS]
    said = f"{min(ours):.{digits}g} … {statistics.median(ours):.{digits}g} {unit}"
    if BEFORE in found:
        said += f"; {statistics.median(a / b for a, b in zip(ours, found[BEFORE], strict=True)):.3g} of before"
    return said


# --- the core


def core(frames_file: str, config_file: str) -> int:
    """Of whichever tree is imported: for each line of standard input feed a block of ticks as the daemon does, and
    print the nanoseconds that they took."""
    import wrcd
    from wrcd.bus.batch import FrameBatch
    from wrcd.bus.frame import Frame
    from wrcd.config.config import load_config
    from wrcd.core.core import Core

    made: Any = Core(load_config(Path(config_file)))
    feed = made.feed
    if hasattr(made, "feed_batch"):  # of a tree whose ticks in C are asked for
        made.explains, feed = False, made.feed_batch
    start_us, length_us, rows = json.loads(Path(frames_file).read_text())
    ticks = [[(at, i, bytes.fromhex(data)) for at, i, data in tick] for tick in rows]
    again = (start_us + turn * length_us for turn in count())
    source = (FrameBatch.of([Frame(us + at, i, data) for at, i, data in tick]) for us in again for tick in ticks)
    for _ in range(WARM_UP_TICKS):  # the longest window is full, the matrices' nodes are made
        list(feed(next(source)))
    gc.collect()
    gc.freeze()  # as the daemon does
    print(Path(wrcd.__file__).parents[1], flush=True)
    for _ in sys.stdin:
        block = [next(source) for _ in range(BLOCK_TICKS)]
        begin = time.thread_time_ns()
        for batch in block:
            list(feed(batch))
        print(time.thread_time_ns() - begin, flush=True)
    return 0


def cores(trees: dict[str, Path]) -> Iterator[str]:
    """A tick of the core by axles, each in a process of its own."""
    from tests.support.stretch import LENGTH_US, START_US, stretch
    from wrcd.config.config import packaged

    yield f"| axles | core, µs a tick |{''.join(f' share at {rate} ticks/s |' for rate in RATES)}"
    yield "|---|---|" + "---|" * len(RATES)
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        processes: dict[tuple[int, str], subprocess.Popen[str]] = {}
        for axles in AXLES:
            frames, config = Path(name, f"{axles}.json"), Path(name, f"{axles}.toml")
            by_tick = groupby(stretch(axles), lambda r: r.at_us // 5000)
            rows = [[(r.at_us, r.can_id, r.data.hex()) for r in tick] for _, tick in by_tick]
            frames.write_text(json.dumps([START_US, LENGTH_US, rows]))
            config.write_text(packaged(axles))
            for who, tree in trees.items():
                command = [sys.executable, "-P", __file__, "--core", str(frames), str(config)]
                processes[axles, who] = stack.enter_context(
                    subprocess.Popen(command, stdin=-1, stdout=-1, text=True, env=environment(tree), cwd=name)
                )
        for (_, who), process in processes.items():
            assert process.stdout is not None
            assert process.stdout.readline() == f"{trees[who]}\n", f"no core of {trees[who]}"
        times: dict[tuple[int, str], list[float]] = {key: [] for key in processes}
        for _ in range(BLOCKS):
            for key, process in processes.items():
                assert process.stdin is not None
                assert process.stdout is not None
                process.stdin.write("\n")
                process.stdin.flush()
                times[key].append(int(process.stdout.readline()) * 1e-3 / BLOCK_TICKS)
    for axles in AXLES:
        found = {who: times[axles, who] for who in trees}
        tick_us = statistics.median(found[THIS])
        yield f"| {axles} | {figure(found, 'µs')} |{''.join(f' {100e-6 * tick_us * rate:.1f} % |' for rate in RATES)}"


# --- whole commands


def most_mb(status: Path) -> float:
    """Of a process, by its file in /proc or a copy."""
    lines = (line.split() for line in status.read_text().splitlines())
    return next(int(words[1]) for words in lines if words[0] == "VmHWM:") / 1024


def replays(trees: dict[str, Path]) -> Iterator[str]:
    """A log of four axles, by the whole command."""
    from tests.support.stretch import START_US, frames
    from wrcd.bus.candump import format_line

    yield f"| processor time of `wrcd replay`, {LOG_S} s of four axles | by the wall | memory at most |\n|---|---|---|"
    wall, cpu, most = ({who: list[float]() for who in trees} for _ in range(3))
    with tempfile.TemporaryDirectory() as name:
        every = takewhile(lambda f: f.stamp_us < START_US + LOG_S * 1_000_000, frames())
        Path(name, "in.log").write_text("".join(format_line(f, "can0") + "\n" for f in every))
        for turn in range(REPLAYS):
            for who, tree in trees.items():
                begin, words = time.monotonic(), ("replay", "in.log", "-o", f"{who}-{turn}.log")
                command = [sys.executable, "-P", "-c", COMMAND + AND_MEMORY, *words]
                process = subprocess.Popen(command, env=environment(tree), cwd=name, stdout=-3, stderr=-3)
                _, status, used = os.wait4(process.pid, 0)
                process.returncode = os.waitstatus_to_exitcode(status)
                assert process.returncode == 0, f"{tree} does not replay"
                wall[who].append(time.monotonic() - begin)
                cpu[who].append(used.ru_utime + used.ru_stime)
                most[who].append(most_mb(Path(name, "status")))
    yield f"| {figure(cpu, 's')} | {LOG_S / min(wall[THIS]):.0f} times real time | {max(most[THIS]):.0f} MB |"


def starts(trees: dict[str, Path]) -> Iterator[str]:
    """`wrcd run` from nothing to READY, on python-can's virtual bus."""
    yield "| processor time of `wrcd run` until READY | time of the wall |\n|---|---|"
    wall, cpu = ({who: list[float]() for who in trees} for _ in range(2))
    for _ in range(STARTS):
        for who, tree in trees.items():
            begin = time.monotonic()
            with Daemon(tree, COMMAND, "virtual") as daemon:
                wall[who].append(time.monotonic() - begin)
                cpu[who].append(daemon.cpu_s())
    yield f"| {figure(cpu, 's')} | {figure(wall, 's')} |"


class Daemon:
    """`wrcd run` of a tree, told by NOTIFY_SOCKET when it is ready."""

    def __init__(self, tree: Path, code: str, interface: str, keep: Sequence[int] = ()) -> None:
        with tempfile.TemporaryDirectory() as name, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
            notify.bind(f"{name}/notify")
            notify.settimeout(WAIT_S)
            env = environment(tree) | {"NOTIFY_SOCKET": f"{name}/notify"}
            words = [sys.executable, "-P", "-c", code, "run", "-i", interface, "-c", "lo"]
            self.process = subprocess.Popen(words, env=env, cwd="/", stdin=-3, stdout=-3, stderr=-3, pass_fds=keep)
            try:
                while notify.recv(256) != b"READY=1":
                    pass
            except TimeoutError:
                self.process.kill()
                raise

    def cpu_s(self) -> float:
        """User and system time until now."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def __enter__(self) -> "Daemon":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(WAIT_S)


def running(_: dict[str, Path]) -> Iterator[str]:
    """The daemon of this tree on four axles' frames in real time, over a pair of sockets in the place of a CAN bus."""
    from tests.support.can_socket import FRAME, pair
    from tests.support.stretch import START_US, frames

    yield "| `wrcd run`, four axles in real time | |\n|---|---|"
    inside, outside = pair()
    ended = threading.Event()
    outside.settimeout(0.1)

    def take() -> None:
        while not ended.is_set():
            with suppress(TimeoutError):
                outside.recv(64)

    taker = threading.Thread(target=take)
    with inside, outside, Daemon(ROOT, ON_PAIR.format(fd := inside.fileno()), "socketcan", (fd,)) as daemon:
        taker.start()
        try:
            begin, settled = time.monotonic(), (0.0, 0.0)
            for f in takewhile(lambda f: f.stamp_us < START_US + (SETTLE_S + TRAFFIC_S) * 1e6, frames()):
                at_s = (f.stamp_us - START_US) * 1e-6
                if at_s > SETTLE_S and settled == (0.0, 0.0):
                    settled = daemon.cpu_s(), time.monotonic()
                time.sleep(max(at_s - (time.monotonic() - begin), 0.0))
                outside.send(FRAME.pack(f.can_id, len(f.data), f.data.ljust(8, b"\0")))
            share = (daemon.cpu_s() - settled[0]) / (time.monotonic() - settled[1])
            yield f"| of a core, its system calls included | {100 * share:.1f} % |"
            yield f"| resident memory at most | {most_mb(Path(f'/proc/{daemon.process.pid}/status')):.0f} MB |"
        finally:
            ended.set()
            taker.join()


if __name__ == "__main__":
    sys.exit(main())
