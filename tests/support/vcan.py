"""A virtual CAN interface of the running kernel, and another node on it. Only for tests on a real kernel."""

import errno
import os
import socket
import struct
import subprocess
import time
from collections.abc import Iterable
from pathlib import Path
from socket import socket as RealSocket  # whatever a test puts in its place
from typing import Any

from sim_ecu.play.encoder import databases
from tests.support.can_ids import ADHESION_A1, WRCD_STATUS, YAW_RATE_A1
from wrcd.bus.frame import Frame
from wrcd.bus.socketcan import SocketCanLink

FRAME = struct.Struct("=IB3x8s")  # struct can_frame
ERROR = 0x20000000  # CAN_ERR_FLAG
# Its log is what a test judges by: on a full computer it comes late to its socket, whose default holds 250 frames.
CANDUMP = ("candump", "-r", "8388608", "-L")
BUS_OFF, RESTARTED, CONTROLLER, BUS_ERROR = 0x40, 0x100, 0x04, 0x80  # classes of error frames


def now_us() -> int:
    """Return the clock that stamps frames."""
    return time.time_ns() // 1000


def ip(*words: str) -> None:
    """Run `ip link` with these words."""
    subprocess.run(["ip", "link", *words], timeout=10, check=True)


def add(bus: str) -> None:
    """Make a vcan interface; it is down."""
    ip("add", bus, "mtu", "72", "type", "vcan")


def allow_large_buffers() -> None:
    """Let the daemon have the buffer that systemd/80-wrcd.conf gives it on a train computer. Only in the guest."""
    if os.environ.get("GUEST") == "uml":
        Path("/proc/sys/net/core/rmem_max").write_text("8388608")


def slot_of(f: Frame) -> int:
    """Return the slot that an Adhesion frame was made for: its counter tells, should it have left late.

    The last frame of a daemon that stops carries the next one.
    """
    ahead = f.stamp_us // 20_000 + 1
    return ahead - (ahead - (f.data[1] & 0x0F)) % 15


def overruns_at(frames: Iterable[Frame], until_us: int) -> int:
    """Return the overruns that the last WrcdStatus before a time tells of; 0 where there is none yet."""
    told = [f for f in frames if f.can_id == WRCD_STATUS and f.stamp_us < until_us]
    if not told:
        return 0
    values = databases()[0].decode_message(WRCD_STATUS, told[-1].data)
    assert isinstance(values, dict)
    return int(str(values["Overruns"]))


class Node:
    """Another node on the bus."""

    def __init__(self, channel: str) -> None:
        self._socket = RealSocket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.bind((channel,))
        self._socket.settimeout(2.0)
        # hears what is sent here: the kernel may hand a frame over a moment after send() has returned
        self._echo = RealSocket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._echo.setsockopt(socket.SOL_CAN_RAW, 2, 0x1FFFFFFF)  # CAN_RAW_ERR_FILTER: error frames, too
        self._echo.bind((channel,))
        self._echo.settimeout(2.0)

    def send(self, word: int, data: bytes = b"\x01\x02") -> None:
        """Send a frame, and wait until the bus has it; the word is the id with its flags."""
        packed = FRAME.pack(word, len(data), data.ljust(8, b"\0"))
        self._socket.send(packed)
        while self._echo.recv(FRAME.size) != packed:
            pass

    def receive(self) -> tuple[int, bytes]:
        """Return word and data of the next frame, waiting 2 s at most."""
        word, length, data = FRAME.unpack(self._socket.recv(FRAME.size))
        return word, data[:length]

    def close(self) -> None:
        self._socket.close()
        self._echo.close()


EMPTY = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)  # nothing comes from it


class FaultySocket(RealSocket):
    """A socket with faults that a test switches on."""

    is_leaving = False  # its device is just being taken away: options cannot be set, and reading says so a moment later
    holds_frames = False  # it hands nothing over, not even the news that a frame has left

    def setsockopt(self, *args: Any) -> None:
        if self.is_leaving:
            raise OSError(errno.ENODEV, "No such device")
        super().setsockopt(*args)

    def recvmsg(self, *args: Any) -> Any:
        if self.holds_frames:
            raise BlockingIOError
        return super().recvmsg(*args)

    def fileno(self) -> int:
        """For many frames a system call."""
        return EMPTY[0].fileno() if self.holds_frames else super().fileno()


def assert_frames_pass(bus: str, link: SocketCanLink) -> None:
    """Exchange a frame each way between link and another node."""
    other = Node(bus)
    other.send(YAW_RATE_A1)
    assert [f.can_id for f in link.receive(0)] == [YAW_RATE_A1]
    assert link.send(Frame(now_us(), ADHESION_A1, b"\x01"))
    assert other.receive() == (ADHESION_A1, b"\x01")
    other.close()
