"""A stop at the mark on a real vcan: rig, daemon, controller and driver as processes; and what becomes of it when each
of them is killed on the way."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from sim_ecu.loop.control.braking_rate import RATES
from tests.support.can_ids import ADVICE
from tests.support.loop_processes import CONTROLLER, DAEMON, LoopProcesses, Told
from tests.support.processes import wait_for
from wrcd.config.config import packaged

LEVER = 0x133
SPEED_M_S, MARK_M = 11.0, 250.0
NEAR_M = 2.0
CAUTIOUS = "0.35 m/s²"
# From 11 m/s the cautious rate begins to brake after some six seconds, the dry rate after sixteen.
SCENARIO = """
title = "a stop at a mark from 11 m/s"
duration_s = 90
speed_m_s = 11
axles = [1, 2]
track = "erri-low"
mark_m = 250
stop_m_s = 0.02
rail = [{ curve = "CURVE" }]
driver = { demand = 0.0 }
actuators = { full_brake_N_m = 9476 }
"""


class MarkBench(LoopProcesses):
    """A daemon with [advice]; controller, driver and rig for each stop."""

    def __init__(self, folder: Path, cleanup: ExitStack) -> None:
        super().__init__(folder, cleanup)
        self.config = folder / "two.toml"
        self.config.write_text(packaged(2) + "[advice]\n")

    def begin(self, curve: str, driver: str = "wrcd") -> None:
        """Start all of them, the rig as the last: then the others are ready."""
        scenario = self.folder / f"mark-{curve}.toml"
        scenario.write_text(SCENARIO.replace("CURVE", curve))
        self.daemon, _ = self.start(DAEMON, f"wrcd run -i socketcan -c vcan0 --config {self.config}")
        self.controller, controls = self.start(CONTROLLER, f"sim-ecu control thresholds -c vcan0 --scenario {scenario}")
        self.driver, self.drives = self.start(
            CONTROLLER, f"sim-ecu driver {driver} -c vcan0 --scenario {scenario} --config {self.config}"
        )
        controls.wait_for("not heard yet", seconds=60)
        wait_for("the advice", 60, lambda: self.has(ADVICE))
        self.rig, self.told = self.drive(f"sim-ecu drive {scenario} -c vcan0 --driver bus")
        self.told.wait_for("on socketcan vcan0", seconds=60)

    def past_m(self) -> float:
        """Drive to the end: where the train stands."""
        status, summary, document = self.end(self.rig, self.told)
        print(self.drives.text)
        assert status == 0
        assert "stands" in summary, "it does not stand"
        return float(document["past_mark_m"])

    def halt(self) -> None:
        """End what still runs of a stop."""
        for process in (self.rig, self.driver, self.controller, self.daemon):
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.wait(20)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[MarkBench]:
    with ExitStack() as cleanup:
        made = MarkBench(tmp_path, cleanup)
        yield made
        made.halt()


@pytest.mark.parametrize("curve", ["C", "E"], ids=["wet", "greasy"])
def test_train_stands_at_the_mark(bench: MarkBench, curve: str) -> None:
    bench.begin(curve)
    past = bench.past_m()
    assert abs(past) <= NEAR_M
    planned = _planned(bench.drives)
    assert planned != RATES.cautious, "no advice was heard"
    assert RATES.least <= planned <= RATES.dry
    assert bench.has(LEVER)


def test_without_daemon_and_controller_the_cautious_rate_is_planned_with(bench: MarkBench) -> None:
    bench.begin("C")
    bench.drives.wait_for("coasts", seconds=20)
    bench.daemon.kill()
    bench.drives.wait_for("brakes for the mark", seconds=30)
    assert _planned(bench.drives) == RATES.cautious
    bench.controller.kill()
    bench.told.wait_for("demand silent", seconds=20)
    assert abs(bench.past_m()) <= NEAR_M


def test_train_brakes_at_the_cautious_rate_when_its_driver_is_killed(bench: MarkBench) -> None:
    bench.begin("C")
    bench.drives.wait_for("coasts", seconds=20)
    bench.driver.kill()
    bench.told.wait_for(f"driver's lever silent: brakes with {CAUTIOUS}", seconds=20)
    past = bench.past_m()
    assert -MARK_M < past <= NEAR_M
    assert past > SPEED_M_S**2 / 0.7 - MARK_M - 20.0, "it braked harder"


def test_driver_brakes_at_the_cautious_rate_when_the_train_is_silent(bench: MarkBench) -> None:
    bench.begin("C")
    bench.drives.wait_for("coasts", seconds=20)
    bench.rig.kill()
    bench.drives.wait_for(f"train silent: brakes with {CAUTIOUS}", seconds=20)


def _planned(told: Told) -> float:
    """What the driver planned with."""
    return float(told.text.rpartition("planned with ")[2].split()[0])
