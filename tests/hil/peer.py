"""peer.py CHANNEL LOG LINE: makes a CAN interface of the kernel's slcan driver on a pty, and is what lies behind it.

To a program on the interface this is a controller with a driver, error states and bus-off. Orders come as lines of
standard input: play (a candump log, at its stamps, by a clock that nobody sets), quiet (play no more), off (the bus),
active, deaf (the line is not read), hear, end. What the interface sends is written to LINE, with milliseconds since the
beginning. Needs root, and nothing but Python's own library: it runs in the guest.
"""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
import tty

N_SLCAN, SIOCGIFNAME = 17, 0x8910  # line discipline
STATES = {"off": b"sb255000\r", "active": b"sa000000\r"}  # with error counters, as an slcan adapter tells them
LINE = re.compile(r"\((\d+)\.(\d+)\) \S+ ([0-9A-F]{3})#([0-9A-F]*)")


def main(channel: str, log: str, heard: str) -> None:
    with open(log) as file:
        matches = [LINE.match(line) for line in file]
    frames = [(int(m[1] + m[2]) * 1e-6, f"t{m[3]}{len(m[4]) // 2}{m[4]}\r".encode()) for m in matches if m]
    peer, line = pty.openpty()
    tty.setraw(line)
    fcntl.ioctl(line, termios.TIOCSETD, struct.pack("i", N_SLCAN))
    name = fcntl.ioctl(line, SIOCGIFNAME, bytes(16)).split(b"\0")[0].decode()
    for words in (("name", channel), ("up",)):
        subprocess.run(["ip", "link", "set", name, *words], check=True)
        name = channel
    began, at, deaf, off, text = time.monotonic(), 0, False, False, b""
    begin: float | None = None
    with open(heard, "w") as out:
        while True:
            now = time.monotonic()
            while begin is not None and at < len(frames) and begin + frames[at][0] - frames[0][0] <= now:
                if not off:
                    os.write(peer, frames[at][1])
                at += 1
            wait = 1.0 if begin is None or at == len(frames) else begin + frames[at][0] - frames[0][0] - now
            ready, _, _ = select.select([sys.stdin, *([] if deaf else [peer])], [], [], max(wait, 0))
            if peer in ready:
                *whole, text = (text + os.read(peer, 1 << 16)).split(b"\r")
                out.writelines(f"{(time.monotonic() - began) * 1e3:.0f} {t.decode()}\n" for t in whole)
            if sys.stdin in ready:
                order = sys.stdin.readline().strip()
                if order in STATES:
                    off = order == "off"
                    os.write(peer, STATES[order])
                elif order in ("deaf", "hear"):
                    deaf = order == "deaf"
                    out.write(f"{(time.monotonic() - began) * 1e3:.0f} {order}\n")
                elif order in ("play", "quiet"):
                    begin = time.monotonic() if order == "play" else None
                else:
                    return


if __name__ == "__main__":
    main(*sys.argv[1:])
