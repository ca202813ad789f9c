"""How far the train has come, and which of its axles run behind which: the tick's side of fusion."""

import math
from dataclasses import replace
from typing import Any

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


@pytest.mark.parametrize(
    ("changed", "epochs", "way_m"),
    [
        ({"speed_m_s": math.nan}, 1, math.nan),
        ({"speed_m_s": -1.0}, 1, math.nan),
        ({"speed_m_s": -0.02}, 0, 10.0),  # at a standstill
        ({"speed_jumped": True}, 3, 0.1),
        ({"unavailable": (1,)}, 0, 10.3),
        ({"unavailable": (0, 1, 2)}, 1, math.nan),
        ({"reverse": True}, 1, 0.3),
    ],
    ids=str,
)
def test_what_breaks_the_way_forgets_places(front: Front, changed: dict[str, Any], epochs: int, way_m: float) -> None:
    before = front.view()
    reverse = changed.pop("reverse", False)
    move(front, replace(TICK, **changed), 3, reverse)
    view = front.view()
    assert view.epoch - before.epoch == epochs
    assert view.way_m == pytest.approx(way_m, nan_ok=True)
    assert view.x_m.tolist() == [-x if reverse else x for x in X_M]


def test_axle_that_breaks_is_told_once_and_another_restart_not_at_all(front: Front) -> None:
    front.reset(1, lost=True)
    front.reset(2, lost=False)
    for _ in range(2):  # looking changes nothing
        assert front.view().lost.tolist() == [False, True, False]
    front.forget_news()
    assert not np.any(front.view().lost)


def test_step_of_time_forgets_places_and_what_broke(front: Front) -> None:
    before = front.view()
    front.reset(1, lost=True)
    front.clear()
    view = front.view()
    assert (view.epoch, view.way_m) == (before.epoch + 1, 0.0)
    assert not view.lost.any()
