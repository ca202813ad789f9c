"""A program on a terminal of its own, for as long as a test or a bench looks at it.

As a program, on_terminal.py TEXT KEYS COMMAND: KEYS are pressed once TEXT stands there. It ends with the command's
status; with 124 if the text or the end does not come in time.
"""

import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Mapping, Sequence
from fcntl import ioctl
from pathlib import Path

MAX_S = 60.0
ESCAPES = re.compile(rb"\x1b(?:\[[0-9;?<>=]*[A-Za-z]|\][^\x07]*\x07|[()][A-Z0-9]|[=>])")
TOO_LATE = 124


class OnTerminal:
    """What it draws is read and kept."""

    def __init__(
        self, command: Sequence[str], environment: Mapping[str, str], folder: Path | None = None,
        lines: int = 24, columns: int = 80, pass_fds: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self.seen = b""
        self.master, terminal = pty.openpty()
        ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        self.process = subprocess.Popen(
            command, cwd=folder, stdin=terminal, stdout=terminal, stderr=terminal, start_new_session=True,
            pass_fds=pass_fds, env={**os.environ, "TERM": "xterm-256color", **environment},
        )  # fmt: skip
        os.close(terminal)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        while not self._ended.is_set():
            if select.select([self.master], [], [], 0.05)[0]:
                try:
                    self.seen += os.read(self.master, 1 << 16)
                except OSError:
                    return

    def wait_for(self, text: bytes, seconds: float) -> None:
        end = time.monotonic() + seconds
        while text not in self.seen:
            assert self.process.poll() is None, self.seen.decode(errors="replace")
            assert time.monotonic() < end, f"{text!r} was not drawn: {self.seen[-2000:]!r}"
            time.sleep(0.05)

    def press(self, keys: bytes) -> None:
        os.write(self.master, keys)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._ended.set()
        self._thread.join()
        os.close(self.master)


def main(text: str, keys: str, command: str) -> int:
    """Run it. What the terminal shows goes to standard output."""
    terminal, end, pressed = OnTerminal(["bash", "-c", command], {}, None, 34, 110), time.monotonic() + MAX_S, False
    while (status := terminal.process.poll()) is None and time.monotonic() < end:
        if not pressed and text.encode() in ESCAPES.sub(b"", terminal.seen):
            terminal.press(keys.encode())
            pressed = True
        time.sleep(0.05)
    terminal.close()
    sys.stdout.buffer.write(ESCAPES.sub(b"", terminal.seen) + b"\n")
    return TOO_LATE if status is None or not pressed else status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
