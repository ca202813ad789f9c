"""Laws of slip control, guard, release, blending and the reference speed on made-up inputs."""

import itertools

import numpy as np
import pytest

from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.controlled_axle import (
    APPLIED_S,
    MAX_WITHOUT_S,
    AxleCycle,
    Blending,
    Guard,
    Phase,
    Release,
    ThresholdConstants,
    Thresholds,
)
from sim_ecu.loop.control.reference_speed import GRADIENT_M_S2, MARGIN, ReferenceSpeed, Resync
from sim_ecu.loop.control.slip_controller import SlipController, make_controller
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.physics.actuators import Actuators, AxleActuators, Drive, Valve
from sim_ecu.physics.wheelset import Wheelset
from tests.support.stops import greasy_stop, leaf_stop, low_start

PERIOD_S, SPEED = 0.01, 20.0
FULL_N_m = 20_000.0
SLIDE = 2.0  # m/s: beyond every threshold


def seen(
    slip: float, slope: float = 0.0, asked: float = FULL_N_m, actual: float = FULL_N_m, t_s: float = 0.0
) -> AxleCycle:
    return AxleCycle(PERIOD_S, round(t_s * 1e6), SPEED, slip, slope, asked, actual)


def test_rolling_wheel_has_all_that_is_asked() -> None:
    law = Thresholds()
    for asked in (0.0, 3000.0, FULL_N_m, 5000.0):
        assert law.step(seen(0.01, asked=asked, actual=asked)) == asked
    assert not law.sliding


def test_sliding_wheel_has_less_and_never_more_than_asked() -> None:
    law = Thresholds()
    torques = [law.step(seen(slip, 10.0, asked)) for slip, asked in ((SLIDE, FULL_N_m), (SLIDE, 9000.0), (SLIDE, 0.0))]
    assert torques[0] < 0.7 * FULL_N_m
    assert all(0.0 <= t <= asked for t, asked in zip(torques, (FULL_N_m, 9000.0, 0.0), strict=True))
    assert law.sliding
    law.reset()
    assert law.step(seen(0.0)) == FULL_N_m


def test_thresholds_cut_hold_and_reapply_below_the_torque_of_the_slide() -> None:
    c = ThresholdConstants()
    law = Thresholds(c)
    cut = law.step(seen(SLIDE, 10.0, actual=12_000.0)), law.phase
    held = law.step(seen(SLIDE, -1.5 * max(c.hold_m_s2, c.back_m_s2), actual=4000.0)), law.phase
    began, phase = law.step(seen(0.0, 0.0, actual=4000.0)), law.phase
    assert (cut, held) == ((0.0, Phase.CUT), (4000.0, Phase.HOLD))
    assert phase is Phase.REAPPLY
    assert began == pytest.approx(c.reapply_share * 12_000.0)
    steps = [began, *(law.step(seen(0.0)) for _ in range(3))]
    rises = [b - a for a, b in itertools.pairwise(steps)]
    assert rises[0] == pytest.approx(c.rise_N_m_s * PERIOD_S)
    assert rises == sorted(rises)  # the faster the longer no slide comes


def test_thresholds_wheel_that_still_comes_back_is_not_reapplied() -> None:
    c = ThresholdConstants()
    law = Thresholds(c)
    law.step(seen(SLIDE, 10.0))
    law.step(seen(0.0, -2.0 * max(c.back_m_s2, c.hold_m_s2)))
    assert law.sliding


def test_thresholds_slip_between_the_thresholds_changes_nothing() -> None:
    c = ThresholdConstants()
    between = 0.5 * (1.0 + c.off_share) * max(c.on_m_s, c.on_share * SPEED)
    rolling, sliding = Thresholds(c), Thresholds(c)
    sliding.step(seen(SLIDE))
    rolling.step(seen(between))
    sliding.step(seen(between))
    assert not rolling.sliding
    assert sliding.sliding


def test_guard_ends_a_brake_kept_off_for_too_long() -> None:
    guard, cycles = Guard(), round((MAX_WITHOUT_S + APPLIED_S) * 2 / PERIOD_S)
    wheel = [0.002 * k for k in range(cycles)]  # a locked wheel that rolls up, slowly
    given = [guard.step(k * 10_000, v, 0.0, FULL_N_m, FULL_N_m) for k, v in enumerate(wheel)]
    assert given[: round(MAX_WITHOUT_S / PERIOD_S)] == [0.0] * round(MAX_WITHOUT_S / PERIOD_S)
    assert sum(t == FULL_N_m for t in given) == pytest.approx(2 * APPLIED_S / PERIOD_S, abs=3)
    assert guard.interventions == 2
    assert not guard.off


def test_guard_wheel_that_never_rolls_protection_is_off_after_two_interventions() -> None:
    guard, cycles = Guard(), round((MAX_WITHOUT_S + APPLIED_S) * 2 / PERIOD_S)
    given = [guard.step(k * 10_000, 0.0, 0.0, FULL_N_m, FULL_N_m) for k in range(3 * cycles)]
    assert given[cycles:] == [FULL_N_m] * (2 * cycles)
    assert (guard.interventions, guard.off) == (2, True)
    now_us = 3 * cycles * 10_000
    assert guard.step(now_us, 1.0, 0.0, FULL_N_m, FULL_N_m) == 0.0  # it rolls: protected again
    guard.off = True
    guard.reset()
    assert guard.step(now_us, 1.0, 0.0, FULL_N_m, FULL_N_m) == 0.0  # another effort


