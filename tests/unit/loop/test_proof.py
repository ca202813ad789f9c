"""A controller that starts, or hears again, while braking: a locked wheel is no standstill."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.make import make_controller
from sim_ecu.loop.control.protection_watch import ProtectionWatch
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.messages import BRAKE, rig_message
from sim_ecu.loop.rig import LOOP, Rig, Step
from sim_ecu.loop.scenario import DriveScenario, load_drive_scenario
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import Channel
from sim_ecu.play.scenario import Course

FACTS = Facts.of_wheelset((1, 2), Wheelset(), Actuators())


@pytest.fixture
def scenario() -> DriveScenario:
    """A full brake on greasy rail, from the first moment on."""
    packaged = load_drive_scenario("brake-greasy")
    train = replace(packaged.train, speed=Course((0.0,), (20.0,)), duration_s=30.0)
    return replace(packaged, train=train, driver=Course((0.0,), (-1.0,)))


def steps_of(
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


@pytest.mark.parametrize("law", ["thresholds", "creep"])
@pytest.mark.parametrize("away_s", [(0.0, 2.0), (1.0, 7.0)])
def test_locked_wheel_at_start_or_after_silence_rolls_again(
    scenario: DriveScenario, law: str, away_s: tuple[float, float]
) -> None:
    controller = make_controller(law, Facts.of(scenario))
    assert isinstance(controller, SlipController)
    steps = steps_of(scenario, controller, away_s, away_s[1] + 4.0)
    back = next(s for s in steps if s.due_us >= away_s[1] * 1e6)
    assert back.wheel_m_s[0] < 0.5
    assert back.speed_m_s > 10.0
    last = steps[-100:]
    assert all(s.wheel_m_s[0] > 0.7 * s.speed_m_s for s in last)
    assert controller.reference_m_s == pytest.approx(last[-1].speed_m_s, abs=0.5)
    assert controller.proof.proved


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
    assert [line for line in lines if "reference" in line] == [
        "axle 1: released to prove the reference speed", "axle 2: released to prove the reference speed",
        "reference speed proved",
    ]  # fmt: skip
    assert torques[-1] == [FACTS.full_brake_N_m] * 2
    assert watch.summary()[1] == "reference speed  lost 0 times, axles released 2 times to prove it"


def test_wheel_that_runs_as_the_train_can_proves_without_release() -> None:
    watch, torques, lines = watched((15.0, 15.0), 1.0)
    assert torques == [[FACTS.full_brake_N_m] * 2] * len(torques)
    assert lines == []
    assert watch.summary()[1] == "reference speed  lost 0 times, axles released 0 times to prove it"


def test_wheel_speed_stuck_at_zero_protection_goes_off_and_is_told() -> None:
    watch, torques, lines = watched((15.0, 0.0), 12.0)
    assert torques[-1][1] == FACTS.full_brake_N_m
    assert [line for line in lines if "axle 2" in line] == [
        "axle 2: guard: no brake for 3 s, applied for 0.5 s", "axle 2: guard: no brake for 3 s, applied for 0.5 s",
        "axle 2: protection off: its wheel speed never rose without brake",
    ]  # fmt: skip
    assert watch.summary()[0] == "guard acted      axle 2: 2 times"


def test_no_wheel_heard_drive_and_cylinder_brake_as_asked() -> None:
    controller = make_controller("thresholds", FACTS)
    driver = Channel(rig_message("DriverDemand"))
    frames = []
    for now_us in range(20_000, 200_000, 20_000):
        f = driver.encode(now_us, {"Mode": BRAKE, "Share": 1.0})
        controller.hear(f.can_id, f.data, now_us)
        frames = controller.tick(now_us)
    rig = Rig(load_drive_scenario("four-axle-stop"), [LOOP])
    heard = rig.demands[frames[0].can_id]
    assert heard.take(frames[0].data, frames[0].due_us)
    assert heard.values["Torque"] < -0.5 * FACTS.full_brake_N_m
