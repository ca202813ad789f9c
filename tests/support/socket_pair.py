"""A kernel without CAN: the product's own SocketCAN link, with one end of a socket pair in the socket's place."""

import socket

from wrcd.bus import socketcan

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
