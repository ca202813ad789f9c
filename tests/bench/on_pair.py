"""A kernel without CAN: the product's own SocketCAN link, with one end of a socket pair in the socket's place.

As a module it is `wrcd run` with the pair's end as file descriptor 3. At its end it prints, as JSON, which modules it
has imported and the most memory that it held.
"""

import json
import socket
import sys
from pathlib import Path

from wrcd.bus import socketcan

END = 3
CHANNEL = "lo"  # rtnetlink tells of an interface that is up


def pair() -> tuple[socket.socket, socket.socket]:
    """Both ends; what is read from either carries the kernel's time stamp. Datagrams over loopback: a local socket pair
    holds ten of them, fewer than come between two turns of the daemon."""
    one, other = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    for end in (one, other):
        end.bind(("127.0.0.1", 0))
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    one.connect(other.getsockname())
    other.connect(one.getsockname())
    return one, other


class PairLink(socketcan.SocketCanLink):
    """The daemon's own link, but for its opening and its socket options, which a pair has not."""

    def __init__(self, end: socket.socket, fd: bool = False) -> None:
        self._end = end
        super().__init__(CHANNEL, None, fd)

    def _open(self) -> socket.socket:
        self._end.setblocking(False)
        self._stamp(self._end)
        return self._end

    def _set(self, option: int, value: int | bytes | None, now_us: int) -> None:
        """A datagram socket has no option of a raw CAN socket."""


def use_pair(end_fd: int) -> None:
    """From now on every SocketCAN link of this process is that end, a file descriptor."""
    end = socket.socket(fileno=end_fd)
    socketcan.SocketCanLink = lambda channel, keys, fd=False: PairLink(end, fd)  # type: ignore[assignment,misc]  # a class's place


def resident_kb(pid: int | str = "self") -> dict[str, int]:
    """VmHWM and VmRSS of a process."""
    lines = (line.split() for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return {key[0].rstrip(":"): int(key[1]) for key in lines if key[0] in ("VmHWM:", "VmRSS:")}


def main() -> int:
    from wrcd.cli import main as cli

    use_pair(END)
    status = cli.main(["run", "-i", "socketcan", "-c", CHANNEL])
    print(json.dumps({"modules": sorted(sys.modules), **resident_kb()}))
    return status


if __name__ == "__main__":
    sys.exit(main())
