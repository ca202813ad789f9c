"""What is said about a bus that cannot be opened, on this system and on foreign ones."""

import errno
import os
import socket
import sys
from pathlib import Path

import can
import pytest

from sim_ecu.play.interface import open_bus as open_rig_bus
from tests.support.config_texts import AXLE, VEHICLE
from wrcd.bus import opening_hints
from wrcd.bus.pythoncan import open_bus
from wrcd.bus.socketcan import SocketCanLink
from wrcd.config.config import load_config
from wrcd.errors import BusError, InputError

UP, DOWN = "0xc1", "0x80"
NO_CAN = "`sim-ecu demo` and `wrcd replay` need no CAN"


class Machine:
    """A system of its own: its kernel, its interfaces, whether it is a container."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self._monkeypatch = monkeypatch
        self._net, self._release, self._mark = folder / "net", folder / "osrelease", folder / "mark"
        self._net.mkdir()
        self._release.write_text("6.1.0-30-amd64\n")
        monkeypatch.setattr(opening_hints, "INTERFACES", self._net)
        monkeypatch.setattr(opening_hints, "OS_RELEASE", self._release)
        monkeypatch.setattr(opening_hints, "CONTAINER_MARKS", (self._mark,))
        monkeypatch.setattr(sys, "platform", "linux")
        monkeypatch.setattr(socket, "AF_CAN", 29, raising=False)

    def interface(self, name: str, kind: int = opening_hints.ARPHRD_CAN, flags: str = UP) -> None:
        (self._net / name).mkdir()
        (self._net / name / "type").write_text(f"{kind}\n")
        (self._net / name / "flags").write_text(f"{flags}\n")

    def wsl(self) -> None:
        self._release.write_text("5.15.153.1-microsoft-standard-WSL2\n")

    def container(self) -> None:
        self._mark.touch()

    def foreign(self, platform: str) -> None:
        self._monkeypatch.setattr(sys, "platform", platform)
        self._monkeypatch.delattr(socket, "AF_CAN")


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(tmp_path, monkeypatch)


def error(number: int) -> OSError:
    return OSError(number, os.strerror(number))


@pytest.mark.parametrize(
    ("platform", "expected"),
    [
        ("darwin", f"macOS has no SocketCAN: use a Linux machine, or an adapter's interface (-i pcan); {NO_CAN}"),
        ("win32", f"Windows has no SocketCAN: use Linux, or an adapter's interface (-i pcan, kvaser); {NO_CAN}"),
        ("linux", f"use a Python for Linux that was built with it, or another interface (-i); {NO_CAN}"),
    ],
)
def test_system_without_socketcan_is_named(machine: Machine, platform: str, expected: str) -> None:
    machine.foreign(platform)
    with pytest.raises(BusError) as caught:
        SocketCanLink("can0", None)
    assert str(caught.value) == f"interface: this Python has no AF_CAN — {expected}"
    # python-can's own socket fails there in its own way
    assert opening_hints.for_python_can("socketcan", "can0", OSError("no CAN")) == expected


@pytest.mark.parametrize("number", [errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT])
def test_kernel_without_can_says_which_package_has_it(machine: Machine, number: int) -> None:
    said = opening_hints.for_socketcan(error(number), "can0")
    assert said == (
        "this kernel has no CAN: sudo modprobe can-raw; if there is no such module, Ubuntu has it in "
        f"linux-modules-extra-$(uname -r), Debian in linux-image-amd64 (not in the cloud kernel); {NO_CAN}"
    )
    machine.container()
    said = opening_hints.for_socketcan(error(number), "can0")
    assert said == f"the container has its host's kernel: load CAN there, sudo modprobe can-raw; {NO_CAN}"
    machine.wsl()
    said = opening_hints.for_socketcan(error(number), "can0")
    assert said.startswith("the kernel of WSL has no CAN: ")
    assert "CONFIG_CAN_VCAN" in said


def test_missing_vcan_says_how_it_is_made(machine: Machine) -> None:
    make = "make it: sudo ip link add vcan0 type vcan && sudo ip link set vcan0 up"
    missing = error(errno.ENODEV)
    assert opening_hints.for_socketcan(missing, "vcan0") == f"{make} (Unknown device type: sudo modprobe vcan)"
    machine.interface("vcan1")
    assert opening_hints.for_socketcan(missing, "vcan0") == f"{make}; there is vcan1"


def test_missing_adapter_says_what_there_is(machine: Machine) -> None:
    plug = "is the adapter plugged in, and its driver loaded? See `ip link show type can`"
    for number in (errno.ENODEV, errno.ENXIO):
        assert opening_hints.for_socketcan(error(number), "can0") == plug
    machine.interface("can1")
    machine.interface("vcan0")
    machine.interface("eth0", 1)
    assert opening_hints.for_socketcan(error(errno.ENODEV), "can0") == f"{plug}; there is can1, vcan0"
    machine.container()
    said = opening_hints.for_socketcan(error(errno.ENODEV), "can0")
    assert said.startswith("a container sees its own interfaces only: --network host, or ")
    assert "sudo ip link set can0 netns PID" in said


def test_interface_of_another_kind_is_named(machine: Machine) -> None:
    machine.interface("eth0", 1)
    machine.interface("can0")
    said = opening_hints.for_socketcan(error(errno.ENODEV), "eth0")
    assert said == "eth0 is no CAN interface; there is can0"


def test_name_that_is_too_long_is_named(machine: Machine) -> None:
    said = opening_hints.for_socketcan(OSError("AF_CAN interface name too long"), "can0123456789abcdef")
    assert said == "an interface's name has at most 15 characters"


@pytest.mark.parametrize("number", [errno.EPERM, errno.EACCES])
def test_forbidden_socket_names_the_sandbox(machine: Machine, number: int) -> None:
    assert "RestrictAddressFamilies= of the unit" in opening_hints.for_socketcan(error(number), "can0")
    machine.container()
    assert "seccomp profile" in opening_hints.for_socketcan(error(number), "can0")


@pytest.mark.parametrize(
    ("channel", "expected"),
    [
        ("vcan0", "bring it up: sudo ip link set vcan0 up"),
        ("can0", "bring it up, with the bus's bit rate: sudo ip link set can0 up type can bitrate 500000"),
    ],
)
def test_interface_that_is_down_says_how_it_comes_up(machine: Machine, channel: str, expected: str) -> None:
    assert opening_hints.for_socketcan(error(errno.ENETDOWN), channel) == expected
    machine.interface(channel, flags=DOWN)
    with pytest.raises(BusError) as caught:
        open_rig_bus("socketcan", channel)
    assert str(caught.value) == f"channel: CAN interface {channel!r} is down — {expected}"


def test_interface_that_is_up_or_missing_is_not_down(machine: Machine) -> None:
    machine.interface("can0")
    assert not opening_hints.is_down("can0")
    assert not opening_hints.is_down("can1")


def test_other_error_says_where_to_look(machine: Machine) -> None:
    assert opening_hints.for_socketcan(error(errno.ENOMEM), "can0") == "see `ip -details link show can0`"


@pytest.mark.parametrize(
    ("interface", "raised", "expected"),
    [
        ("slcan", can.CanInterfaceNotImplementedError("The serial module is not installed"), "'python-can[serial]'"),
        ("gs_usb", ImportError("No module named 'usb'"), "pip install 'python-can[gs-usb]'"),
        ("pcan", OSError("pcanbasic library not found."), "driver of the adapter's vendor: see python-can's page on"),
        ("vector", can.CanInterfaceNotImplementedError("only on Windows"), "driver of the adapter's vendor"),
        ("kvaser", ValueError("channel must be an integer"), "check the channel (-c) 'x': see python-can's page on"),
        (
            "socketcand",
            TypeError("missing 2 required arguments: 'host'"),
            "python-can's own configuration file, ~/.can",
        ),
        ("slcan", PermissionError(13, "Permission denied"), "you may not open x: for a serial port"),
        ("slcan", FileNotFoundError(2, "No such file"), "there is no x: check -c and the adapter's plug"),
        ("socketcan", error(errno.ENODEV), "is the adapter plugged in"),
        ("pcan", can.CanInitializationError("PCAN_ERROR_ILLHW"), "check the adapter and the channel (-c)"),
    ],
)
def test_error_of_python_can_says_what_is_missing(
    machine: Machine, interface: str, raised: Exception, expected: str
) -> None:
    assert expected in opening_hints.for_python_can(interface, "x", raised)


@pytest.mark.parametrize("interface", sorted(can.VALID_INTERFACES - {"virtual"}))
def test_every_interface_that_cannot_be_opened_is_a_bus_error_with_advice(interface: str) -> None:
    """None of their drivers is here: whatever python-can raises becomes one line."""
    with pytest.raises(BusError, match=f"^channel: {interface}:x cannot be opened: .+ — .+$") as caught:
        open_bus(interface, "x")
    assert "\n" not in str(caught.value)


def test_extras_are_those_of_interfaces_that_there_are() -> None:
    assert set(opening_hints.EXTRAS) <= can.VALID_INTERFACES


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("socketcam", "did you mean 'socketcan'?"),
        ("gs-usb", "did you mean 'gs_usb'?"),
        ("PCAN", "did you mean 'pcan'?"),
        ("", "one of canalystii, cantact, "),
        ("bus", "one of canalystii, cantact, "),
    ],
)
def test_unknown_interface_is_named_with_its_line_by_check(name: str, expected: str, tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    file.write_text(f'[bus]\nchannel = "can0"\ninterface = "{name}"\n{VEHICLE}{AXLE}')
    with pytest.raises(InputError) as caught:
        load_config(file)
    assert str(caught.value).startswith(f"{file}:3: bus.interface: {name!r} is no interface of python-can — {expected}")
    assert caught.value.status == 2
