"""The rig in real time, on a wire of the test's own and a clock that the test sets."""

import re

import pytest

from sim_ecu.loop.control.adhesion_consumer import Facts, Unprotected
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.drive_session import MAX_LATE_US, DriveResult, counts, document, summary
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.ride_figures import judge
from sim_ecu.play.play import MAX_SAMPLES
from tests.support.loop_wire import Wire, scenario
from wrcd.errors import Status

SILENT = "axle 1: demand silent for 30 ms"


@pytest.fixture
def wire() -> Wire:
    rides = scenario()
    return Wire(rides, Unprotected(rides.axles, rides.actuators))


def thresholds(rides: DriveScenario) -> Wire:
    return Wire(rides, make_controller("thresholds", Facts.of(rides)))


def ended(wire: Wire, status: Status = Status.STOPPED) -> list[str]:
    return summary(wire.drive._scenario, DriveResult(wire.drive.steps, counts(wire.drive), status))


def test_stop_has_the_figures_of_the_lockstep_run() -> None:
    rides = scenario(seconds=20.0)
    wire = thresholds(rides)
    wire.to_the_end()
    figures = judge(wire.drive.steps, rides)
    expected = judge(Lockstep(rides, make_controller("thresholds", Facts.of(rides)), None), rides)
    assert figures.stopped
    assert figures.stop_m == pytest.approx(expected.stop_m, rel=0.1)
    assert figures.slip_energy_kJ == pytest.approx(expected.slip_energy_kJ, rel=0.1)
    assert figures.max_slip_m_s == pytest.approx(expected.max_slip_m_s, rel=0.1)
    assert abs(figures.slides - expected.slides) <= 1


def test_controller_that_dies_leaves_the_driver_s_brake(wire: Wire) -> None:
    wire.turns(1.0)
    wire.turns(1.0, controller=False)
    before, after = wire.drive.steps[190], wire.drive.steps[390]
    assert before.pressure_bar[0] < 0.01  # the electric brake did it all
    assert after.pressure_bar[0] > 3.0
    assert after.speed_m_s < before.speed_m_s - 0.3
    assert wire.rig_lines.at_s(SILENT) == [pytest.approx(1.035, abs=0.011)]
    silence = wire.drive.silences.by_name["1"]
    assert silence.silences == 1
    assert silence.silent_us == pytest.approx(970_000, abs=15_000)


def test_demand_that_never_comes_is_told_so_and_is_no_silence() -> None:
    rides = scenario(seconds=1.0)
    wire = Wire(rides, Unprotected(rides.axles, rides.actuators))
    wire.to_the_end(controller=False)
    assert wire.rig_lines.at_s("axle 1: no demand yet")
    assert "demand never came" in "\n".join(ended(wire, Status.DONE))
    assert wire.drive.silences.by_name["1"].silences == 0


def test_short_silences_are_all_counted_and_told_once_a_second(wire: Wire) -> None:
    for _ in range(20):
        wire.turns(0.05)
        wire.turns(0.05, controller=False)
    silence = wire.drive.silences.by_name["1"]
    assert silence.silences == pytest.approx(20, abs=1)
    assert 1 <= len(wire.rig_lines.at_s(SILENT)) <= 2


def test_train_goes_on_while_the_bus_is_down_and_with_it_when_it_is_back(wire: Wire) -> None:
    wire.turns(0.5)
    wire.up = False
    wire.turns(1.0)
    wire.up = True
    wire.turns(0.5)
    steps = wire.drive.steps
    assert len(steps) == 400
    assert steps[300].speed_m_s < steps[100].speed_m_s
    assert wire.drive.tally.unsent > 500
    for lines in (wire.rig_lines, wire.lines):
        assert lines.at_s("bus down: nothing comes, nothing goes") == [pytest.approx(0.51, abs=0.011)]
        assert lines.at_s("bus again after 1.0 s") == [pytest.approx(1.51, abs=0.011)]
    assert wire.rig_lines.at_s("axle 1: demand again after 0.9")
    assert counts(wire.drive)["bus"] | {"down_s": 1.0} == {
        "downs": 1, "down_s": 1.0, "reopens": 0, "drops": 0, "foreign_frames": 0,
    }  # fmt: skip


