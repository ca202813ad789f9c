"""SocketCAN on the standard library's socket: exact time stamps, kernel filters, counted drops."""

import errno
import socket
import struct

from wrcd.bus.frame import Frame
from wrcd.bus.hardwareclock import HardwareClock
from wrcd.bus.link import LinkHealth
from wrcd.errors import BusError

_FRAME = struct.Struct("=IB3x8s")  # struct can_frame
_TIMESPEC = struct.Struct("@ll")
_U32 = struct.Struct("=I")
_FILTER = struct.Struct("=II")
# Not all of these have names in the socket module.
SO_TIMESTAMPNS = 35
SO_TIMESTAMPING = 37
RAW_HARDWARE, RX_SOFTWARE, SOFTWARE, RX_HARDWARE = 1 << 6, 1 << 3, 1 << 4, 1 << 2
SO_RXQ_OVFL = 40
CAN_RAW_ERR_FILTER = 2
CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_ERR_FLAG = 0x80000000, 0x40000000, 0x20000000
CAN_ERR_CRTL, CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x04, 0x40, 0x100
STATE_ERRORS = CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED  # what tells the controller's state
ALL_ERRORS = 0x1FFFFFFF
# data[1] of CAN_ERR_CRTL
CRTL_RX_OVERFLOW, CRTL_PASSIVE, CRTL_WARNING, CRTL_ACTIVE = 0x01, 0x30, 0x0C, 0x40
RECEIVE_BUFFER = 4 << 20  # bytes, up to net.core.rmem_max; the kernel's default holds 278 frames
MOST_FRAMES = 4096  # taken at a time, so that no flood keeps the loop from its tick
MOST_ERRORS = 500  # error frames a second; beyond it only those that tell a state are let in for a second
REOPEN_FIRST_US, REOPEN_LAST_US = 50_000, 1_000_000  # a device that has gone is tried again, ever less often
_GONE = {errno.ENODEV, errno.ENXIO, errno.EBADF}


