"""How much of the past a window holds: it is dropped where rail or torque change."""

import numpy as np
import pytest

from tests.support.estimator_runs import EVERY, PER_S, RATIO, estimates, track
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.signals import measured
from tests.support.stepped import SteppedEstimator
from wrcd.core.design import Design, FloatArray, load_design


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(LONE_DESIGN)


def windows_s(e: SteppedEstimator, z: FloatArray, ratio: FloatArray | float = RATIO) -> FloatArray:
    """The windows' lengths of axle 1."""
    return np.array([float(x.window_s[0]) for x in estimates(e, z, ratio)])


def test_a_window_is_all_that_there_is_up_to_its_usual_length(design: Design) -> None:
    window = windows_s(SteppedEstimator(design, 1), track(8.0))
    t = EVERY * design.tick_s * np.arange(1, len(window) + 1)
    assert window.max() == pytest.approx(design.window_s)
    first = t <= design.window_s
    assert window[first] == pytest.approx(t[first])


def test_window_keeps_its_past_on_a_constant_rail(design: Design) -> None:
    window = windows_s(SteppedEstimator(design, 1), track(30.0, seed=3))
    assert np.mean(window[60:] >= design.window_s) > 0.98


@pytest.mark.parametrize("after", [0.10, 0.20])
def test_torque_step_drops_the_window_before_it(design: Design, after: float) -> None:
    at = 4 * PER_S
    ratio = np.where(np.arange(8 * PER_S) < at, RATIO, after)
    z = np.concatenate((track(8.0)[:at], track(8.0, torque_Nm=after / RATIO * 10_000.0)[at:]))
    window = windows_s(SteppedEstimator(design, 1), z, ratio)
    k = at // EVERY
    assert window[k - 20 : k].min() >= design.window_s
    found = k + int(np.argmax(window[k:] < 0.5))
    assert (found - k) * EVERY * design.tick_s <= 0.1
    # then it holds what came since, and the newest part that showed the change
    since = EVERY * design.tick_s * np.arange(1, len(window) - k + 1)
    assert np.all(window[found:] <= since[found - k :] + design.recent_s)
    assert window[k + round(1.5 / EVERY * PER_S)] == design.window_s


def test_rail_change_drops_the_window_before_it(design: Design) -> None:
    """Coming from a dry rail onto leaf film at the torque that this bears; sought on three tracks."""
    late = []
    for seed in range(3):
        dry, film = (measured(c, 1500.0, seconds=8.0, seed=seed + 10)[..., None] for c in ("A", "F"))
        z = np.concatenate((dry[: 4 * PER_S], film[4 * PER_S : 6 * PER_S]))
        window = windows_s(SteppedEstimator(design, 1), z, 0.0204)
        k = 4 * PER_S // EVERY
        dropped = np.flatnonzero(window[k:] < 0.6)
        late.append(dropped[0] * EVERY * design.tick_s if len(dropped) else np.inf)
    assert np.median(late) < 0.5
