"""Processes for the length of a test: bounded, and stopped by their process id."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

BIN = Path(sys.executable).parent
ROOT = Path(__file__).parents[2]


@contextmanager
def running(
    *command: str | Path, output: Path | None = None, stop: signal.Signals = signal.SIGTERM
) -> Iterator[subprocess.Popen[bytes]]:
    """A process for the length of a block; it is asked to stop at the end, and made to after ten seconds."""
    with output.open("wb") if output else open("/dev/null", "wb") as out:
        process = subprocess.Popen([str(c) for c in command], stdout=out, stderr=subprocess.PIPE)
        try:
            yield process
        finally:
            if process.poll() is None:
                process.send_signal(stop)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(10)
            if process.stderr:
                process.stderr.close()


def stopped(process: subprocess.Popen[bytes]) -> str:
    """What a process has written to standard error that SIGTERM ends well, in ten seconds."""
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0
    assert process.stderr is not None
    return process.stderr.read().decode()


def wait_for(what: str, seconds: float, done: Callable[[], bool]) -> None:
    """Look every 50 ms; fail with what was waited for."""
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, f"{what}: not within {seconds} s"
        time.sleep(0.05)


def gone(pid: int) -> bool:
    """Whether a process has ended, reaped or not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True