def test_guard_leaves_an_axle_that_brakes_or_is_not_asked_alone() -> None:
    guard = Guard()
    for k in range(1000):
        assert guard.step(k * 10_000, 9.0, 1000.0, FULL_N_m, FULL_N_m) == 1000.0
    for k in range(1000, 2000):
        assert guard.step(k * 10_000, 9.0, 0.0, 0.0, FULL_N_m) == 0.0
    assert guard.interventions == 0


def test_release_comes_in_turn_when_no_axle_proved_the_reference() -> None:
    c = Release()
    turns = Resync(2, c)
    released: list[int] = []
    for k in range(round(3 * (c.after_s + c.max_s) / PERIOD_S)):
        for axle in range(2):
            if turns.step(axle, k * 10_000, 9000.0, FULL_N_m, False, 0.0, False) < 9000.0 and axle not in released[-1:]:
                released.append(axle)
    assert released[:2] == [0, 1]
    assert turns.releases == len(released)


def test_axle_that_carries_all_that_is_asked_is_never_released() -> None:
    turns = Resync(1)
    assert all(turns.step(0, k * 10_000, FULL_N_m, FULL_N_m, False, 0.0, False) == FULL_N_m for k in range(2000))
    assert turns.releases == 0


def test_axle_that_carries_what_a_limit_leaves_has_proved_nothing_and_is_released_less_deep() -> None:
    c = Release()
    given: dict[bool, float] = {}
    for limited in (True, False):
        turns = Resync(1, c)
        given[limited] = min(turns.step(0, k * 10_000, 9000.0, FULL_N_m, False, 0.0, limited) for k in range(300))
    assert [given[True], given[False]] == pytest.approx([9000.0 * c.limited_share, 9000.0 * c.share])
    assert given[True] > given[False]


def test_axle_without_wheel_speed_passes_its_turn_on() -> None:
    turns = Resync(2)
    for k in range(2000):
        turns.skip(0)
        turns.step(1, k * 10_000, 9000.0, FULL_N_m, False, 0.0, False)
    assert turns.releases > 1


ELECTRIC, PNEUMATIC = Actuators(), Actuators(Drive(max_brake_N_m=0.0))
BLENDED = Actuators(Drive(max_brake_N_m=10_000.0))


def settled(actuators: Actuators, torque_N_m: float, share: float, braking: bool = True) -> tuple[float, float, float]:
    """(what the rig gives, what the blending thinks, share of the drive in it), after two seconds."""
    blending = Blending(Facts((1,), Wheelset(), actuators), 0.01)
    rig, given = AxleActuators(actuators, 0.005), 0.0
    for _ in range(200):
        drive, valve = blending.step(torque_N_m, share, braking, SPEED)
        brake = share if braking else 0.0
        for _ in range(2):
            given = rig.step(drive, valve, actuators.demand_bar(brake, SPEED), actuators.electric_N_m(brake, SPEED))
        blending.take(rig.pressure_bar)
    return abs(given), blending.actual_N_m, abs(rig.drive_N_m)


@pytest.mark.parametrize("actuators", [ELECTRIC, PNEUMATIC, BLENDED])
@pytest.mark.parametrize("torque", [22_000.0, 15_000.0, 6000.0, 0.0])
def test_brake_gives_the_wanted_torque(actuators: Actuators, torque: float) -> None:
    given, thought, _ = settled(actuators, torque, 1.0)
    assert given == pytest.approx(torque, abs=700.0)
    assert thought == pytest.approx(given, abs=50.0)


def test_traction_is_the_drives() -> None:
    assert settled(BLENDED, 18_000.0, 0.9, braking=False)[0] == pytest.approx(18_000.0, rel=0.01)


def test_drive_takes_the_reduced_torque_before_the_cylinder() -> None:
    given, _, drive = settled(BLENDED, 9000.0, 1.0)
    assert drive == pytest.approx(given, abs=700.0)


@pytest.mark.parametrize(
    ("bar", "wanted_N_m", "valve"),
    [(0.0, 22_000.0, Valve.FILL), (3.0, 6000.0, Valve.VENT), (3.0, 18_000.0, Valve.HOLD)],
)
def test_valve_fills_for_the_whole_brake_vents_what_is_too_full_and_holds_what_is_right(
    bar: float, wanted_N_m: float, valve: Valve
) -> None:
    blending = Blending(Facts((1,), Wheelset(), PNEUMATIC), 0.01)
    for _ in range(5):
        blending.take(bar)
        found = blending.step(wanted_N_m, 1.0, True, SPEED)
    assert found == (0.0, valve)


FOUR = Facts((1, 2, 3, 4), Wheelset(), Actuators())
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
    assert speed == pytest.approx(20.0 + sign * (MARGIN * force / FOUR.wheelset.M_v + GRADIENT_M_S2), abs=0.01)


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


@pytest.mark.parametrize(
    "scenario", [leaf_stop(), greasy_stop(axles=4), low_start()], ids=["leaf film", "four axles", "start"]
)
def test_reference_in_slides_stays_near_the_trains_speed(scenario: DriveScenario) -> None:
    controller = make_controller("thresholds", Facts.of(scenario))
    towards = 1.0 if scenario.driver.values[-1] > 0.0 else -1.0
    assert isinstance(controller, SlipController)
    errors, slips = [], []
    for step in Lockstep(scenario, controller, None):
        if controller.reference_m_s is not None and step.due_us < 9_000_000:
            errors.append((controller.reference_m_s - step.speed_m_s) * towards)
            slips.append(np.abs(step.slip_m_s).max())
    assert max(slips) > 0.4  # there are slides
    assert min(errors) > -0.15  # positive: towards the sliding wheel
    assert max(errors) < 0.4
    assert float(np.mean(np.abs(errors))) < 0.2
