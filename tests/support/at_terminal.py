"""Run a command at a terminal of its own: at_terminal.py TEXT KEYS COMMAND. KEYS are pressed once TEXT stands there.

Ends with the command's status; with 124 if the text or the end does not come in time.
"""

import fcntl
import os
import pty
import re
import select
import struct
import sys
import termios
import time

LINES, COLUMNS = 34, 110
MAX_S = 60.0
ESCAPES = re.compile(rb"\x1b(?:\[[0-9;?<>=]*[A-Za-z]|\][^\x07]*\x07|[()][A-Z0-9]|[=>])")
TOO_LATE = 124


def main(text: str, keys: str, command: str) -> int:
    """Run it. What the terminal shows goes to standard output."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.environ.setdefault("TERM", "xterm-256color")
        os.execlp("bash", "bash", "-c", command)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, COLUMNS, 0, 0))
    end, shown, pressed = time.monotonic() + MAX_S, b"", False
    while time.monotonic() < end:
        if select.select([terminal], [], [], 0.1)[0]:
            try:
                shown += os.read(terminal, 1 << 16)
            except OSError:  # the command has closed it
                break
        if not pressed and text.encode() in ESCAPES.sub(b"", shown):
            os.write(terminal, keys.encode())
            pressed = True
    sys.stdout.buffer.write(ESCAPES.sub(b"", shown) + b"\n")
    ended, status = os.waitpid(pid, 0 if time.monotonic() < end else os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if ended and pressed else TOO_LATE


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
