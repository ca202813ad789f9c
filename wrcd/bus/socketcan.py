"""SocketCAN on the standard library's socket: exact time stamps, kernel filters, counted drops; many frames a system
call."""

import ctypes
import errno
import socket
import struct
from collections.abc import Sequence

from wrcd.bus.batch import FD_RECORD, RECORD, FrameBatch, joined
from wrcd.bus.frame import ERROR, Frame
from wrcd.bus.link import MAX_FRAMES, Link, LinkHealth
from wrcd.bus.rawcan import (
    ALL_ERRORS,
    CAN_RAW_ERR_FILTER,
    CAN_RAW_FD_FRAMES,
    CAN_RAW_RECV_OWN_MSGS,
    GONE,
    RAW_HARDWARE,
    RX_HARDWARE,
    RX_SOFTWARE,
    SO_RXQ_OVFL,
    SO_TIMESTAMPING,
    SO_TIMESTAMPNS,
    SOFTWARE,
    Controller,
    HardwareClock,
    only_word,
)
from wrcd.bus.rtnetlink import LinkEvent, open_events
from wrcd.errors import BusError
from wrcd.native import library

SEND_BUFFER = 8 << 10  # bytes: some slots' frames, no more may wait in the kernel
RECEIVE_BUFFER = 4 << 20  # bytes, up to net.core.rmem_max; the kernel's default holds 278 frames
UNCONFIRMED_US = 1_000_000  # after so long without a sign that a frame has left, one slot's frames are tried again
# A device that has gone is opened again when the kernel says that it is there; and tried so often, for where rtnetlink
# is not to be had. No longer, however long it has been gone: the window has to fill first anyway.
REOPEN_US = 50_000


class _Received(ctypes.Structure):
    """What wrcd_receive tells beside the frames."""

    _fields_ = [
        ("error", ctypes.c_int32), ("confirmed", ctypes.c_int32), ("odd", ctypes.c_int32), ("lost", ctypes.c_uint32)
    ]  # fmt: skip


