"""A kernel without CAN: the product's own SocketCAN link, on a datagram socket in the place of the raw CAN socket."""

import errno
import os
import socket
import struct
from collections import deque
from types import SimpleNamespace
from typing import Any

from wrcd import native
from wrcd.bus import socketcan
from wrcd.bus.batch import word_of
from wrcd.bus.frame import ERROR, Frame
from wrcd.bus.rawcan import (
    CAN_RAW_ERR_FILTER,
    CAN_RAW_FD_FRAMES,
    CAN_RAW_RECV_OWN_MSGS,
    FILTER,
)

FRAME = struct.Struct("=IB3x8s")  # struct can_frame
FD_FRAME = struct.Struct("=IBB2x64s")  # struct canfd_frame
CHANNEL = "lo"  # rtnetlink tells of an interface that is up


class CanSocket(socket.socket):
    """Keeps the options of a raw CAN socket, tells of its own frames that have left, and fails as a test says."""

    is_there = True  # whether its device is, to bind to
    is_leaving = False  # its device is just being taken away: options cannot be set, and reading says so a moment later
    is_gone = False  # and reading says so
    holds_frames = False  # nothing is handed over, not even the news that a frame has left

    def __init__(self, end: socket.socket) -> None:
        super().__init__(fileno=end.detach())
        self.options: dict[int, Any] = {}
        self.refuses = deque[int]()  # errors of the next frames to be sent, 0 where one is taken
        self.left = 0  # of its own frames, since that was told

    def bind(self, _: Any) -> None:
        if not self.is_there:
            raise _error(errno.ENODEV)

    def setsockopt(self, level: int, option: int, value: Any, *_: Any) -> None:
        if level != socket.SOL_CAN_RAW:
            if option != socket.SO_SNDBUF:  # of which a datagram takes another share
                super().setsockopt(level, option, value)
        elif self.is_leaving:
            raise _error(errno.ENODEV)
        else:
            self.options[option] = value


def _error(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def control_of(*of: tuple[int, int, bytes]) -> bytes:
    """What recvmsg gives beside a frame, as the kernel lays it out: of each level, kind and data."""
    return b"".join(
        struct.pack("@Nii", 16 + len(data), level, kind) + data + bytes(-len(data) % 8) for level, kind, data in of
    )


class Library:
    """The library in C, asked for sockets of this kind: of what they refuse it knows nothing."""

    def __init__(self, sockets: list[CanSocket]) -> None:
        self._sockets = sockets

    def wrcd_receive(self, fd: int, *given: Any) -> int:
        """Frames that have come."""
        s, said = self._of(fd), given[-1]._obj
        if s.is_gone or s.holds_frames:
            said.error, said.confirmed, said.odd, said.lost = errno.ENODEV if s.is_gone else 0, 0, 0, 0
            return 0
        count = int(native.library().wrcd_receive(fd, *given))
        said.confirmed, s.left = s.left, 0
        return count

    def wrcd_send(self, fd: int, records: bytes, size: int, count: int) -> int:
        """Frames one by one, up to the first that is refused."""
        s, sent = self._of(fd), 0
        while sent < count:
            number = s.refuses.popleft() if s.refuses else 0
            went = -number if number else int(native.library().wrcd_send(fd, records[sent * size :], size, 1))
            if went < 0:
                if number and sent:
                    s.refuses.appendleft(number)
                return sent or went
            sent += 1
            s.left += s.options[CAN_RAW_RECV_OWN_MSGS]
        return sent

    def _of(self, fd: int) -> CanSocket:
        return next(s for s in self._sockets if s.fileno() == fd)


class CanBus:
    """What lies behind the socket that was made last."""

    def __init__(self) -> None:
        self.is_there = True
        self.sockets: list[CanSocket] = []
        self._far: list[socket.socket] = []
        self.module: Any = stand_in(self._make)  # to be put in the place of socketcan.socket
        self.library = Library(self.sockets)  # likewise of what socketcan.library returns

    def _make(self, *_: int) -> CanSocket:
        ours, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)  # its queue can be full
        self.sockets.append(CanSocket(ours))
        self._far.append(far)
        self.newest.is_there = self.is_there
        return self.newest

    @property
    def newest(self) -> CanSocket:
        """The socket that was made last."""
        return self.sockets[-1]

    @property
    def far(self) -> socket.socket:
        """Its other end."""
        return self._far[-1]

    def send(self, *frames: Frame) -> None:
        """From another node: what the socket's filters let in, as the kernel does it."""
        for f in frames:
            word = word_of(f)
            if f.fd and self.newest.options.get(CAN_RAW_FD_FRAMES):
                self.far.send(FD_FRAME.pack(word, len(f.data), f.extra, f.data))
            elif not f.fd and self._lets_in(word):
                self.far.send(FRAME.pack(word, f.extra if f.remote else len(f.data), f.data))

    def _lets_in(self, word: int) -> bool:
        options = self.newest.options
        if word & ERROR:
            return bool(word & options[CAN_RAW_ERR_FILTER])
        filters = options.get(socket.CAN_RAW_FILTER)
        return filters is None or any((word ^ only) & mask == 0 for only, mask in FILTER.iter_unpack(filters))

    def sent(self) -> list[tuple[int, bytes]]:
        """Word and data of what has come to the bus since the last look."""
        found = list[tuple[int, bytes]]()
        while True:
            try:
                word, length, data = FRAME.unpack(self.far.recv(FRAME.size, socket.MSG_DONTWAIT))
            except BlockingIOError:
                return found
            found.append((word, data[:length]))

    def close(self) -> None:
        """Let go of all ends."""
        for s in (*self.sockets, *self._far):
            s.close()


def stand_in(make: Any) -> Any:
    """The module `socket`, as socketcan.py needs it, with another class of sockets."""
    return SimpleNamespace(**{**vars(socket), "socket": make})


def pair() -> tuple[socket.socket, socket.socket]:
    """Both ends, for two processes: datagrams over loopback, of which more wait than come between two turns."""
    one, other = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    for end in (one, other):
        end.bind(("127.0.0.1", 0))
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    one.connect(other.getsockname())
    other.connect(one.getsockname())
    return one, other


def use_pair(end_fd: int) -> None:
    """From now on the CAN socket of this process is that end, a file descriptor."""
    socketcan.socket = stand_in(  # type: ignore[attr-defined]  # a module's place
        lambda *_: CanSocket(socket.socket(fileno=end_fd))
    )
