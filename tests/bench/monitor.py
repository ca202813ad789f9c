"""Measure `wrcd monitor` at a full bus: `python -m tests.bench.monitor [--rate 4000] [--seconds 20] [--size 80x24]`.

Its real screen on a pseudo-terminal, its real reader on one end of a socket pair, which holds as much as the link asks
the kernel for; with --default-buffer 278 frames, as a CAN socket's default does. Prints the share of a core of both
processes, updates of the screen a second, frames lost and bytes to the terminal. Asserts nothing.
"""

import argparse
import json
import os
import re
import socket
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.bench.frames import packed
from tests.bench.monitor_app import MODULE
from tests.bench.workload import LENGTH_US, frames
from tests.support.on_terminal import OnTerminal
from wrcd.bus.frame import Frame
from wrcd.bus.socketcan import RECEIVE_BUFFER
from wrcd.config.config import load_config
from wrcd.core.core import Core

SO_SNDBUFFORCE = 32
UNMAPPED_ID = 0x300
TURN_S = 0.002
START_S = 15.0


@dataclass(frozen=True, slots=True)
class Seen:
    """What a run has come to. Shares are of a core, of the seconds under load."""

    rate: float
    size: str
    seconds: float
    screen_share: float
    reader_share: float
    updates_per_s: float
    lost: int
    sent: int
    bytes_per_s: float
    start_s: float
    resident_mb: float

    def text(self) -> str:
        """For a person."""
        both = 100 * (self.screen_share + self.reader_share)
        return (
            f"{self.rate:.0f} frames/s, {self.size}, {self.seconds:.0f} s: {both:.1f} % of a core (screen "
            f"{100 * self.screen_share:.1f}, reader {100 * self.reader_share:.1f}), {self.updates_per_s:.1f} "
            f"updates/s, {self.lost} of {self.sent} frames lost, {self.bytes_per_s / 1000:.1f} kB/s to the terminal; "
            f"start {self.start_s:.2f} s, {self.resident_mb:.0f} MB"
        )


def traffic(rate: float) -> list[list[bytes]]:
    """Frames of 4.8 s that can follow themselves, in turns of TURN_S: the sensors', the daemon's, and as many
    unmapped ones as make the rate."""
    core = Core(load_config(None))
    sensors: list[Frame] = []
    made: list[Frame] = []
    first_us = None
    for f in frames():
        first_us = f.stamp_us if first_us is None else first_us
        if f.stamp_us - first_us >= 2 * LENGTH_US:
            break
        out = [o.frame for o in core.feed(f)]
        if f.stamp_us - first_us >= LENGTH_US:
            sensors.append(f)
            made += out
    every = sorted([*sensors, *made], key=lambda f: f.stamp_us)
    begin_us = sensors[0].stamp_us
    turns: list[list[bytes]] = [[] for _ in range(round(LENGTH_US / 1e6 / TURN_S))]
    for f in every:
        turns[min(max(int((f.stamp_us - begin_us) / 1e6 / TURN_S), 0), len(turns) - 1)].append(packed(f))
    missing = rate * LENGTH_US / 1e6 - len(every)
    if missing > 0:
        unmapped = packed(Frame(0, UNMAPPED_ID, bytes(8)))
        for k, turn in enumerate(turns):
            turn += [unmapped] * (int((k + 1) * missing / len(turns)) - int(k * missing / len(turns)))
    return turns


def send(end: socket.socket, turns: Sequence[Sequence[bytes]], seconds: float) -> tuple[int, int]:
    """Send in real time. Returns how many were sent, and how many a full buffer refused."""
    sent = refused = 0
    end.setblocking(False)
    begin, number = time.monotonic(), 0
    while (due := begin + number * TURN_S) < begin + seconds:
        pause = due - time.monotonic()
        if pause > 0:
            time.sleep(pause)
        for data in turns[number % len(turns)]:
            try:
                end.send(data)
                sent += 1
            except BlockingIOError:
                refused += 1
        number += 1
    return sent, refused


def measure(rate: float, seconds: float, columns: int, lines: int, default_buffer: bool = False) -> Seen:
    """One run."""
    turns = traffic(rate)
    inside, outside = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    if not default_buffer:
        force = SO_SNDBUFFORCE if os.geteuid() == 0 else socket.SO_SNDBUF
        outside.setsockopt(socket.SOL_SOCKET, force, RECEIVE_BUFFER)
    with tempfile.TemporaryDirectory() as folder, inside, outside:
        said = Path(folder) / "seen.json"
        environment = {"MONITOR_BENCH": str(said), "MONITOR_END": str(inside.fileno()), "NO_COLOR": ""}
        began = time.monotonic()
        app = OnTerminal(
            [sys.executable, "-m", MODULE], environment, lines=lines, columns=columns, pass_fds=(inside.fileno(),)
        )
        try:
            while not app.seen and time.monotonic() - began < START_S and app.process.poll() is None:
                time.sleep(0.01)
            start_s = time.monotonic() - began
            time.sleep(1.0)
            if app.process.poll() is not None:
                raise RuntimeError(f"it ended with {app.process.returncode}")
            before, cpu_before = len(app.seen), cpu_s(app.process.pid)
            begin = time.monotonic()
            sent, refused = send(outside, turns, seconds)
            took = time.monotonic() - begin
            cpu_after, after = cpu_s(app.process.pid), len(app.seen)
            time.sleep(0.5)
            app.press(b"q")
            app.process.wait(10.0)
        finally:
            app.close()
        if not said.exists():
            raise RuntimeError("it ended without a word")
        seen = json.loads(said.read_text())
    share = [(b - a) / took for a, b in zip(cpu_before, cpu_after, strict=True)]
    updates = sum(begin <= t <= begin + took for t in seen["updates"])
    return Seen(
        (sent + refused) / took, f"{columns}x{lines}", took, share[0], share[1],
        updates / took, sent + refused - seen["frames"], sent + refused,
        (after - before) / took, start_s, seen["resident_kb"] / 1024,
    )  # fmt: skip


def cpu_s(pid: int) -> tuple[float, float]:
    """Processor time of a process so far, and of its child."""
    every = [fields for stat in Path("/proc").glob("[0-9]*/stat") if (fields := _stat(stat))]
    tick = os.sysconf("SC_CLK_TCK")
    own = sum(int(f[11]) + int(f[12]) for number, f in every if number == pid)
    children = sum(int(f[11]) + int(f[12]) for _, f in every if int(f[1]) == pid)
    return own / tick, children / tick


def _stat(stat: Path) -> tuple[int, list[str]] | None:
    """A process's number, and what stands behind its name."""
    try:
        return int(stat.parent.name), re.sub(r"^\d+ \(.*\) ", "", stat.read_text()).split()
    except (FileNotFoundError, ProcessLookupError):
        return None


def main() -> int:
    """Entry point."""
    p = argparse.ArgumentParser(prog="python -m tests.bench.monitor", description=__doc__)
    p.add_argument("--rate", type=float, default=4000.0, metavar="N", help="frames a second")
    p.add_argument("--seconds", type=float, default=20.0, metavar="S")
    p.add_argument("--size", default="80x24", metavar="WxH", help="of the terminal; several with commas between them")
    p.add_argument("--default-buffer", action="store_true", help="of the kernel: 278 frames")
    args = p.parse_args()
    for size in args.size.split(","):
        columns, lines = map(int, size.split("x"))
        print(measure(args.rate, args.seconds, columns, lines, args.default_buffer).text(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
