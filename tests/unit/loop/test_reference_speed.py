"""The controller's ground speed on made-up inputs, and its error in slides of the rig."""

import numpy as np
import pytest

from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.make import make_controller
from sim_ecu.loop.control.reference_speed import GRADIENT_M_S2, MARGIN, ReferenceSpeed
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.control.training import training
from sim_ecu.loop.lockstep import ride
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.wheelset import Wheelset

PERIOD_S = 0.01
FOUR = Facts.of_wheelset((1, 2, 3, 4), Wheelset(), Actuators())
NO_FORCE = [0.0] * 4


def test_no_speed_before_a_wheel_was_heard() -> None:
    assert ReferenceSpeed(FOUR).step([], NO_FORCE, True, PERIOD_S) is None


@pytest.mark.parametrize(("braking", "expected"), [(True, 20.0), (False, 17.0)])
def test_braking_follows_the_fastest_wheel_and_traction_the_slowest(braking: bool, expected: float) -> None:
    reference = ReferenceSpeed(FOUR)
    assert reference.step([20.0, 19.0, 18.0, 17.0], NO_FORCE, braking, PERIOD_S) == expected


@pytest.mark.parametrize(("braking", "sign"), [(True, -1.0), (False, 1.0)])
def test_all_wheels_slide_reference_goes_on_by_the_force_at_the_rail_and_its_margin(braking: bool, sign: float) -> None:
    reference, force = ReferenceSpeed(FOUR), 10_000.0
    reference.step([20.0] * 4, NO_FORCE, braking, PERIOD_S)
    for k in range(100):
        speed = reference.step([20.0 + sign * 30.0 * k * PERIOD_S] * 4, [force] * 4, braking, PERIOD_S)
    assert speed == pytest.approx(20.0 + sign * (MARGIN * force / FOUR.mass_kg + GRADIENT_M_S2), abs=0.01)


def test_wheels_silent_reference_goes_on_and_stops_at_zero() -> None:
    reference = ReferenceSpeed(FOUR)
    reference.step([0.01] * 4, NO_FORCE, True, PERIOD_S)
    assert [reference.step([], [10_000.0] * 4, True, PERIOD_S) for _ in range(3)][-1] == 0.0


@pytest.mark.parametrize(("before", "left"), [(False, 26.0), (True, 14.0)])
def test_wheel_that_still_spins_or_slides_from_the_other_effort_is_not_believed(before: bool, left: float) -> None:
    reference = ReferenceSpeed(FOUR)
    for k in range(50):  # one axle tells the speed, the others leave it
        reference.step([20.0, *[20.0 + (left - 20.0) * k / 50] * 3], NO_FORCE, before, PERIOD_S)
    for k in range(50):
        speed = reference.step([left + (20.0 - left) * k / 50] * 4, NO_FORCE, not before, PERIOD_S)
    assert speed == pytest.approx(20.0, abs=0.3)


# seeds: a greasy rail, one axle; a wet one, four; traction on a low one
@pytest.mark.parametrize("seed", [11, 5, 12])
@pytest.mark.parametrize("law", ["thresholds", "creep"])
def test_reference_in_slides_stays_within_1_m_s_of_the_train(seed: int, law: str) -> None:
    t = training(seed)
    controller = make_controller(law, t.facts)
    assert isinstance(controller, SlipController)
    errors, slips = [], []
    for step in ride(t.scenario, controller, None):
        if controller.reference_m_s is not None and step.speed_m_s > 3.0:
            errors.append(controller.reference_m_s - step.speed_m_s)
            slips.append(np.abs(step.slip_m_s).max())
    sign = -1.0 if t.scenario.driver.values[-1] < 0.0 else 1.0
    errors = [sign * e for e in errors]  # positive: towards the sliding wheel
    assert max(slips) > 0.4  # there are slides
    assert min(errors) > -0.15
    assert max(errors) < 1.0
    assert float(np.mean(np.abs(errors))) < 0.5
