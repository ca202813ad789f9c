"""A program on a terminal of its own, for as long as a test or a bench looks at it."""

import os
import pty
import select
import struct
import subprocess
import termios
import threading
import time
from collections.abc import Mapping, Sequence
from fcntl import ioctl
from pathlib import Path


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
