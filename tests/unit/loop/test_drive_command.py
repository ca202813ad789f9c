"""`sim-ecu drive` and `sim-ecu control` as commands: in real time on python-can's virtual bus."""

import io
import json
import signal
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from sim_ecu.loop.bus_end import End, open_end
from sim_ecu.loop.control.adhesion_consumer import Unprotected
from sim_ecu.loop.control.control_on_bus import InputWatch, OnBus
from sim_ecu.loop.drive_scenario import load_drive_scenario
from tests.support.loop_wire import SHORT, KeptLines
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log


@pytest.fixture
def short(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


@contextmanager
def controlled(scenario: Path, channel: str) -> Iterator[OnBus]:
    """A controller in a thread of its own for the length of a block."""
    rides = load_drive_scenario(scenario)
    inputs, ended = InputWatch(rides.axles), threading.Event()
    link = open_end("virtual", channel, inputs.ids)
    controls = OnBus(Unprotected(rides.axles, rides.actuators), [inputs], End(link, KeptLines()))

    def turn() -> None:
        while not ended.wait(controls.wait_s()):
            controls.turn()

    thread = threading.Thread(target=turn)
    thread.start()
    try:
        yield controls
    finally:
        ended.set()
        thread.join(10)
        link.close()


def test_drive_on_a_bus_with_a_controller_ends_with_its_figures(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = tmp_path / "a.log", tmp_path / "a.json"
    with controlled(short, "drive-command") as controls:
        status = main(
            ["drive", str(short), "-i", "virtual", "-c", "drive-command", "--log", str(log), "--json", str(out)]
        )
    said, document = capsys.readouterr().out, json.loads(out.read_text())
    assert status == 0
    assert "short: full braking" in said
    assert document["over"]
    assert document["seconds"] == pytest.approx(1.0)
    assert document["demand"]["1"]["heard"]
    assert controls.frames > 20
    count = Counter(f.can_id for f, _ in read_log(log, Damage()))
    # in real time, and both threads on one processor: cycles may come late, so nothing is counted exactly
    assert 50 <= count[0x151] <= 101  # every 10 ms
    assert 25 <= count[0x7A1] <= 51  # every 20 ms
    assert 20 < count[0x141] <= controls.frames  # the demands that it heard


def test_ctrl_c_ends_a_drive_with_its_summary(
    short: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    short.write_text(SHORT.replace("duration_s = 1.0", "duration_s = 60.0").replace("demand = -1.0", "demand = 0.0"))
    told = Told()
    monkeypatch.setattr(sys, "stderr", told)
    assert main(["drive", str(short), "-i", "virtual", "-c", "x"]) == 1
    assert told.seen
    out = capsys.readouterr().out
    assert "stopped early, of 60 s" in out
    assert "demand never came" in out


class Told(io.StringIO):
    """Standard error that presses Ctrl-C once it is told that no demand has come."""

    seen = False

    def write(self, text: str) -> int:
        if not self.seen and "no demand yet" in text:
            self.seen = True
            signal.raise_signal(signal.SIGINT)
        return super().write(text)


def test_control_ends_after_its_time_with_its_counts(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["control", "thresholds", "-i", "virtual", "-c", "control-command", "--for", "0.3"]) == 0
    said = capsys.readouterr()
    assert "DriverDemand, WheelSpeed_A1, BrakePressure_A1: has not come yet" in said.err
    assert "WheelSpeed_A1    never came" in said.out
