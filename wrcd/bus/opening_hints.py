"""What to do about a bus that cannot be opened, for the system at hand: asked only when it has failed."""

import difflib
import errno
import socket
import sys
from collections.abc import Collection
from pathlib import Path

from wrcd.bus.rawcan import GONE
from wrcd.errors import InputError

OS_RELEASE = Path("/proc/sys/kernel/osrelease")
INTERFACES = Path("/sys/class/net")
CONTAINER_MARKS = (Path("/.dockerenv"), Path("/run/.containerenv"))
ARPHRD_CAN = 280  # linux/if_arp.h: what /sys/class/net/NAME/type says of a CAN interface
IFF_UP = 1
MAX_NAME = 15  # IFNAMSIZ - 1
NO_CAN_NEEDED = "`sim-ecu demo` and `wrcd replay` need no CAN"
OTHER_KERNEL = f"{NO_CAN_NEEDED}, `tests/with-vcan COMMAND` of the sources brings a kernel that has it"
# python-can's own extras that bring what an interface needs; other interfaces need their vendor's driver
EXTRAS = {
    "canalystii": "canalystii", "cantact": "cantact", "gs_usb": "gs-usb", "neovi": "neovi", "nixnet": "nixnet",
    "robotell": "serial", "seeedstudio": "seeedstudio", "serial": "serial", "slcan": "serial",
    "udp_multicast": "multicast",
}  # fmt: skip


def no_socketcan() -> str:
    """For a Python without AF_CAN: SocketCAN is Linux's."""
    if sys.platform == "darwin":
        return f"macOS has no SocketCAN: use a Linux machine, or an adapter's interface (-i pcan); {NO_CAN_NEEDED}"
    if sys.platform in ("win32", "cygwin"):
        return f"Windows has no SocketCAN: use Linux, or an adapter's interface (-i pcan, kvaser); {NO_CAN_NEEDED}"
    return f"use a Python for Linux that was built with it, or another interface (-i); {NO_CAN_NEEDED}"


def for_socketcan(e: OSError, channel: str) -> str:
    """For an error of a CAN socket: that it could not be made, or not be bound to the interface."""
    if not hasattr(socket, "AF_CAN"):
        return no_socketcan()
    if e.errno in (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT):
        return _no_can_in_the_kernel()
    if e.errno in GONE or e.errno is None:
        return _no_such_interface(channel)
    if e.errno in (errno.EPERM, errno.EACCES):
        if _in_container():
            return "the container's seccomp profile forbids CAN sockets: allow AF_CAN there"
        return "no rights are needed for a CAN socket: a sandbox forbids it, see RestrictAddressFamilies= of the unit"
    if e.errno == errno.ENETDOWN:
        return bring_up(channel)
    return f"see `ip -details link show {channel}`"


def bring_up(channel: str) -> str:
    """The command that does so."""
    if channel.startswith(("vcan", "vxcan")):
        return f"bring it up: sudo ip link set {channel} up"
    return f"bring it up, with the bus's bit rate: sudo ip link set {channel} up type can bitrate 500000"


def is_down(channel: str) -> bool:
    """Whether there is an interface of that name and it is down."""
    try:
        return not int((INTERFACES / channel / "flags").read_text(), 16) & IFF_UP
    except (OSError, ValueError):
        return False


def for_python_can(interface: str, channel: str, e: Exception, user_settings: bool = True) -> str:
    """For an error of one of python-can's interfaces. user_settings: python-can's own were read, as a tool does."""
    if isinstance(e, OSError) and interface == "socketcan":
        return for_socketcan(e, channel)
    if isinstance(e, PermissionError):
        return f"you may not open {channel}: for a serial port add the user to its group, e.g. dialout"
    if isinstance(e, FileNotFoundError):
        return f"there is no {channel}: check -c and the adapter's plug"
    if isinstance(e, TypeError):
        if user_settings:
            return "what it needs besides a channel goes to python-can's own configuration file, ~/.can"
        return "it needs more than a channel, and the daemon reads no ~/.can: reach this bus through SocketCAN"
    if isinstance(e, ValueError):
        return f"check the channel (-c) {channel!r}: see python-can's page on {interface}"
    if isinstance(e, NotImplementedError | ImportError | AttributeError) or "not found" in str(e):
        if interface in EXTRAS:
            return f"pip install 'python-can[{EXTRAS[interface]}]'"
        return f"install the driver of the adapter's vendor: see python-can's page on {interface}"
    return f"check the adapter and the channel (-c): see python-can's page on {interface}"


def check_interface(name: str, known: Collection[str]) -> None:
    """Raises InputError for a name that is none of python-can's, with the nearest one or all of them."""
    if name in known:
        return
    near = difflib.get_close_matches(name.lower().replace("-", "_"), known, n=1, cutoff=0.6)
    hint = f"did you mean {near[0]!r}?" if near else f"one of {', '.join(sorted(known))}"
    raise InputError(f"{name!r} is no interface of python-can", key="interface", hint=hint)


def _no_can_in_the_kernel() -> str:
    if "microsoft" in _release().lower():
        return (
            "the kernel of WSL has no CAN: sudo modprobe can-raw; if there is no such module, build its kernel with "
            f"CONFIG_CAN, CONFIG_CAN_RAW and CONFIG_CAN_VCAN, and name it in .wslconfig; {OTHER_KERNEL}"
        )
    if _in_container():
        return f"the container has its host's kernel: load CAN there, sudo modprobe can-raw; {OTHER_KERNEL}"
    return (
        "this kernel has no CAN: sudo modprobe can-raw; if there is no such module, Ubuntu has it in "
        "linux-modules-extra-$(uname -r), Debian in linux-image-amd64 (not in the cloud kernel); " + OTHER_KERNEL
    )


def _no_such_interface(channel: str) -> str:
    if len(channel) > MAX_NAME:
        return f"an interface's name has at most {MAX_NAME} characters"
    if (INTERFACES / channel).exists():
        return f"{channel} is no CAN interface{_there_is()}"
    if channel.startswith("vcan"):
        make = f"make it: sudo ip link add {channel} type vcan && sudo ip link set {channel} up"
        module = "" if _can_interfaces() else " (Unknown device type: sudo modprobe vcan)"
        return make + module + _there_is()
    if _in_container():
        move = f"sudo ip link set {channel} netns PID"
        return f"a container sees its own interfaces only: --network host, or move it there, {move}{_there_is()}"
    return f"is the adapter plugged in, and its driver loaded? See `ip link show type can`{_there_is()}"


def _there_is() -> str:
    """The CAN interfaces that there are."""
    there = _can_interfaces()
    return f"; there is {', '.join(there)}" if there else ""


def _can_interfaces() -> list[str]:
    found = []
    for folder in INTERFACES.glob("*"):
        try:
            if int((folder / "type").read_text()) == ARPHRD_CAN:
                found.append(folder.name)
        except (OSError, ValueError):
            continue
    return sorted(found)


def _in_container() -> bool:
    return any(mark.exists() for mark in CONTAINER_MARKS)


def _release() -> str:
    try:
        return OS_RELEASE.read_text()
    except OSError:
        return ""
