"""Laws of slip control, guard and release on made-up inputs."""

import itertools

import pytest

from sim_ecu.loop.control import creep, resync, thresholds
from sim_ecu.loop.control.creep import CreepControl
from sim_ecu.loop.control.guard import APPLIED_S, MAX_WITHOUT_S, Guard
from sim_ecu.loop.control.law import Law, Seen
from sim_ecu.loop.control.resync import Resync
from sim_ecu.loop.control.thresholds import Phase, Thresholds

PERIOD_S, SPEED = 0.01, 20.0
FULL_N_m = 20_000.0
SLIDE = 2.0  # m/s: beyond every threshold


def seen(slip: float, slope: float = 0.0, asked: float = FULL_N_m, actual: float = FULL_N_m, t_s: float = 0.0) -> Seen:
    return Seen(PERIOD_S, round(t_s * 1e6), SPEED, slip, slope, asked, actual)


@pytest.mark.parametrize("law", [Thresholds(), CreepControl()])
def test_rolling_wheel_has_all_that_is_asked(law: Law) -> None:
    for asked in (0.0, 3000.0, FULL_N_m, 5000.0):
        assert law.step(seen(0.01, asked=asked, actual=asked)) == asked
    assert not law.sliding


@pytest.mark.parametrize("law", [Thresholds(), CreepControl()])
def test_sliding_wheel_has_less_and_never_more_than_asked(law: Law) -> None:
    torques = [law.step(seen(slip, 10.0, asked)) for slip, asked in ((SLIDE, FULL_N_m), (SLIDE, 9000.0), (SLIDE, 0.0))]
    assert torques[0] < 0.7 * FULL_N_m
    assert all(0.0 <= t <= asked for t, asked in zip(torques, (FULL_N_m, 9000.0, 0.0), strict=True))
    assert law.sliding
    law.reset()
    assert law.step(seen(0.0)) == FULL_N_m


def test_thresholds_cut_hold_and_reapply_below_the_torque_of_the_slide() -> None:
    c = thresholds.Constants()
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
    c = thresholds.Constants()
    law = Thresholds(c)
    law.step(seen(SLIDE, 10.0))
    law.step(seen(0.0, -2.0 * max(c.back_m_s2, c.hold_m_s2)))
    assert law.sliding


def test_thresholds_slip_between_the_thresholds_changes_nothing() -> None:
    c = thresholds.Constants()
    between = 0.5 * (1.0 + c.off_share) * max(c.on_m_s, c.on_share * SPEED)
    rolling, sliding = Thresholds(c), Thresholds(c)
    sliding.step(seen(SLIDE))
    rolling.step(seen(between))
    sliding.step(seen(between))
    assert not rolling.sliding
    assert sliding.sliding


def test_creep_settles_at_its_set_point_and_does_not_wind_up() -> None:
    """On a made-up contact: the creep grows with the torque's square, and the actuators follow at once."""
    c = creep.Constants()
    law, torque, creepage = CreepControl(c), FULL_N_m, []
    for _ in range(400):
        slip = SPEED * c.creep * (torque / 12_000.0) ** 2
        torque = law.step(seen(slip, actual=torque))
        creepage.append(slip / SPEED)
    assert creepage[-1] == pytest.approx(max(c.creep, c.min_slip_m_s / SPEED), rel=0.05)
    for _ in range(500):  # it wants more, and the actuators give no more than this
        most = law.step(seen(0.0, actual=5000.0))
    assert most <= 5000.0 + c.room_N_m


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
    c = resync.Constants()
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
    c = resync.Constants()
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