class SocketCanLink:
    """One raw CAN socket. The device may go and come back; link-down is waited out on the same socket."""

    def __init__(self, channel: str, ids: tuple[int, ...] | None) -> None:
        self.name = f"socketcan:{channel}"
        self.health = LinkHealth()
        self._channel, self._ids = channel, ids
        self._hardware: HardwareClock | None = None
        self._down = self._bus_off = self._passive = False
        self._dropped_before = 0
        self._next_try_us, self._pause_us = 0, REOPEN_FIRST_US
        self._errors, self._errors_since_us = 0, 0
        self._flood_until_us: int | None = None
        if not hasattr(socket, "AF_CAN"):
            raise BusError("this Python has no AF_CAN", key="interface", hint="use Linux, or another interface")
        try:
            self._socket: socket.socket | None = self._open()
        except OSError as e:
            raise BusError(
                f"CAN interface {channel!r} cannot be opened: {e.strerror}", key="channel", hint=_advice(e, channel)
            ) from None

    def _open(self) -> socket.socket:
        s = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        try:
            s.setblocking(False)
            self._stamp(s)
            s.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            self._filter(s)
            s.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, ALL_ERRORS)
            s.bind((self._channel,))
        except OSError:
            s.close()
            raise
        return s

    def stamp_by_hardware(self) -> None:
        """From now on frames carry the controller's own time stamps, laid on the kernel's clock, where it gives any."""
        self._hardware = HardwareClock()
        if self._socket is not None:
            self._stamp(self._socket)

    def _stamp(self, s: socket.socket) -> None:
        if self._hardware is None:
            s.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        else:
            s.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 0)
            s.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, RAW_HARDWARE | RX_HARDWARE | RX_SOFTWARE | SOFTWARE)

    def receive(self, now_us: int) -> list[Frame]:
        """What the kernel holds, error frames too, some thousand at the most. A device that has gone is opened again,
        sooner at first, then once a second."""
        if self._socket is None:
            self._reopen(now_us)
        elif self._flood_until_us is not None and not now_us < self._flood_until_us <= now_us + 1_000_000:
            self._flood_until_us = None
            self._socket.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, ALL_ERRORS)
        frames: list[Frame] = []
        while self._socket is not None and len(frames) < MOST_FRAMES:
            try:
                data, extra, _, _ = self._socket.recvmsg(_FRAME.size, 256)
            except BlockingIOError:
                break
            except InterruptedError:
                continue
            except OSError as e:
                self._trouble(e, now_us)
                if e.errno != errno.ENETDOWN:
                    break
                continue
            if len(data) == _FRAME.size:
                frames.append(self._take(data, extra, now_us))
        self._tell()
        return frames

    def narrow(self, ids: tuple[int, ...]) -> None:
        """From now on only these ids."""
        self._ids = ids
        if self._socket is not None:
            self._filter(self._socket)

    def _filter(self, s: socket.socket) -> None:
        if self._ids is not None:
            s.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"".join(map(_filter, self._ids)))

    def _take(self, data: bytes, extra: list[tuple[int, int, bytes]], now_us: int) -> Frame:
        stamp_us = now_us
        for level, kind, value in extra:
            if level != socket.SOL_SOCKET:
                continue
            if kind == SO_TIMESTAMPNS:
                stamp_us = _time_us(value, 0)
            elif kind == SO_TIMESTAMPING:
                stamp_us = _time_us(value, 0)
                if self._hardware is not None and (raw_us := _time_us(value, 2)):
                    stamp_us = self._hardware.lay(raw_us, stamp_us)
            elif kind == SO_RXQ_OVFL:
                total = _U32.unpack(value[:4])[0]
                self.health.drops += (total - self._dropped_before) & 0xFFFFFFFF
                self._dropped_before = total
        word, length, payload = _FRAME.unpack(data)
        payload = payload[: min(length, 8)]
        self._down = False
        if word & CAN_ERR_FLAG:
            self._error(word, payload, stamp_us, now_us)
            return Frame(stamp_us, word & ALL_ERRORS, payload, error=True)
        self._bus_off = False  # what arrives proves that the controller is on the bus
        extended = bool(word & CAN_EFF_FLAG)
        mask = socket.CAN_EFF_MASK if extended else socket.CAN_SFF_MASK
        return Frame(stamp_us, word & mask, payload, extended, remote=bool(word & CAN_RTR_FLAG))

    def _error(self, word: int, payload: bytes, stamp_us: int, now_us: int) -> None:
        health = self.health
        health.error_frames += 1
        if word & CAN_ERR_CRTL and len(payload) > 1:
            state = payload[1]
            health.drops += bool(state & CRTL_RX_OVERFLOW)
            if state & (CRTL_PASSIVE | CRTL_WARNING | CRTL_ACTIVE):
                self._passive = bool(state & CRTL_PASSIVE)
                self._bus_off = False
        if word & CAN_ERR_BUSOFF:
            health.bus_offs += not self._bus_off
            self._bus_off = True
        if word & CAN_ERR_RESTARTED:
            self._bus_off = self._passive = False
        if not 0 <= stamp_us - self._errors_since_us < 1_000_000:
            self._errors, self._errors_since_us = 0, stamp_us
        self._errors += 1
        if self._errors > MOST_ERRORS and self._flood_until_us is None and self._socket is not None:
            self._flood_until_us = now_us + 1_000_000
            self._socket.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, STATE_ERRORS)

    def _trouble(self, e: OSError, now_us: int) -> None:
        self._down = True
        self._bus_off = self._passive = False
        if e.errno in _GONE:
            if self._socket is not None:
                self._socket.close()
            self._socket = None
            self._pause_us = REOPEN_FIRST_US
            self._next_try_us = now_us + self._pause_us

    def _reopen(self, now_us: int) -> None:
        # a clock that stepped back must not keep the bus closed
        if self._next_try_us - self._pause_us <= now_us < self._next_try_us:
            return
        self._pause_us = min(2 * self._pause_us, REOPEN_LAST_US)
        self._next_try_us = now_us + self._pause_us
        try:
            self._socket = self._open()
        except OSError:
            return
        self.health.reopens += 1
        self._dropped_before = 0
        self._flood_until_us = None
        self._down = False

    def _tell(self) -> None:
        self.health.state = (
            "Gone" if self._socket is None
            else "Down" if self._down
            else "BusOff" if self._bus_off
            else "ErrorPassive" if self._passive
            else "Up"
        )  # fmt: skip

    def send(self, frame: Frame) -> bool:
        """Send at once or drop and count. The first send after a link was down may fail on a latched error: again.

        Off the bus nothing is sent: the kernel would say that it was, or keep it until it is stale.
        """
        word = frame.can_id | (CAN_EFF_FLAG if frame.extended else 0)
        packed = _FRAME.pack(word, len(frame.data), frame.data.ljust(8, b"\0"))
        for _ in range(2):
            if self._socket is None or self._bus_off:
                break
            try:
                self._socket.send(packed)
                self._down = False
                self._tell()
                return True
            except OSError as e:
                if e.errno == errno.ENOBUFS:
                    break
                if e.errno not in (errno.EAGAIN, errno.EINTR):
                    self._trouble(e, frame.stamp_us)
        self._tell()
        self.health.unsent += 1
        return False

    def close(self) -> None:
        """Let go of the bus."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None


def _time_us(value: bytes, place: int) -> int:
    """One of the time stamps that came along, in whole microseconds."""
    seconds, nanoseconds = _TIMESPEC.unpack_from(value, place * _TIMESPEC.size)
    return int(seconds) * 1_000_000 + int(nanoseconds) // 1000


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
