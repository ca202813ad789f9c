"""The reference controllers on the loop's bus: silences, locked wheels, and what they are worth."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.control_on_bus import ProtectionWatch
from sim_ecu.loop.control.slip_controller import NAMES, SlipController, make_controller
from sim_ecu.loop.drive_scenario import DriveScenario, load_drive_scenario
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.rig import LOOP, Rig, Step
from sim_ecu.loop.rig_messages import BRAKE, TRACTION, NewestFrame, rig_message
from sim_ecu.physics.actuators import Actuators, Drive
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import Channel, Sent
from sim_ecu.play.scenario import Course
from tests.support.stepped import pair_states
from tests.support.stops import low_stop
from wrcd.config.config import load_packaged
from wrcd.core.terms import PairState
from wrcd.resources import LONE

FACTS = Facts((1, 2), Wheelset(), Actuators())
SPEED = 20.0


class Bench:
    """A controller of two axles, whose inputs are said or not, for some cycles."""

    def __init__(self, law: str, mode: int) -> None:
        made = make_controller(law, FACTS)
        self.controller, self.mode, self._now_us = made, mode, 0
        names = ["DriverDemand", *(f"{m}_A{n}" for n in (1, 2) for m in ("WheelSpeed", "BrakePressure"))]
        self._inputs = {name: Channel(rig_message(name)) for name in names}

    def go(self, cycles: int, without: str = "") -> list[dict[str, float]]:
        """The demands of both axles in the last of some cycles; without: how the inputs that are not said begin."""
        demands: list[Sent] = []
        for _ in range(cycles):
            self._now_us += 10_000
            values = {"DriverDemand": {"Mode": self.mode, "Share": 0.5}}
            values |= {f"WheelSpeed_A{n}": {"WheelSpeed": SPEED} for n in (1, 2)}
            values |= {f"BrakePressure_A{n}": {"Pressure": 0.0} for n in (1, 2)}
            for name, channel in self._inputs.items():
                if not (without and name.startswith(without)) and self._now_us % channel.every_us == 0:
                    f = channel.encode(self._now_us, values[name])
                    self.controller.hear(f.can_id, f.data, f.due_us)
            demands = self.controller.tick(self._now_us)
        return [decoded(f) for f in demands]


def decoded(frame: Sent) -> dict[str, float]:
    """What a Demand frame says."""
    axle = 1 + (frame.can_id != rig_message("Demand_A1").frame_id)
    heard = NewestFrame(rig_message(f"Demand_A{axle}"))
    assert heard.take(frame.data, frame.due_us)
    return heard.values


@pytest.mark.parametrize("law", NAMES)
def test_driver_not_heard_yet_nothing_is_demanded(law: str) -> None:
    bench = Bench(law, BRAKE)
    assert bench.go(20, without="DriverDemand") == []
    assert len(bench.go(2)) == 2


@pytest.mark.parametrize("law", ["none", "thresholds"])
@pytest.mark.parametrize(("mode", "before", "silent"), [(TRACTION, 12_500.0, 0.0), (BRAKE, -11_000.0, -11_000.0)])
def test_driver_silent_or_of_unknown_mode_ends_traction_and_a_brake_stays(
    law: str, mode: int, before: float, silent: float
) -> None:
    bench = Bench(law, mode)
    for unknown in (False, True):
        assert [d["Torque"] for d in bench.go(50)] == [before] * 2
        bench.mode, without = (3, "") if unknown else (mode, "DriverDemand")
        assert [d["Torque"] for d in bench.go(5, without)] == [before] * 2
        assert [d["Torque"] for d in bench.go(15, without)] == [silent] * 2
        bench.mode = mode
        assert [d["Torque"] for d in bench.go(4)] == [before] * 2


@pytest.mark.parametrize(("mode", "silent"), [(TRACTION, 0.0), (BRAKE, -11_000.0)])
def test_wheel_silent_its_axle_pulls_no_more_and_brakes_as_asked(mode: int, silent: float) -> None:
    bench = Bench("thresholds", mode)
    heard = bench.go(50)[1]["Torque"]
    first, second = bench.go(20, without="WheelSpeed_A1")
    assert (first["Torque"], second["Torque"]) == (silent, heard)


def greasy(actuators: Actuators) -> DriveScenario:
    """A stop of the packaged scenario from 12 m/s, the demand after a second."""
    packaged = load_drive_scenario("emergency-greasy")
    train = replace(packaged.train, speed=Course((0.0,), (12.0,)), duration_s=30.0)
    return replace(packaged, train=train, driver=Course((0.0, 1.0, 1.1), (-0.05, -0.05, -1.0)), actuators=actuators)


def steps_of(law: str, scenario: DriveScenario) -> list[Step]:
    return list(Lockstep(scenario, make_controller(law, Facts.of(scenario)), None))


@pytest.fixture(scope="module")
def unprotected_stop() -> float:
    return steps_of("none", greasy(Actuators()))[-1].distance_m


@pytest.mark.parametrize("max_brake", [25_000.0, 10_000.0, 0.0])
def test_greasy_stop_is_a_fifth_shorter_than_unprotected_and_no_wheel_locks(
    max_brake: float, unprotected_stop: float
) -> None:
    scenario = greasy(Actuators(Drive(max_brake_N_m=max_brake)))
    steps = steps_of("thresholds", scenario)
    assert steps[-1].speed_m_s < scenario.stop_m_s
    assert steps[-1].distance_m < 0.8 * unprotected_stop
    assert all(s.wheel_m_s.min() > 0.5 * s.speed_m_s for s in steps)


def test_start_on_leaf_film_gains_speed_without_spinning() -> None:
    packaged = load_drive_scenario("traction-leaf-patch")
    scenario = replace(
        packaged, train=replace(packaged.train, duration_s=7.0), driver=Course((0.0, 1.0, 1.5), (0.0, 0.0, 0.8))
    )
    bare, without = steps_of("thresholds", scenario), steps_of("none", scenario)
    slip, spin = (max(float(s.slip_m_s.max()) for s in steps) for steps in (bare, without))
    assert slip < 0.2 * spin
    energy, wasted = (sum(float(s.slip_energy_J.sum()) for s in steps) for steps in (bare, without))
    assert energy < 0.1 * wasted
    assert bare[-1].speed_m_s > without[-1].speed_m_s - 1.0


@pytest.fixture
def scenario() -> DriveScenario:
    """A full brake on greasy rail, from the first moment on."""
    packaged = load_drive_scenario("emergency-greasy")
    train = replace(packaged.train, speed=Course((0.0,), (20.0,)), duration_s=30.0)
    return replace(packaged, train=train, driver=Course((0.0,), (-1.0,)))


def steps_away(
    scenario: DriveScenario, controller: SlipController, away_s: tuple[float, float], end_s: float
) -> list[Step]:
    """A rig on a bus that the controller is not on from … to."""
    rig, steps = Rig(scenario, [LOOP]), []
    while rig.time_us < end_s * 1e6:
        step = rig.step()
        steps.append(step)
        if away_s[0] <= step.due_us * 1e-6 < away_s[1]:
            continue
        for f in step.frames:
            controller.hear(f.can_id, f.data, f.due_us)
        if step.due_us % 10_000 == 0:
            for f in controller.tick(step.due_us):
                rig.hear(f.can_id, f.data, step.due_us)
    return steps


@pytest.mark.parametrize("away_s", [(1.0, 7.0), (0.0, 2.0)])
def test_locked_wheel_at_start_or_after_silence_rolls_again(
    scenario: DriveScenario, away_s: tuple[float, float]
) -> None:
    controller = make_controller("thresholds", Facts.of(scenario))
    assert isinstance(controller, SlipController)
    steps = steps_away(scenario, controller, away_s, away_s[1] + 4.0)
    back = next(s for s in steps if s.due_us >= away_s[1] * 1e6)
    assert back.wheel_m_s[0] < 0.5
    assert back.speed_m_s > 10.0
    last = steps[-100:]
    assert all(s.wheel_m_s[0] > 0.7 * s.speed_m_s for s in last)
    assert controller.reference_m_s == pytest.approx(last[-1].speed_m_s, abs=0.5)
    assert controller.proof.proved


def test_sound_pair_of_a_slow_stop_on_low_rail_is_not_called_reversed() -> None:
    """Below 10 m/s it goes together no more than it goes against each other."""
    low, daemon = low_stop(), load_packaged(1, design=LONE)
    run = Lockstep(low, make_controller("thresholds", Facts.of(low), daemon), daemon)
    assert run.core is not None
    states = {PairState(pair_states(run.core.estimator)[0]) for _ in run}
    assert PairState.REVERSED not in states


def watched(speeds: Sequence[float], seconds: float) -> tuple[ProtectionWatch, list[list[float]], list[str]]:
    """A controller that starts while the brake is on and hears such wheels: what tells of it, demands, lines."""
    controller = make_controller("thresholds", FACTS)
    assert isinstance(controller, SlipController)
    watch, lines, torques = ProtectionWatch(controller), list[str](), list[list[float]]()
    driver, wheels = Channel(rig_message("DriverDemand")), [Channel(rig_message(f"WheelSpeed_A{n}")) for n in (1, 2)]
    for now_us in range(20_000, round(seconds * 1e6), 10_000):
        frames = [w.encode(now_us, {"WheelSpeed": v}) for w, v in zip(wheels, speeds, strict=True)]
        if now_us % driver.every_us == 0:
            frames.append(driver.encode(now_us, {"Mode": BRAKE, "Share": 1.0}))
        for f in frames:
            controller.hear(f.can_id, f.data, now_us)
        controller.tick(now_us)
        torques.append([a.given_N_m for a in controller.axles])
        lines += watch.look(now_us)
    return watch, torques, lines


def test_train_that_stands_each_axle_is_released_once_in_turn() -> None:
    watch, torques, lines = watched((0.0, 0.0), 5.0)
    assert all(max(t) == FACTS.full_brake_N_m for t in torques)  # never both
    assert [line.partition(":")[0] for line in lines if "released" in line] == ["axle 1", "axle 2"]
    assert [line for line in lines if "proved" in line] == lines[-1:]
    assert torques[-1] == [FACTS.full_brake_N_m] * 2
    assert "released 2 times" in watch.summary()[1]


def test_wheel_that_runs_as_the_train_can_proves_without_release() -> None:
    watch, torques, lines = watched((15.0, 15.0), 1.0)
    assert torques == [[FACTS.full_brake_N_m] * 2] * len(torques)
    assert lines == []
    assert "released 0 times" in watch.summary()[1]


def test_wheel_speed_stuck_at_zero_protection_goes_off_and_is_told() -> None:
    watch, torques, lines = watched((15.0, 0.0), 12.0)
    assert torques[-1][1] == FACTS.full_brake_N_m
    mine = [line.split(": ")[1] for line in lines if line.startswith("axle 2")]
    assert mine == ["guard", "guard", "protection off"]
    assert watch.summary()[0].endswith("axle 2: 2 times")


def test_no_wheel_heard_drive_and_cylinder_brake_as_asked() -> None:
    bench = Bench("thresholds", BRAKE)
    first, _ = bench.go(20, without="WheelSpeed")
    assert first["Torque"] == -0.5 * FACTS.full_brake_N_m
