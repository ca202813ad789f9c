"""A CAN interface of our own: the kernel's slcan driver on a pty whose other end is the test. Needs root.

To a program on the interface this is a CAN controller with a driver, error states and bus-off; what it sends arrives
here as text and is thrown away.

python -m tests.support.slcan SCENARIO CHANNEL   makes the interface and plays onto it, as `sim-ecu play --ahead` does
"""

import errno
import fcntl
import os
import pty
import struct
import sys
import termios
import tty

import can

from sim_ecu.play.faults import SILENT, Fault
from sim_ecu.play.interface import ip
from sim_ecu.play.play import play_onto
from sim_ecu.play.scenario import load_scenario
from wrcd.errors import BusError

N_SLCAN = 17  # line discipline
SIOCGIFNAME = 0x8910
READ_EVERY = 16  # frames sent between two looks at what came
# states with receive and transmit error counters, as an slcan adapter reports them
ERROR_ACTIVE, BUS_OFF = b"sa000000\r", b"sb255000\r"


class Slcan:
    """Makes the interface and brings it up; shutdown() removes it. Raises BusError if it can't be made."""

    def __init__(self, channel: str) -> None:
        self._channel = channel
        self.channel_info = f"slcan channel '{channel}'"
        self._peer, self._line = pty.openpty()
        try:
            tty.setraw(self._line)
            fcntl.ioctl(self._line, termios.TIOCSETD, struct.pack("i", N_SLCAN))
            name = fcntl.ioctl(self._line, SIOCGIFNAME, bytes(16)).split(b"\0")[0].decode()
            ip("set", name, "name", channel)
            ip("set", channel, "up")
        except OSError as e:
            self._close()
            hint = "load the kernel's module slcan, and be root"
            raise BusError(f"no slcan interface can be made: {e.strerror}", key="interface", hint=hint) from None
        except BusError:
            self._close()
            raise
        os.set_blocking(self._peer, False)
        self._unwritten = b""
        self._sent = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """A frame as text, at once or not at all. Error frames are the driver's to make, and are left out."""
        self._sent += 1
        if self._sent % READ_EVERY == 0:
            self._drain()
        if not msg.is_error_frame:
            ident = f"T{msg.arbitration_id:08X}" if msg.is_extended_id else f"t{msg.arbitration_id:03X}"
            self._write(f"{ident}{len(msg.data)}{msg.data.hex().upper()}\r".encode())

    def begin(self, fault: Fault) -> None:
        """Report that the controller is off the bus."""
        if fault.kind in SILENT:
            self.report(BUS_OFF)

    def end(self, fault: Fault) -> None:
        """It is back: error active, and the link is set up anew as a driver's own restart does."""
        if fault.kind in SILENT:
            self.report(ERROR_ACTIVE)
            ip("set", self._channel, "down")
            ip("set", self._channel, "up")

    def report(self, state: bytes) -> None:
        """Report a state of the controller to the driver, as an slcan adapter does."""
        self._write(state)

    def _write(self, text: bytes) -> None:
        """The pty may take a part of a line; the rest goes first the next time."""
        try:
            self._unwritten = self._unwritten[os.write(self._peer, self._unwritten) :] if self._unwritten else b""
            if not self._unwritten:
                self._unwritten = text[os.write(self._peer, text) :]
                return
        except BlockingIOError:
            pass
        raise can.CanOperationError("the pty is full", errno.ENOBUFS)

    def _drain(self) -> None:
        """Discard what the other programs sent: a full pty would stop their controller."""
        try:
            while os.read(self._peer, 1 << 16):
                pass
        except BlockingIOError:
            pass

    def shutdown(self) -> None:
        """Remove the interface."""
        self._close()

    def _close(self) -> None:
        os.close(self._line)
        os.close(self._peer)


if __name__ == "__main__":
    made = Slcan(sys.argv[2])
    try:
        print(play_onto(made, load_scenario(sys.argv[1]), None, truth=False, ahead=True).text(), file=sys.stderr)
    finally:
        made.shutdown()
