"""Which bus a tool opens, and that the daemon opens none but its configuration's."""

import json
import os
import subprocess
import sys
import threading
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import can.util
import pytest

from sim_ecu.cli.main import main as sim_ecu
from tests.support.processes import ROOT, wait_for
from tests.support.scenarios import held
from wrcd.bus.pythoncan import open_bus
from wrcd.cli.main import main as wrcd
from wrcd.config.config import DEFAULT, load_config
from wrcd.errors import BusError, InputError
from wrcd.logs.bus_of import bus_of, pick_bus

DEFAULTS = ("socketcan", "can0")
VARIABLES = ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_BITRATE", "CAN_CONFIG")
WRCD = (sys.executable, "-m", "wrcd.cli")


@pytest.fixture
def canrc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """python-can's file, not there yet; no other one is read, nor the environment of this computer."""
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    file = tmp_path / ".canrc"
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(file)])
    return file


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "train.toml"
    file.write_text(DEFAULT)
    return file


# --- which one


@pytest.mark.usefixtures("canrc")
def test_bus_that_nothing_names_is_the_default_and_nothing_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert pick_bus(None, None, None, DEFAULTS) == DEFAULTS
    assert capsys.readouterr().err == ""


def test_option_wins_over_file_over_environment_over_settings_file_over_default(
    canrc: Path, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    canrc.write_text("[default]\ninterface = kvaser\nchannel = 3\n")
    assert pick_bus(None, None, None, DEFAULTS) == ("kvaser", "3")
    monkeypatch.setenv("CAN_CONFIG", json.dumps({"interface": "ixxat", "channel": 2}))
    assert pick_bus(None, None, None, DEFAULTS) == ("ixxat", "2")
    monkeypatch.setenv("CAN_INTERFACE", "pcan")
    monkeypatch.setenv("CAN_CHANNEL", "PCAN_USBBUS1")
    assert pick_bus(None, None, None, DEFAULTS) == ("pcan", "PCAN_USBBUS1")
    assert pick_bus(None, None, config, DEFAULTS) == ("pcan", "PCAN_USBBUS1")  # it names no bus
    config.write_text('[bus]\nchannel = "can3"\n' + DEFAULT)
    assert pick_bus(None, None, config, DEFAULTS) == ("pcan", "can3")
    config.write_text('[bus]\ninterface = "socketcan"\nchannel = "can3"\n' + DEFAULT)
    assert pick_bus(None, None, config, DEFAULTS) == ("socketcan", "can3")
    assert pick_bus("virtual", None, config, DEFAULTS) == ("virtual", "can3")
    assert pick_bus(None, "can4", config, DEFAULTS) == ("socketcan", "can4")
    assert pick_bus("virtual", "x", config, DEFAULTS) == ("virtual", "x")


def test_bus_of_the_users_settings_is_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("CAN_CHANNEL", "vcan7")
    args = Namespace(interface="socketcan", channel=None, config=None)
    assert bus_of(args, load_config(None)) == ("socketcan", "vcan7")
    assert capsys.readouterr().err.startswith("bus socketcan:vcan7, as python-can's settings say (CAN_INTERFACE, ")
    args.channel = "vcan0"
    assert bus_of(args, load_config(None)) == ("socketcan", "vcan0")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("text", ["{", "[]", "3"])
def test_environment_that_is_no_json_object_is_an_error(
    canrc: Path, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CAN_CONFIG", text)
    with pytest.raises(InputError, match=r"^CAN_CONFIG: ") as caught:
        pick_bus(None, None, None, DEFAULTS)
    assert "\n" not in str(caught.value)
    assert pick_bus("virtual", "x", None, DEFAULTS) == ("virtual", "x")


def test_settings_file_that_cannot_be_read_is_an_error(canrc: Path) -> None:
    canrc.write_text("interface = pcan\n")
    with pytest.raises(InputError, match="python-can's settings") as caught:
        pick_bus(None, None, None, DEFAULTS)
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("canrc")
def test_unknown_interface_of_the_environment_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "socketcam")
    assert wrcd(["dump"]) == 2
    said = capsys.readouterr().err
    assert "bus socketcam:can0, as python-can's settings say" in said
    assert "did you mean 'socketcan'?" in said


# --- the tools take it


@contextmanager
def sending(channel: str) -> Iterator[None]:
    """Somebody who sends to a virtual bus all the time."""
    ended = threading.Event()
    with can.Bus(channel, interface="virtual", ignore_config=True) as bus:

        def send() -> None:
            while not ended.wait(0.01):
                bus.send(can.Message(arbitration_id=0x101, data=bytes(8), is_extended_id=False))

        sender = threading.Thread(target=send)
        sender.start()
        try:
            yield
        finally:
            ended.set()
            sender.join()


def test_dump_and_check_listen_where_the_environment_says(
    canrc: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    canrc.write_text("[default]\nchannel = told\n")
    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    with sending("told"):
        assert wrcd(["dump", "-n", "1"]) == 0
        assert " told 101#0000000000000000 :: YawRate_A1(" in capsys.readouterr().out
        assert wrcd(["check", "--live", "0.3"]) in (1, 3)
        said = capsys.readouterr()
    assert "bus virtual:told" in said.err
    assert "YawRate_A1" in said.out


def test_monitor_opens_what_the_environment_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setenv("CAN_CHANNEL", "nosuchbus9")
    assert wrcd(["monitor"]) == 3
    said = capsys.readouterr().err
    assert "socketcan:nosuchbus9" in said


@pytest.mark.parametrize("command", ["play", "demo"])
def test_rig_plays_where_the_environment_says(
    canrc: Path, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CAN_CONFIG", json.dumps({"interface": "virtual", "channel": "told"}))
    scenario = tmp_path / "short.toml"
    scenario.write_text(held("A", 0.5))
    more = {"play": ["--fault", "crc:at=0.1,for=0.1,of=yaw_rate,axle=1"], "demo": ["-o", str(tmp_path)]}
    named = ["--scenario", str(scenario)] if command == "demo" else [str(scenario)]
    with can.Bus("told", interface="virtual", ignore_config=True) as bus:
        sim_ecu([command, *named, *more.get(command, [])])
        first = bus.recv(0.0)
    assert first is not None
    assert "virtual:told" in capsys.readouterr().err


@pytest.mark.usefixtures("canrc")
def test_further_settings_are_a_tools_and_not_the_daemons(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_CONFIG", json.dumps({"receive_own_messages": True}))
    for tool in (True, False):
        with open_bus("virtual", "further", user_settings=tool) as bus:
            bus.send(can.Message(arbitration_id=1, is_extended_id=False))
            assert (bus.recv(0.0) is not None) == tool


# --- the daemon does not


@pytest.mark.parametrize(
    ("variables", "file"),
    [
        ({"CAN_INTERFACE": "socketcan", "CAN_CHANNEL": "can77", "CAN_BITRATE": "1"}, ""),
        ({"CAN_CONFIG": json.dumps({"interface": "socketcan", "channel": "can77", "no_such_option": 1})}, ""),
        ({"CAN_CONFIG": "{"}, ""),
        ({}, "[default]\ninterface = socketcan\nchannel = can77\nport = nonsense\n"),
        ({}, "no INI file\n"),
    ],
    ids=["variables", "CAN_CONFIG", "CAN_CONFIG damaged", "canrc", "canrc damaged"],
)
def test_hostile_settings_do_not_change_what_the_daemon_opens(
    variables: dict[str, str], file: str, tmp_path: Path, config: Path
) -> None:
    (tmp_path / ".canrc").write_text(file)
    options = ["-i", "virtual", "-c", "mine"] if file else []
    if not options:
        config.write_text('[bus]\ninterface = "virtual"\nchannel = "mine"\n' + DEFAULT)
    log = tmp_path / "log"
    environment = {**os.environ, "HOME": str(tmp_path), **variables}
    with log.open("w") as out:
        process = subprocess.Popen(
            [*WRCD, "run", "--config", str(config), *options], cwd=ROOT, stdin=subprocess.DEVNULL, stderr=out,
            env=environment,
        )  # fmt: skip
    try:
        wait_for("the daemon", 30, lambda: "axles 1" in log.read_text() or process.poll() is not None)
        assert "virtual:mine, axles 1" in log.read_text()
    finally:
        process.terminate()
        process.wait(10)


def test_hostile_settings_do_not_give_the_daemon_a_bus_that_its_configuration_lacks(
    tmp_path: Path, config: Path
) -> None:
    (tmp_path / ".canrc").write_text("[default]\ninterface = virtual\nchannel = evil\n")
    config.write_text('[bus]\nchannel = "can77"\n' + DEFAULT)
    environment = {**os.environ, "HOME": str(tmp_path), "CAN_INTERFACE": "virtual", "CAN_CHANNEL": "evil"}
    done = subprocess.run(
        [*WRCD, "run", "--config", str(config)],
        cwd=ROOT, timeout=60, capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    assert done.returncode == 3
    assert "can77" in done.stderr
    assert "evil" not in done.stderr


def test_daemon_without_what_an_interface_needs_is_not_sent_to_settings_it_does_not_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def needs_more(**_options: object) -> None:
        raise TypeError("missing 1 required argument: 'host'")

    monkeypatch.setattr(can, "Bus", needs_more)
    with pytest.raises(BusError, match="configuration file"):
        open_bus("virtual", "x", user_settings=True)
    with pytest.raises(BusError, match=r"the daemon reads no ~/\.can"):
        open_bus("virtual", "x")
