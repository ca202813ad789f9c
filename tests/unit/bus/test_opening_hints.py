"""What is said about a bus that cannot be opened, on this system and on foreign ones."""

import errno
import os
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from sim_ecu.play.interface import open_bus as open_rig_bus
from tests.support.config_texts import AXLE, VEHICLE
from tests.support.snapshots import assert_kept
from wrcd.bus import opening_hints
from wrcd.bus.pythoncan import open_bus
from wrcd.bus.socketcan import SocketCanLink
from wrcd.config.config import load_config
from wrcd.errors import BusError, InputError

UP, DOWN = "0xc1", "0x80"


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
        self._monkeypatch.delattr(socket, "AF_CAN", raising=False)


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(tmp_path, monkeypatch)


def error(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def told(machine: Machine) -> Iterator[tuple[str, str]]:
    """What is said where, in turn: the machine keeps what it has been given."""
    kernel, missing, forbidden = error(errno.EAFNOSUPPORT), error(errno.ENODEV), error(errno.EACCES)
    yield "vcan0 missing", opening_hints.for_socketcan(missing, "vcan0")
    yield "can0 missing", opening_hints.for_socketcan(error(errno.ENXIO), "can0")
    for name, kind in (("can1", opening_hints.ARPHRD_CAN), ("vcan1", opening_hints.ARPHRD_CAN), ("eth0", 1)):
        machine.interface(name, kind)
    yield "vcan0 missing beside others", opening_hints.for_socketcan(missing, "vcan0")
    yield "can0 missing beside others", opening_hints.for_socketcan(missing, "can0")
    yield "of another kind", opening_hints.for_socketcan(missing, "eth0")
    yield "too long", opening_hints.for_socketcan(OSError("AF_CAN interface name too long"), "can0123456789abcdef")
    yield "down", opening_hints.for_socketcan(error(errno.ENETDOWN), "can0")
    yield "down, virtual", opening_hints.for_socketcan(error(errno.ENETDOWN), "vcan0")
    yield "another error", opening_hints.for_socketcan(error(errno.ENOMEM), "can0")
    raised: Exception
    for interface, raised in (
        ("slcan", can.CanInterfaceNotImplementedError("The serial module is not installed")),
        ("gs_usb", ImportError("No module named 'usb'")), ("pcan", OSError("pcanbasic library not found.")),
        ("vector", can.CanInterfaceNotImplementedError("only on Windows")),
        ("kvaser", ValueError("channel must be an integer")),
        ("socketcand", TypeError("missing 2 required arguments: 'host'")),
        ("slcan", PermissionError(13, "Permission denied")), ("slcan", FileNotFoundError(2, "No such file")),
        ("socketcan", missing), ("pcan", can.CanInitializationError("PCAN_ERROR_ILLHW")),
    ):  # fmt: skip
        yield f"{interface}: {type(raised).__name__}", opening_hints.for_python_can(interface, "x", raised)
    for system in ("Linux", "container", "WSL"):
        if system != "Linux":
            (machine.container if system == "container" else machine.wsl)()
        yield f"{system}, no CAN", opening_hints.for_socketcan(kernel, "can0")
        yield f"{system}, no adapter", opening_hints.for_socketcan(missing, "can0")
        yield f"{system}, forbidden", opening_hints.for_socketcan(forbidden, "can0")
    for platform in ("darwin", "win32", "linux"):
        machine.foreign(platform)
        with pytest.raises(BusError) as caught:
            SocketCanLink("can0", None)
        yield platform, str(caught.value)
        # python-can's own socket fails there in its own way
        assert str(caught.value).endswith(opening_hints.for_python_can("socketcan", "can0", OSError("no CAN")))


def test_what_cannot_be_opened_is_told_with_the_way_to_mend_it(machine: Machine) -> None:
    assert_kept("hints", "where: hint", (f"{where}: {hint}" for where, hint in told(machine)))
    assert opening_hints.for_socketcan(error(errno.EPERM), "x") == opening_hints.for_socketcan(error(errno.EACCES), "x")


@pytest.mark.parametrize("channel", ["vcan0", "can0"])
def test_rig_names_an_interface_that_is_down(machine: Machine, channel: str) -> None:
    machine.interface(channel, flags=DOWN)
    with pytest.raises(BusError, match=f"{channel}' is down"):
        open_rig_bus("socketcan", channel)


def test_interface_that_is_up_or_missing_is_not_down(machine: Machine) -> None:
    machine.interface("can0")
    assert not opening_hints.is_down("can0")
    assert not opening_hints.is_down("can1")


@pytest.mark.parametrize("interface", sorted(can.VALID_INTERFACES - {"virtual"}))
def test_every_interface_that_cannot_be_opened_is_a_bus_error_with_advice(interface: str) -> None:
    """None of their drivers is here: whatever python-can raises becomes one line."""
    with pytest.raises(BusError, match=f"^channel: {interface}:x cannot be opened: .+ — .+$") as caught:
        open_bus(interface, "x")
    assert "\n" not in str(caught.value)


def test_extras_are_those_of_interfaces_that_there_are() -> None:
    assert set(opening_hints.EXTRAS) <= can.VALID_INTERFACES


@pytest.mark.parametrize(
    ("name", "near"),
    [("socketcam", "'socketcan'"), ("gs-usb", "'gs_usb'"), ("PCAN", "'pcan'"), ("", "cantact"), ("bus", "cantact")],
)
def test_unknown_interface_is_named_with_its_line_by_check(name: str, near: str, tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    file.write_text(f'[bus]\nchannel = "can0"\ninterface = "{name}"\n{VEHICLE}{AXLE}')
    with pytest.raises(InputError) as caught:
        load_config(file)
    assert str(caught.value).startswith(f"{file}:3: bus.interface: {name!r} ")
    assert near in str(caught.value)