def test_frame_of_a_clock_that_steps_is_no_older_than_the_last_look(wire: Wire) -> None:
    wire.turns(0.5)
    wire.clock.step_us = 3_600_000_000
    wire.turns(0.2)
    wire.clock.step_us = -3_600_000_000
    wire.turns(0.2)
    assert wire.drive.silences.by_name["1"].silences == 0


def test_rig_that_is_a_little_late_catches_up_and_counts_it(wire: Wire) -> None:
    wire.turns(0.5)
    wire.turns(0.015, rig=False)
    wire.turn()
    assert len(wire.drive.steps) == 104
    assert wire.drive.tally.overruns == 2
    assert wire.drive.tally.latest_us == 15_000
    assert wire.drive.waits == 0
    assert not any("too slow" in line for line in ended(wire))


def test_train_s_time_waits_for_a_computer_that_stood_still(wire: Wire) -> None:
    wire.turns(0.5)
    wire.turns(0.5, rig=False, controller=False)
    wire.turns(0.5)
    assert wire.drive.waits == 1
    assert wire.drive.waited_us == pytest.approx(500_000, abs=MAX_LATE_US)
    assert len(wire.drive.steps) == pytest.approx(200, abs=2)
    assert wire.drive.silences.by_name["1"].silences == 0
    assert wire.rig_lines.at_s("this computer was busy: the train's time waited for 5")
    assert re.search(r"computer  too slow, or busy: up to 0\.5\d s behind real time, 0\.5\d s in all", ended(wire)[-1])


def test_step_of_a_computer_that_never_catches_up_returns(wire: Wire) -> None:
    class Late:
        def __init__(self) -> None:
            self.us = 0

        def monotonic_ns(self) -> int:
            self.us += 10_000_000
            return self.us * 1000

        def time_ns(self) -> int:
            return self.us * 1000

    wire.drive.end._clock = Late()
    assert wire.drive.step()
    assert wire.drive.waits == MAX_SAMPLES


def test_run_ends_when_the_train_is_slow_or_its_time_is_over() -> None:
    over = scenario("stop_m_s = 11.5", seconds=3.0)
    wire = Wire(over, Unprotected(over.axles, over.actuators))
    wire.to_the_end()
    assert wire.drive.over
    assert wire.drive.steps[-1].speed_m_s < 11.5 <= wire.drive.steps[-2].speed_m_s
    assert ended(wire, Status.DONE)[1].endswith(" s: slower than 11.5 m/s")
    over = scenario(seconds=0.5)
    wire = Wire(over, Unprotected(over.axles, over.actuators))
    wire.to_the_end()
    assert len(wire.drive.steps) == 100
    assert ended(wire, Status.DONE)[1].endswith(" 0.5 s: the scenario is over")


def test_status_is_told_once_a_second(wire: Wire) -> None:
    wire.turns(1.5)
    wire.turns(1.0, controller=False)
    first, second = wire.rig_lines.states
    assert "m/s" in first
    assert "silent" not in first
    assert "demand silent: axle 1" in second


def test_document_holds_figures_and_counts(wire: Wire) -> None:
    wire.turns(1.0)
    of = document(scenario(), DriveResult(wire.drive.steps, counts(wire.drive), Status.STOPPED))
    assert of["over"] is False
    assert of["seconds"] == pytest.approx(1.0)
    assert of["figures"]["stop_m"] > 5.0
    assert of["demand"][1]["silences"] == 0
    assert of["frames"] == len(wire.rig_link.sent)
    assert document(scenario(), DriveResult([], counts(wire.drive), Status.STOPPED))["over"] is False
