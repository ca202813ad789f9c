"""Tests on a real kernel's vcan0."""

import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.can_ids import EXTENDED_KEY, YAW_RATE_A1
from tests.support.vcan import FaultySocket, Node, add, ip
from wrcd.bus.socketcan import SocketCanLink


def pytest_configure(config: pytest.Config) -> None:
    if all(Path(name).name.startswith("test_systemd.py") for name in config.args):
        return  # it reads a recording
    missing = [tool for tool in ("candump", "cansend", "canplayer") if shutil.which(tool) is None]
    if not hasattr(socket, "AF_CAN") or not Path("/sys/class/net/vcan0").exists() or missing:
        raise pytest.UsageError(
            "these tests need vcan0 and can-utils; run them with `make test`, or "
            "`tests/hil/guest/run --native-ok -- .venv/bin/python -m pytest tests/hil/test_vcan.py`"
        )


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the figures of the tests that passed: what they printed, without the daemons' own lines."""
    for report in terminalreporter.getreports("passed"):
        figures = [line for line in report.capstdout.splitlines() if line and not line.startswith(("wrcd: ", "[]"))]
        if report.when == "call" and figures:
            terminalreporter.write_line("\n    ".join([report.nodeid, *figures]))


@pytest.fixture
def bus() -> Iterator[str]:
    """A vcan of this test's own."""
    add("vcan9")
    ip("set", "vcan9", "up")
    yield "vcan9"
    subprocess.run(["ip", "link", "del", "vcan9"], timeout=10, check=False, capture_output=True)


@pytest.fixture
def node(bus: str) -> Iterator[Node]:
    n = Node(bus)
    yield n
    n.close()


@pytest.fixture
def sockets(monkeypatch: pytest.MonkeyPatch) -> list[FaultySocket]:
    """The sockets that a link makes from now on, in their order. To be asked for before `link`."""
    made: list[FaultySocket] = []

    def make(*args: int) -> FaultySocket:
        made.append(FaultySocket(*args))
        return made[-1]

    monkeypatch.setattr(socket, "socket", make)
    return made


@pytest.fixture
def link(bus: str) -> Iterator[SocketCanLink]:
    made = SocketCanLink(bus, (YAW_RATE_A1, EXTENDED_KEY))
    yield made
    made.close()
