"""SocketCAN on the standard library's socket: exact time stamps, kernel filters, counted drops."""

import errno
import socket
import struct

from wrcd.bus.frame import Frame
from wrcd.errors import BusError

_FRAME = struct.Struct("=IB3x8s")  # struct can_frame
_TIMESPEC = struct.Struct("@ll")
_U32 = struct.Struct("=I")
_FILTER = struct.Struct("=II")
# Not all of these have names in the socket module.
SO_TIMESTAMPNS = 35
SO_RXQ_OVFL = 40
CAN_RAW_ERR_FILTER = 2
CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_ERR_FLAG = 0x80000000, 0x40000000, 0x20000000
CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x40, 0x100
RECEIVE_BUFFER = 4 << 20  # bytes, up to net.core.rmem_max; the kernel's default holds 278 frames
REOPEN_EVERY_US = 250_000
_GONE = {errno.ENODEV, errno.ENXIO, errno.EBADF}


class SocketCanLink:
    """One raw CAN socket. The device may go and come back; link-down is waited out on the same socket."""

    def __init__(self, channel: str, ids: tuple[int, ...] | None) -> None:
        self.name = f"socketcan:{channel}"
        self.drops = self.reopens = self.unsent = 0
        self._channel, self._ids = channel, ids
        self._down = self._bus_off = False
        self._dropped_before = 0
        self._next_try_us = 0
        if not hasattr(socket, "AF_CAN"):
            raise BusError("this Python has no AF_CAN", key="interface", hint="use Linux, or another interface")
        try:
            self._socket: socket.socket | None = self._open()
        except OSError as e:
            raise BusError(
                f"CAN interface {channel!r} cannot be opened: {e.strerror}", key="channel", hint=_advice(e, channel)
            ) from None

    @property
    def up(self) -> bool:
        """False while the device is gone, its link down or the controller bus-off."""
        return self._socket is not None and not self._down and not self._bus_off

    def _open(self) -> socket.socket:
        s = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        try:
            s.setblocking(False)
            s.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            s.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            self._filter(s)
            s.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, CAN_ERR_BUSOFF | CAN_ERR_RESTARTED)
            s.bind((self._channel,))
        except OSError:
            s.close()
            raise
        return s

    def receive(self, now_us: int) -> list[Frame]:
        """All that the kernel holds. A device that has gone is opened again, four times a second at the most."""
        if self._socket is None:
            self._reopen(now_us)
        frames: list[Frame] = []
        while self._socket is not None:
            try:
                data, extra, _, _ = self._socket.recvmsg(_FRAME.size, 128)
            except BlockingIOError:
                break
            except InterruptedError:
                continue
            except OSError as e:
                self._trouble(e, now_us)
                if e.errno != errno.ENETDOWN:
                    break
                continue
            self._down = False
            self._take(data, extra, now_us, frames)
        return frames

    def narrow(self, ids: tuple[int, ...]) -> None:
        """From now on only these ids."""
        self._ids = ids
        if self._socket is not None:
            self._filter(self._socket)

    def _filter(self, s: socket.socket) -> None:
        if self._ids is not None:
            s.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"".join(map(_filter, self._ids)))

    def _take(self, data: bytes, extra: list[tuple[int, int, bytes]], now_us: int, frames: list[Frame]) -> None:
        stamp_us = now_us
        for level, kind, value in extra:
            if level != socket.SOL_SOCKET:
                continue
            if kind == SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIMESPEC.unpack(value[: _TIMESPEC.size])
                stamp_us = seconds * 1_000_000 + nanoseconds // 1000
            elif kind == SO_RXQ_OVFL:
                total = _U32.unpack(value[:4])[0]
                self.drops += (total - self._dropped_before) & 0xFFFFFFFF
                self._dropped_before = total
        if len(data) != _FRAME.size:
            return
        word, length, payload = _FRAME.unpack(data)
        if word & CAN_ERR_FLAG:
            if word & CAN_ERR_BUSOFF:
                self._bus_off = True
            if word & CAN_ERR_RESTARTED:
                self._bus_off = False
            return
        self._bus_off = False  # what arrives proves that the controller is on the bus
        extended = bool(word & CAN_EFF_FLAG)
        mask = socket.CAN_EFF_MASK if extended else socket.CAN_SFF_MASK
        frames.append(
            Frame(stamp_us, word & mask, payload[: min(length, 8)], extended, remote=bool(word & CAN_RTR_FLAG))
        )

    def _trouble(self, e: OSError, now_us: int) -> None:
        self._down = True
        if e.errno in _GONE:
            if self._socket is not None:
                self._socket.close()
            self._socket = None
            self._next_try_us = now_us + REOPEN_EVERY_US

    def _reopen(self, now_us: int) -> None:
        # a clock that stepped back must not keep the bus closed
        if self._next_try_us - REOPEN_EVERY_US <= now_us < self._next_try_us:
            return
        self._next_try_us = now_us + REOPEN_EVERY_US
        try:
            self._socket = self._open()
        except OSError:
            return
        self.reopens += 1
        self._dropped_before = 0
        self._down = False

    def send(self, frame: Frame) -> bool:
        """Send at once or drop and count. The first send after a link was down may fail on a latched error: again."""
        word = frame.can_id | (CAN_EFF_FLAG if frame.extended else 0)
        packed = _FRAME.pack(word, len(frame.data), frame.data.ljust(8, b"\0"))
        for _ in range(2):
            if self._socket is None:
                break
            try:
                self._socket.send(packed)
                self._down = False
                return True
            except OSError as e:
                if e.errno not in (errno.ENOBUFS, errno.EAGAIN, errno.EINTR):
                    self._trouble(e, frame.stamp_us)
        self.unsent += 1
        return False

    def close(self) -> None:
        """Let go of the bus."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None


def _filter(can_id: int) -> bytes:
    """Exactly this id: data frames of its own length of id."""
    if can_id <= socket.CAN_SFF_MASK:
        return _FILTER.pack(can_id, socket.CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG)
    return _FILTER.pack(can_id | CAN_EFF_FLAG, socket.CAN_EFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG)


def _advice(e: OSError, channel: str) -> str:
    if e.errno in (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT):
        return "this kernel has no CAN: load the modules can and can-raw, or use another interface"
    if e.errno in _GONE:
        if channel.startswith("vcan"):
            return f"make it: ip link add {channel} type vcan && ip link set {channel} up"
        return "see `ip link` for the interfaces there are"
    return "check the interface and your rights"
