"""The reference controllers on the loop's bus: silences, and what they are worth against an unprotected train."""

from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.make import make_controller
from sim_ecu.loop.lockstep import ride
from sim_ecu.loop.messages import BRAKE, TRACTION, Heard, rig_message
from sim_ecu.loop.rig import Step
from sim_ecu.loop.scenario import DriveScenario, load_drive_scenario
from sim_ecu.physics.actuators import Actuators, Drive
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import Channel, Sent
from sim_ecu.play.scenario import Course

LAWS = ["thresholds", "creep"]
FACTS = Facts.of_wheelset((1, 2), Wheelset(), Actuators())
SPEED = 20.0


class Bench:
    """A controller of two axles, whose inputs are said or not, for some cycles."""

    def __init__(self, law: str, mode: int) -> None:
        made = make_controller(law, FACTS)
        self.controller, self.mode, self._now_us = made, mode, 0
        names = ["DriverDemand", *(f"{m}_A{n}" for n in (1, 2) for m in ("WheelSpeed", "BrakePressure"))]
        self._inputs = {name: Channel(rig_message(name)) for name in names}

    def go(self, cycles: int, without: str = "") -> list[dict[str, float]]:
        """The demands of both axles in the last of some cycles, all inputs but one said."""
        demands: list[Sent] = []
        for _ in range(cycles):
            self._now_us += 10_000
            values = {"DriverDemand": {"Mode": self.mode, "Share": 0.5}}
            values |= {f"WheelSpeed_A{n}": {"WheelSpeed": SPEED} for n in (1, 2)}
            values |= {f"BrakePressure_A{n}": {"Pressure": 0.0} for n in (1, 2)}
            for name, channel in self._inputs.items():
                if name != without and self._now_us % channel.every_us == 0:
                    f = channel.encode(self._now_us, values[name])
                    self.controller.hear(f.can_id, f.data, f.due_us)
            demands = self.controller.tick(self._now_us)
        return [decoded(f) for f in demands]


def decoded(frame: Sent) -> dict[str, float]:
    """What a Demand frame says."""
    heard = Heard(next(m for m in (rig_message("Demand_A1"), rig_message("Demand_A2")) if m.frame_id == frame.can_id))
    assert heard.take(frame.data, frame.due_us)
    return heard.values


@pytest.mark.parametrize("law", ["none", *LAWS])
def test_driver_not_heard_yet_nothing_is_demanded(law: str) -> None:
    bench = Bench(law, BRAKE)
    assert bench.go(20, without="DriverDemand") == []
    assert len(bench.go(2)) == 2


@pytest.mark.parametrize("law", ["none", "thresholds"])
@pytest.mark.parametrize(("mode", "before", "after"), [(TRACTION, 12_500.0, 0.0), (BRAKE, -11_000.0, -11_000.0)])
def test_unknown_mode_is_as_if_no_frame_had_come(law: str, mode: int, before: float, after: float) -> None:
    bench = Bench(law, mode)
    assert [d["Torque"] for d in bench.go(50)] == [before] * 2
    bench.mode = 3
    assert [d["Torque"] for d in bench.go(5)] == [before] * 2
    assert [d["Torque"] for d in bench.go(15)] == [after] * 2


@pytest.mark.parametrize("law", ["none", "thresholds"])
@pytest.mark.parametrize(("mode", "before", "silent"), [(TRACTION, 12_500.0, 0.0), (BRAKE, -11_000.0, -11_000.0)])
def test_driver_silent_traction_ends_and_a_brake_stays(law: str, mode: int, before: float, silent: float) -> None:
    bench = Bench(law, mode)
    assert [d["Torque"] for d in bench.go(50)] == [before] * 2
    assert [d["Torque"] for d in bench.go(20, without="DriverDemand")] == [silent] * 2
    assert [d["Torque"] for d in bench.go(4)] == [before] * 2


@pytest.mark.parametrize(("mode", "silent"), [(TRACTION, 0.0), (BRAKE, -11_000.0)])
def test_wheel_silent_its_axle_pulls_no_more_and_brakes_as_asked(mode: int, silent: float) -> None:
    bench = Bench("creep", mode)
    heard = bench.go(50)[1]["Torque"]
    first, second = bench.go(20, without="WheelSpeed_A1")
    assert (first["Torque"], second["Torque"]) == (silent, heard)


def greasy(actuators: Actuators) -> DriveScenario:
    """A stop of the packaged scenario from 12 m/s, the demand after a second."""
    packaged = load_drive_scenario("brake-greasy")
    train = replace(packaged.train, speed=Course((0.0,), (12.0,)), duration_s=30.0)
    return replace(packaged, train=train, driver=Course((0.0, 1.0, 1.1), (-0.05, -0.05, -1.0)), actuators=actuators)


def steps_of(law: str, scenario: DriveScenario) -> list[Step]:
    return list(ride(scenario, make_controller(law, Facts.of(scenario)), None))


@pytest.fixture(scope="module")
def unprotected_stop() -> float:
    return steps_of("none", greasy(Actuators()))[-1].distance_m


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("max_brake", [25_000.0, 10_000.0, 0.0])
def test_greasy_stop_is_a_fifth_shorter_than_unprotected_and_no_wheel_locks(
    law: str, max_brake: float, unprotected_stop: float
) -> None:
    scenario = greasy(Actuators(Drive(max_brake_N_m=max_brake)))
    steps = steps_of(law, scenario)
    assert steps[-1].speed_m_s < scenario.stop_m_s
    assert steps[-1].distance_m < 0.8 * unprotected_stop
    assert all(s.wheel_m_s.min() > 0.5 * s.speed_m_s for s in steps)


@pytest.mark.parametrize("law", LAWS)
def test_start_on_leaf_film_gains_speed_without_spinning(law: str) -> None:
    packaged = load_drive_scenario("traction-leaf-patch")
    scenario = replace(
        packaged, train=replace(packaged.train, duration_s=7.0), driver=Course((0.0, 1.0, 1.5), (0.0, 0.0, 0.8))
    )
    bare, without = steps_of(law, scenario), steps_of("none", scenario)
    slip, spin = (max(float(s.slip_m_s.max()) for s in steps) for steps in (bare, without))
    assert slip < 0.2 * spin
    energy, wasted = (sum(float(s.slip_energy_J.sum()) for s in steps) for steps in (bare, without))
    assert energy < 0.1 * wasted
    assert bare[-1].speed_m_s > without[-1].speed_m_s - 1.0


def test_same_scenario_gives_the_same_frames_and_train() -> None:
    scenario = greasy(Actuators())
    scenario = replace(scenario, train=replace(scenario.train, duration_s=2.0))

    def once() -> tuple[list[bytes], float]:
        controller, frames = make_controller("creep", Facts.of(scenario)), []
        for step in ride(scenario, controller, None, frame=lambda _t, _i, data: frames.append(data)):
            last = step
        return frames, last.distance_m

    assert once() == once()


def test_four_axle_stop_locks_no_wheel() -> None:
    scenario = load_drive_scenario("four-axle-stop")
    scenario = replace(scenario, train=replace(scenario.train, duration_s=12.0))
    controller = make_controller("creep", Facts.of(scenario))
    slowest = [float(np.min(s.wheel_m_s / s.speed_m_s)) for s in ride(scenario, controller, None)]
    assert min(slowest) > 0.5
