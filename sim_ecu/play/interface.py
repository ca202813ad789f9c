"""The rig's end of a bus, and the faults that take the whole interface away."""

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import can

from sim_ecu.play.faults import SILENT, Fault
from wrcd.bus import pythoncan
from wrcd.bus.opening_hints import bring_up, is_down
from wrcd.errors import BusError, InputError

INTERFACES = Path("/sys/class/net")


def ip(*words: str) -> None:
    """`ip link …`. Raises BusError with what it says."""
    try:
        subprocess.run(["ip", "link", *words], check=True, capture_output=True, text=True, timeout=30)
    except FileNotFoundError:
        raise BusError("the command ip is missing", hint="install Debian's package iproute2") from None
    except subprocess.CalledProcessError as e:
        raise BusError(f"ip link {' '.join(words)}: {e.stderr.strip()}", key="channel") from None


def check(faults: Sequence[Fault], interface: str, channel: str) -> None:
    """Raises InputError if a fault cannot be made on this interface."""
    for f in faults:
        if f.kind not in SILENT:
            continue
        if f.kind == "bus-off":
            raise InputError("cannot be made on a bus", key=f.kind, hint="--fast")
        if interface != "socketcan" or not channel.startswith("vcan"):
            raise InputError(
                "is made on an interface that nobody misses", key=f.kind, hint="-i socketcan -c vcan1, or --fast"
            )
        if os.geteuid() != 0:
            raise InputError("needs root", key=f.kind, hint="sudo, or --fast")


def open_bus(interface: str, channel: str, fd: bool = False, **options: Any) -> can.BusABC:
    """A bus by python-can's names, with its options, that nothing comes from. Raises InputError for an unknown name,
    BusError for a bus that cannot be opened or that is down."""
    if interface == "socketcan" and is_down(channel):
        raise BusError(f"CAN interface {channel!r} is down", key="channel", hint=bring_up(channel))
    more: dict[str, Any] = options | ({"fd": True} if fd else {})
    nothing = [{"can_id": 0x7FF, "can_mask": 0x7FF}]
    return pythoncan.open_bus(interface, channel, user_settings=True, can_filters=nothing, **more)


class PythonCan:
    """A bus of python-can's; a vcan can go down, and can be deleted and made again."""

    def __init__(self, interface: str, channel: str, fd: bool = False) -> None:
        self._names = interface, channel, fd
        self._bus: can.BusABC | None = open_bus(interface, channel, fd)
        self.channel_info = self._bus.channel_info
        self._away: Fault | None = None
        self._mtu = ""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """As python-can's."""
        if self._bus is not None:
            self._bus.send(msg, timeout)

    def begin(self, fault: Fault) -> None:
        """Take the link or the device away. The rig's own socket would go deaf: it is closed."""
        if fault.kind not in SILENT:
            return
        channel = self._names[1]
        if self._bus is not None:
            self._bus.shutdown()
        self._bus, self._away = None, fault
        self._mtu = (INTERFACES / channel / "mtu").read_text().strip()
        if fault.kind == "link-down":
            ip("set", channel, "down")
        else:
            ip("del", channel)

    def end(self, fault: Fault) -> None:
        """Give it back."""
        if fault is not self._away:
            return
        channel, self._away = self._names[1], None
        if fault.kind == "device-gone":
            ip("add", channel, "mtu", self._mtu, "type", "vcan")
        ip("set", channel, "up")
        self._bus = open_bus(*self._names)

    def shutdown(self) -> None:
        """Let go of it."""
        if self._away is not None:
            self.end(self._away)
        if self._bus is not None:
            self._bus.shutdown()