class SocketCanLink(Link):
    """One raw CAN socket, and one of rtnetlink's beside it. The device may go and come back; link-down is waited out on
    the same socket. fd: CAN FD frames are wanted, too. confirm False: nothing is known of what has left, and no frame
    waits for those before it: a rig's sensors do not wait for each other."""

    stamps_arrivals = True

    def __init__(self, channel: str, keys: tuple[int, ...] | None, fd: bool = False, confirm: bool = True) -> None:
        self.name = f"socketcan:{channel}"
        self.health = LinkHealth()
        self._channel, self._keys, self._fd, self._confirm = channel, keys, fd, confirm
        self._hardware: HardwareClock | None = None
        self._controller = Controller(self.health)
        self._down = False
        self._dropped_before = 0
        self._tried_us = 0  # when it was last tried to open a device that has gone
        self._own: tuple[int, ...] = ()  # words of the frames sent here
        self._slot_us = self._opened_us = 0  # stamps of the newest slot, and of the newest that was sent
        self._sending = True  # whether the newest slot is
        self._unconfirmed = 0  # frames of it that have not left yet
        self._confirms = False  # whether this interface tells when a frame has left
        self._early = FrameBatch(b"")  # received while looking for that
        self._records = ctypes.create_string_buffer(MAX_FRAMES * FD_RECORD.size)  # of a look
        self._said = _Received()
        if not hasattr(socket, "AF_CAN"):
            from wrcd.bus.opening_hints import no_socketcan

            raise BusError("this Python has no AF_CAN", key="interface", hint=no_socketcan())
        self._events = open_events(channel)
        try:
            self._socket: socket.socket | None = self._open()
        except OSError as e:
            from wrcd.bus.opening_hints import for_socketcan  # not for a start that succeeds

            self.close_events()
            raise BusError(
                f"CAN interface {channel!r} cannot be opened: {e.strerror or e}",
                key="channel",
                hint=for_socketcan(e, channel),
            ) from None

    def _open(self) -> socket.socket:
        s = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        try:
            s.setblocking(False)
            self._stamp(s)
            s.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            s.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            if (filters := self._filters()) is not None:
                s.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters)
            s.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, ALL_ERRORS)
            s.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, int(self._confirm))
            if self._fd:
                s.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1)
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
        """What the kernel holds, error frames too, MAX_FRAMES at the most. A device that has gone is opened again as
        soon as it is back."""
        return list(self.receive_batch(now_us))

    def receive_batch(self, now_us: int) -> FrameBatch:
        """The same without one Python object for each."""
        came = self._follow(now_us)
        if self._socket is None:
            self._reopen(now_us, came)
        early, self._early = self._early, FrameBatch(b"")
        frames = self._read(now_us, MAX_FRAMES - len(early))
        if self._socket is not None and (mask := self._controller.mask(now_us)) is not None:
            self._set(CAN_RAW_ERR_FILTER, mask, now_us)
        self._tell()
        return joined(early, frames)

    def _follow(self, now_us: int) -> bool:
        """Take in what the kernel says of the interface. Returns whether it says that there is one."""
        came = False
        for event in self._events.read() if self._events is not None else ():
            came = event is not LinkEvent.GONE
            if event is LinkEvent.UP:
                self._down = False
            else:
                self._go_down()
            if event is LinkEvent.GONE:
                self._lose(now_us)
        return came

    def _read(self, now_us: int, most: int) -> FrameBatch:
        kind = FD_RECORD if self._fd else RECORD
        own, said, size, begin = struct.pack(f"={len(self._own)}I", *self._own), self._said, kind.size, 0
        clock = None if self._hardware is None else ctypes.byref(self._hardware)
        while self._socket is not None:
            fd, room, left = self._socket.fileno(), ctypes.byref(self._records, begin * size), most - begin
            count = library().wrcd_receive(fd, room, size, left, now_us, own, len(self._own), clock, ctypes.byref(said))
            self._note_left(said.confirmed)
            self._note_lost(said.lost)
            if said.odd:
                for stamp_us, word, length, _, _, data in kind.iter_unpack(ctypes.string_at(room, count * size)):
                    self._note(word, data[:length], stamp_us)
            elif count:
                self._down = self._controller.bus_off = False
            begin += count
            if not said.error or not self._goes_on(said.error, now_us):
                break
        return FrameBatch(ctypes.string_at(self._records, begin * size), self._fd)

    def _goes_on(self, error: int | None, now_us: int) -> bool:
        """Whether to read on after an error."""
        if error == errno.EINTR or (error == errno.ENETDOWN and self._events is not None):
            return True  # perhaps it is up again already: rtnetlink says what came last
        self._trouble(error, now_us)
        return error == errno.ENETDOWN

    def narrow(self, keys: tuple[int, ...], fd: bool = False) -> None:
        """From now on only these messages (Frame.key), with CAN FD ones among them."""
        self._keys, self._fd = keys, self._fd or fd
        self._set(socket.CAN_RAW_FILTER, self._filters(), 0)
        if fd:
            self._set(CAN_RAW_FD_FRAMES, 1, 0)

    def _filters(self) -> bytes | None:
        """struct can_filter of each id that is let in; None: all are."""
        if self._keys is None:
            return None
        return b"".join(map(only_word, (*self._keys, *sorted(self._own))))

    def _set(self, option: int, value: int | bytes | None, now_us: int) -> None:
        """Set an option of the raw socket. The kernel looks for the device first, which may just be going away."""
        if self._socket is None or value is None:
            return
        try:
            self._socket.setsockopt(socket.SOL_CAN_RAW, option, value)
        except OSError as e:
            if e.errno not in (*GONE, errno.ENETDOWN):
                raise
            self._trouble(e.errno, now_us)

    def _note(self, word: int, payload: bytes, stamp_us: int) -> None:
        """What a frame tells of the bus."""
        if word in self._own:
            self.health.foreign(word)
        self._down = False
        if word & ERROR:
            self._controller.error(word, payload, stamp_us)
        else:
            self._controller.on_frame()

    def _note_lost(self, lost: int) -> None:
        """The kernel's count of frames lost; 0: it says nothing."""
        if lost:
            self.health.drops += (lost - self._dropped_before) & 0xFFFFFFFF
            self._dropped_before = lost

    def _note_left(self, frames: int) -> None:
        """So many of ours have left."""
        if frames:
            self._confirms, self._unconfirmed = True, max(self._unconfirmed - frames, 0)

    def _trouble(self, error: int | None, now_us: int) -> None:
        self._go_down()
        if error in GONE:
            self._lose(now_us)

    def _go_down(self) -> None:
        """Nothing comes and nothing goes; what had not left yet never will."""
        self._down = True
        self._controller.restarted()
        self._unconfirmed = 0

    def _lose(self, now_us: int) -> None:
        """The device is gone, and the socket is deaf for ever."""
        if self._socket is not None:
            self._socket.close()
            self._socket, self._tried_us = None, now_us

    def _reopen(self, now_us: int, came: bool) -> None:
        # a clock that stepped back must not keep the bus closed
        if not came and 0 <= now_us - self._tried_us < REOPEN_US:
            return
        self._tried_us = now_us
        try:
            self._socket = self._open()
        except OSError:
            return
        self.health.reopens += 1
        self._dropped_before = 0
        self._controller = Controller(self.health)
        self._unconfirmed, self._confirms = 0, False
        self._down = self._down and self._events is not None  # rtnetlink says when it is up

    def _tell(self) -> None:
        self.health.state = (
            "Gone" if self._socket is None
            else "Down" if self._down
            else "BusOff" if self._controller.bus_off
            else "ErrorPassive" if self._controller.passive
            else "Up"
        )  # fmt: skip

    def send(self, frame: Frame) -> bool:
        """Send at once or drop and count."""
        return self.send_all([frame])[0]

    def send_all(self, frames: FrameBatch | Sequence[Frame]) -> list[bool]:
        """Send a slot's frames at once, or drop and count each that cannot be. Returns which have been sent.

        The first send after a link was down may fail on a latched error: again. Off the bus nothing is sent: the kernel
        would say that it was. Nor is it while frames of an earlier slot have not left: they would all wait in the
        kernel's queue and go out when they are stale. Either is tried again once a second.
        """
        if not frames:
            return []
        batch = frames if isinstance(frames, FrameBatch) else FrameBatch.of(frames)
        rows = list(batch.kind.iter_unpack(batch.records))
        stamp_us, count, size, went = rows[0][0], len(rows), batch.stride, list[bool]()
        if new := {row[1] for row in rows}.difference(self._own):
            self._own = (*self._own, *sorted(new))
            self._set(socket.CAN_RAW_FILTER, self._filters(), stamp_us)
        again = may = self._open_slot(stamp_us)
        while may and len(went) < count and self._socket is not None:
            at = len(went)
            sent = library().wrcd_send(self._socket.fileno(), batch.records[at * size :], size, count - at)
            if sent < 0:
                full = -sent in (errno.ENOBUFS, errno.EAGAIN)
                if not full and sent != -errno.EINTR:
                    self._trouble(-sent, stamp_us)
                went += [False] * (full or not again)
                again = full or not again
                continue
            went += [True] * sent
            self._unconfirmed += sent
            self._down, again = False, True
        went += [False] * (count - len(went))
        self._tell()
        self.health.unsent += went.count(False)
        return went

    def _open_slot(self, stamp_us: int) -> bool:
        """Whether frames of a slot may be sent."""
        if stamp_us != self._slot_us:
            self._slot_us = stamp_us
            if self._unconfirmed:
                self._early = joined(self._early, self._read(stamp_us, MAX_FRAMES - len(self._early)))
            held = self._controller.bus_off or (self._confirms and self._unconfirmed > 0)
            self._sending = not held or not 0 <= stamp_us - self._opened_us < UNCONFIRMED_US
            if self._sending:
                self._opened_us, self._unconfirmed = stamp_us, 0
        elif self._controller.bus_off:
            self._sending = False
        return self._sending

    def close(self) -> None:
        """Let go of the bus."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None
        self.close_events()

    def close_events(self) -> None:
        """Do without rtnetlink from now on."""
        if self._events is not None:
            self._events.close()
        self._events = None
