"""The kernel's side of a raw CAN socket: structures, options, masks, the controller's clock and state.

By linux/can.h, linux/can/raw.h, linux/can/error.h.
"""

import ctypes
import errno
import socket
import struct

from wrcd.bus.frame import EXTENDED, GROUP, mask_of
from wrcd.bus.link import LinkHealth

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


def only_word(word: int) -> bytes:
    """Exactly this id, in its own length: an id with its flag, as Frame.key is; or its group."""
    mask = mask_of(word) if word & EXTENDED else socket.CAN_SFF_MASK | EXTENDED
    return FILTER.pack(word & ~GROUP, mask)


class HardwareClock(ctypes.Structure):
    """What is known of a controller's own clock, which wrcd/bus/c/link.c lays on the kernel's."""

    _fields_ = [(name, ctypes.c_int64) for name in ("since_us", "newest_us", "before_us", "late", "is_known")]


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
