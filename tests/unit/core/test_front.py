"""How far the train has come, and which of its axles run behind which: the tick's side of fusion."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wrcd.core.front import Front
from wrcd.core.inputs import TickInputs

X_M = (0.0, -2.5, -19.0)
TICK_S = 0.005
TICK = TickInputs(20.0, False, [], None, [], (), ())


@pytest.fixture
def front() -> Front:
    """Of a train that has come 10 m."""
    f = Front(X_M, TICK_S)
    move(f, TICK, 100)
    return f


def move(front: Front, tick: TickInputs, ticks: int, reverse: bool = False) -> None:
    for _ in range(ticks):
        front.move(tick, reverse)


def test_way_is_the_integral_of_the_speed(front: Front) -> None:
    view = front.view()
    assert view.way_m == pytest.approx(10.0)
    assert (view.speed_m_s, view.x_m.tolist()) == (20.0, list(X_M))
    move(front, replace(TICK, speed_m_s=0.0), 500)
    assert front.view().way_m == pytest.approx(10.0)


def test_reverse_turns_the_train_round_and_forgets_places(front: Front) -> None:
    before = front.view()
    move(front, TICK, 1, reverse=True)
    view = front.view()
    assert view.epoch == before.epoch + 1
    assert view.x_m.tolist() == [-x for x in X_M]
    assert view.way_m == pytest.approx(0.1)


@pytest.mark.parametrize("speed_m_s", [math.nan, -1.0])
def test_unknown_speed_and_one_backwards_give_no_way(front: Front, speed_m_s: float) -> None:
    before = front.view()
    move(front, replace(TICK, speed_m_s=speed_m_s), 3)
    view = front.view()
    assert math.isnan(view.way_m)
    assert view.epoch == before.epoch + 1


def test_speed_a_little_below_zero_at_a_standstill_is_none(front: Front) -> None:
    before = front.view()
    move(front, replace(TICK, speed_m_s=-0.02), 3)
    assert front.view()[:2] == (before.epoch, before.way_m)


def test_speed_that_jumps_forgets_places(front: Front) -> None:
    before = front.view()
    move(front, replace(TICK, speed_jumped=True), 1)
    view = front.view()
    assert view.epoch == before.epoch + 1
    assert view.way_m == pytest.approx(0.1)


def test_one_silent_axle_stops_no_way_but_all_of_them_do(front: Front) -> None:
    before = front.view()
    move(front, replace(TICK, unavailable=(1,)), 1)
    assert front.view().epoch == before.epoch
    move(front, replace(TICK, unavailable=(0, 1, 2)), 1)
    assert math.isnan(front.view().way_m)


def test_axle_that_breaks_is_told_once_and_another_restart_not_at_all(front: Front) -> None:
    front.reset(1, lost=True)
    front.reset(2, lost=False)
    assert front.view().lost.tolist() == [False, True, False]
    assert not np.any(front.view().lost)


def test_step_of_time_forgets_places_and_what_broke(front: Front) -> None:
    before = front.view()
    front.reset(1, lost=True)
    front.clear()
    view = front.view()
    assert (view.epoch, view.way_m) == (before.epoch + 1, 0.0)
    assert not view.lost.any()
