"""The kernel's side of a raw CAN socket: structures, options, masks, the controller's clock and state.

By linux/can.h, linux/can/raw.h, linux/can/error.h.
"""

import errno
import socket
import struct

from wrcd.bus.frame import EXTENDED, GROUP, mask_of
from wrcd.bus.link import LinkHealth

FRAME = struct.Struct("=IB3x8s")  # struct can_frame
FD_FRAME = struct.Struct("=IBB2x64s")  # struct canfd_frame
FD_BITS = 0b11  # of its flags: bit rate switched, sender error passive
TIMESPEC = struct.Struct("@ll")
U32 = struct.Struct("=I")
FILTER = struct.Struct("=II")  # struct can_filter
# Not all of these have names in the socket module.
SO_TIMESTAMPNS = 35
SO_TIMESTAMPING = 37
RAW_HARDWARE, RX_SOFTWARE, SOFTWARE, RX_HARDWARE = 1 << 6, 1 << 3, 1 << 4, 1 << 2
SO_RXQ_OVFL = 40
CAN_RAW_RECV_OWN_MSGS = 4
CAN_RAW_ERR_FILTER = 2
CAN_RAW_FD_FRAMES = 5
GONE = (errno.ENODEV, errno.ENXIO, errno.EBADF)  # what a socket says of a device that is not there any more


# As plain numbers: those of the socket module may be enumerations, whose & takes longer than the system call.
SOL_SOCKET, MSG_CONFIRM = int(socket.SOL_SOCKET), int(socket.MSG_CONFIRM)


def time_us(value: bytes, place: int = 0) -> int:
    """One of the time stamps that came along, in whole microseconds."""
    seconds, nanoseconds = TIMESPEC.unpack_from(value, place * TIMESPEC.size)
    return int(seconds) * 1_000_000 + int(nanoseconds) // 1000


def parse_ancillary(ancillary: list[tuple[int, int, bytes]], now_us: int) -> tuple[int, int, int | None]:
    """Parse what recvmsg gives beside a frame.

    Returns the kernel's time stamp in µs, now_us where there is none; the controller's own in µs, 0 where there is
    none; and how many frames the socket's buffer has lost so far, None where the kernel does not say.
    """
    kernel_us, hardware_us, lost = now_us, 0, None
    for level, kind, value in ancillary:
        if level != SOL_SOCKET:
            continue
        if kind == SO_TIMESTAMPNS:
            kernel_us = time_us(value)
        elif kind == SO_TIMESTAMPING:
            kernel_us, hardware_us = time_us(value, 0), time_us(value, 2)
        elif kind == SO_RXQ_OVFL:
            lost = int(U32.unpack(value[:4])[0])
    return kernel_us, hardware_us, lost


def only_word(word: int) -> bytes:
    """Exactly this id, in its own length: an id with its flag, as Frame.key is; or its group."""
    mask = mask_of(word) if word & EXTENDED else socket.CAN_SFF_MASK | EXTENDED
    return FILTER.pack(word & ~GROUP, mask)


class HardwareClock:
    """Lays a controller's own clock, which counts from anywhere and drifts, on the kernel's.

    A frame is never stamped by the kernel before the controller has it, so the least difference of the two that was
    seen lately is the offset between the clocks. Lately is 10 to 20 s: a drift of 50 ppm is a millisecond in that time.
    """

    KEPT_US = 10_000_000
    # So many frames in a row that seem to be late by more than that: the kernel's clock has been set forwards.
    MAX_LATE_US, MAX_LATE_FRAMES = 5_000, 50

    def __init__(self) -> None:
        self._since_us = 0
        self._min_offset_us: int | None = None
        self._previous_min_offset_us: int | None = None
        self._late = 0

    def to_kernel_time(self, raw_us: int, kernel_us: int) -> int:
        """Return the controller's stamp on the kernel's clock, in µs, never later than the kernel's own.

        raw_us is 0 for a frame that the controller has not stamped: the kernel's stamp is returned.
        """
        if not raw_us:
            return kernel_us
        difference = kernel_us - raw_us
        known = [d for d in (self._min_offset_us, self._previous_min_offset_us) if d is not None]
        self._late = self._late + 1 if known and difference - min(known) > self.MAX_LATE_US else 0
        if not known or abs(difference - min(known)) > 1_000_000 or self._late > self.MAX_LATE_FRAMES:  # it has stepped
            self._late = 0
            self._min_offset_us = self._previous_min_offset_us = difference
            self._since_us = kernel_us
        elif kernel_us - self._since_us > self.KEPT_US:
            self._previous_min_offset_us, self._min_offset_us = self._min_offset_us, difference
            self._since_us = kernel_us
        self._min_offset_us = difference if self._min_offset_us is None else min(self._min_offset_us, difference)
        return raw_us + min(d for d in (self._min_offset_us, self._previous_min_offset_us) if d is not None)


CAN_ERR_CRTL, CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x04, 0x40, 0x100
STATE_ERRORS = CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED  # what tells the controller's state
ALL_ERRORS = 0x1FFFFFFF
# data[1] of CAN_ERR_CRTL
CRTL_RX_OVERFLOW, CRTL_PASSIVE, CRTL_WARNING, CRTL_ACTIVE = 0x01, 0x30, 0x0C, 0x40
MAX_ERRORS = 500  # error frames a second; beyond it only those that tell a state are let in for a second
HOLD_OFF_US = 1_000_000


class Controller:
    """Follows its state, and counts."""

    def __init__(self, health: LinkHealth) -> None:
        self._health = health
        self.bus_off = self.passive = False
        self._errors, self._since_us = 0, 0
        self._flood_until_us: int | None = None

    def on_frame(self) -> None:
        """A frame has come: the controller is on the bus."""
        self.bus_off = False

    def restarted(self) -> None:
        """The interface was set up anew."""
        self.bus_off = self.passive = False

    def error(self, kinds: int, payload: bytes, stamp_us: int) -> None:
        """An error frame."""
        health = self._health
        health.error_frames += 1
        if kinds & CAN_ERR_CRTL and len(payload) > 1:
            state = payload[1]
            health.drops += bool(state & CRTL_RX_OVERFLOW)
            if state & (CRTL_PASSIVE | CRTL_WARNING | CRTL_ACTIVE):
                self.passive = bool(state & CRTL_PASSIVE)
                self.bus_off = False
        if kinds & CAN_ERR_BUSOFF:
            health.bus_offs += not self.bus_off
            self.bus_off = True
        if kinds & CAN_ERR_RESTARTED:
            self.restarted()
        if not 0 <= stamp_us - self._since_us < 1_000_000:
            self._errors, self._since_us = 0, stamp_us
        self._errors += 1

    def mask(self, now_us: int) -> int | None:
        """Which kinds of error frames to let in from now on, where that changes: a flood is shut out for a second."""
        if self._flood_until_us is None:
            if self._errors <= MAX_ERRORS:
                return None
            self._flood_until_us = now_us + HOLD_OFF_US
            return STATE_ERRORS
        if now_us < self._flood_until_us <= now_us + HOLD_OFF_US:
            return None
        self._flood_until_us, self._errors = None, 0
        return ALL_ERRORS
