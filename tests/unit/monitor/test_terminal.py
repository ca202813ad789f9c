"""The real program on a terminal: keys go in, the screen comes out."""

import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from fcntl import ioctl
from pathlib import Path
from typing import Any

import pytest

from tests.support.daemon_frames import GOOD, DaemonFrames
from wrcd.bus.candump import format_line
from wrcd.core.configuration import Config

ROOT = Path(__file__).parents[3]
COMMAND = (sys.executable, "-m", "wrcd.cli", "monitor")
START_S, END_S = 30.0, 20.0  # of a computer that has other work


@pytest.fixture(scope="module")
def log(config: Config, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Dry for nine seconds, leaves for six."""
    made = DaemonFrames(config)
    low = {**GOOD, "MuAvailable": 5.0, "MuUsed": 4.0}
    frames = [*made.stretch(0, 9_000_000, GOOD), *made.stretch(9_000_000, 15_000_000, low)]
    path = tmp_path_factory.mktemp("terminal") / "ride.log"
    path.write_text("".join(f"{format_line(f, 'can0')}\n" for f in frames))
    return path


def on_terminal(
    arguments: list[str], keys: bytes, ready: bytes, number: int = 0, modes: list[Any] | None = None
) -> tuple[int, bytes]:
    """Run it on a terminal of 80 by 24, press keys or send a signal once something is seen. Returns its status and all
    its output; modes take the terminal's before and after."""
    master, terminal = pty.openpty()
    if modes is not None:
        modes.append(termios.tcgetattr(master))
    ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    process = subprocess.Popen(
        [*COMMAND, *arguments], cwd=ROOT, stdin=terminal, stdout=terminal, stderr=terminal, start_new_session=True,
        env={**os.environ, "TERM": "xterm-256color", "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    os.close(terminal)
    seen, pressed, end = b"", False, time.monotonic() + START_S
    try:
        while time.monotonic() < end:
            if select.select([master], [], [], 0.1)[0]:
                try:
                    seen += os.read(master, 1 << 16)
                except OSError:  # its side is closed
                    break
            elif process.poll() is not None:
                break
            if not pressed and ready in seen:
                pressed, end = True, time.monotonic() + END_S
                if number:
                    process.send_signal(number)
                os.write(master, keys)
        status = process.wait(5.0)
        if modes is not None:
            modes.append(termios.tcgetattr(master))
        return status, seen
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        os.close(master)


def test_key_ends_it_with_status_0_and_the_terminal_is_as_before(log: Path) -> None:
    status, seen = on_terminal([str(log)], b"q", b"quit")
    assert status == 0
    assert b"\x1b[?1049l" in seen  # the screen of before is back
    assert b"available" in seen


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_signal_ends_it_and_the_terminal_is_as_before(log: Path, number: signal.Signals) -> None:
    modes: list[Any] = []
    status, seen = on_terminal([str(log)], b"", b"quit", number, modes)
    assert status == 128 + number
    for off in (b"\x1b[?1049l", b"\x1b[?25h", b"\x1b[?1000l"):  # screen of before, cursor, mouse
        assert off in seen, off
    before, after = modes
    assert after[3] & (termios.ECHO | termios.ICANON) == before[3] & (termios.ECHO | termios.ICANON) != 0


def test_bus_that_is_not_there_is_one_line_and_status_3() -> None:
    status, seen = on_terminal(["-i", "socketcan", "-c", "nosuchbus9"], b"", b"\0never")
    assert status == 3
    assert seen.count(b"\n") == 1
    assert seen.startswith(b"wrcd: error: channel: CAN interface 'nosuchbus9'") or b"AF_CAN" in seen
    assert b"\x1b[?1049h" not in seen
