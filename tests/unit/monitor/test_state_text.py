"""`wrcd dump --state`: the newest state of every axle, of a log and of a bus."""

import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from tests.support.daemon_frames import GOOD, DaemonFrames
from wrcd.bus.candump import format_line
from wrcd.cli.main import main
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.logs.story_records import Event
from wrcd.monitor.buffers import Batch
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.panels import AxleNow
from wrcd.monitor.sources import NoMore
from wrcd.monitor.state_text import listen, state_lines


class Played(NoMore):
    """A bus on which so many frames come at once, and then nothing."""

    def __init__(self, batches: list[tuple[Batch, int]]) -> None:
        super().__init__("vcan0")
        self._batches = batches

    def take(self) -> Iterator[tuple[Batch, int]]:
        while self._batches:
            yield self._batches.pop(0)


def test_state_of_a_log_has_a_line_for_each_axle_that_came(
    config: Config, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "ride.log"
    frames = DaemonFrames(config).stretch(0, 3_000_000, GOOD)
    log.write_text("".join(f"{format_line(f, 'can0')}\n" for f in frames))
    assert main(["dump", str(log), "--state"]) == 0
    bus, daemon, head, axle, hidden = capsys.readouterr().out.splitlines()
    assert bus.startswith(" LOG  ride.log")
    assert daemon == "daemon ● Running"
    assert head.split() == ["axle", "state", "available", "interval", "in", "use", "contact", "surface", "why"]
    assert axle.split() == ["1", "●", "Valid", "30.0", "%", "27.0…33.0", "10.0", "%", "Adhering", "Dry"]
    assert hidden.strip() == "3 more are configured, of which nothing came: hidden"


def test_state_of_a_bus_is_what_came_while_it_was_listened_to(config: Config) -> None:
    frames = DaemonFrames(config).stretch(0, 2_000_000, GOOD)
    model, source = BusModel(config), Played([(Batch.of_frames(frames), 0)])
    listen(model, source)
    assert not source._batches
    lines = list(state_lines(model, source.state(), 100, colour=True))
    assert len(lines) == 5
    assert "\033[1;32m● Valid" in lines[3]
    silent = BusModel(config)
    silent.take(Batch.of_frames(frames), frames[-1].stamp_us + 5_000_000)
    silent.update()
    assert "○ silent" in list(state_lines(silent, source.state(), 100, colour=False))[1]


def test_state_of_a_bus_of_python_can(config: Config, capsys: pytest.CaptureFixture[str]) -> None:
    """The command itself, while somebody sends."""
    sender, over = can.Bus(interface="virtual", channel="state-test"), threading.Event()
    frames = DaemonFrames(config).stretch(0, 100_000, GOOD)

    def send() -> None:
        while not over.is_set():
            for frame in frames:
                sender.send(can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=False))
            time.sleep(0.02)

    sending = threading.Thread(target=send)
    sending.start()
    try:
        assert main(["dump", "-i", "virtual", "-c", "state-test", "--state"]) == 0
    finally:
        over.set()
        sending.join()
        sender.shutdown()
    bus, daemon, head, axle, hidden = capsys.readouterr().out.splitlines()
    assert "virtual:state-test" in bus
    assert daemon.startswith("daemon ")
    assert head.split()[0] == "axle"
    assert axle.split()[0] == "1"
    assert "3 more are configured" in hidden


def test_state_of_a_damaged_log_ends_as_a_dump_of_it_does(tmp_path: Path) -> None:
    log = tmp_path / "cut.log"
    text = Path("tests/golden/leaf-film.log").read_text()
    log.write_text(text[: len(text) // 2] + "\nno frame\n" + text[len(text) // 2 :])
    assert main(["dump", str(log), "--state"]) == main(["dump", str(log)]) == 1


@pytest.mark.parametrize("also", [["-n", "3"], ["--axle", "1"], ["--message", "WrcdStatus"], ["--id", "91"]])
def test_state_is_of_all_frames(also: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dump", "tests/golden/leaf-film.log", "--state", *also]) == 2
    assert "--state: takes a log or a bus, and all of it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("available", "validity", "shown"),
    [(30.0, Validity.VALID, "over ±12"), (math.nan, Validity.VALID, "–"), (30.0, Validity.DEGRADED, "–")],
    ids=["too wide for a level", "a frame too old", "not Valid"],
)
def test_interval_that_no_level_states_is_named_where_the_estimate_counts(
    available: float, validity: Validity, shown: str
) -> None:
    event = Event(1, 0, 1_000_000, validity, Cause.NONE, "")
    now = AxleNow(1, event, available, math.nan, math.nan, 10.0, "", "", math.nan, 0)
    assert now.interval == shown
