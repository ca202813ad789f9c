import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrcd import resources
from wrcd.estimator.design import Design, Sets, load_design
from wrcd.estimator.estimator import Estimator, Tick
from wrcd.estimator.fuzzy import Fuzzy
from wrcd.estimator.window import Window


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(resources.DESIGN)


def tick(k: int, z: np.ndarray, ratio: float = 0.1, speed: float = 25.0) -> Tick:
    n = z.shape[1]
    return Tick(k, z, np.isfinite(z), np.full(n, ratio), speed)


def test_a_window_is_the_rms_without_the_mean() -> None:
    rng = np.random.default_rng(1)
    w = rng.standard_normal((300, 4, 2, 1)) + 7.0
    window = Window(200, 40, 1)
    for k in range(300):
        window.put(1000 + k, w[k], np.array([True]), np.array([0.01 * k]))
    expected = np.sqrt(w[100:].var(axis=0).mean(axis=1))[:, 0]
    assert window.residuals()[0] == pytest.approx(expected)
    assert window.torque_ratio()[0] == pytest.approx(0.01 * np.arange(100, 300).mean())
    assert window.recent_torque_ratio()[0] == pytest.approx(0.01 * np.arange(260, 300).mean())


def test_ticks_without_data_stay_out() -> None:
    rng = np.random.default_rng(2)
    w = rng.standard_normal((200, 4, 2, 1))
    good = rng.random(200) > 0.4
    window = Window(200, 40, 1)
    for k in range(200):
        window.put(k, w[k], np.array([good[k]]), np.array([0.2]))
    assert window.residuals()[0] == pytest.approx(np.sqrt(w[good].var(axis=0).mean(axis=1))[:, 0])


def test_an_empty_window_knows_nothing() -> None:
    window = Window(200, 40, 2)
    window.put(0, np.ones((4, 2, 2)), np.array([True, True]), np.array([0.1, 0.1]))
    window.reset(0)
    assert np.isnan(window.residuals()[0]).all()
    assert np.isnan(window.torque_ratio()[0])
    assert np.isfinite(window.residuals()[1]).all()


@given(st.floats(-10, 10), st.lists(st.floats(0.01, 3), min_size=1, max_size=6))
def test_the_sets_of_an_input_add_up_to_one(x: float, gaps: list[float]) -> None:
    centres = np.cumsum([0.0, *gaps])
    degrees = Sets(tuple(map(str, centres)), centres).memberships(np.array([x]))
    assert degrees.sum() == pytest.approx(1.0)
    assert (degrees >= 0).all()


def test_where_no_rule_speaks_the_answer_is_unknown(design: Design) -> None:
    every = (*design.residual_sets, design.torque_sets)
    corners = np.array(np.meshgrid(*[[s.centres[0], s.centres[-1]] for s in every]))
    inference = Fuzzy(design).infer(corners.reshape(5, -1).T)
    silent = inference.firing < 0.05
    assert silent.any()
    assert np.isnan(inference.output[silent]).all()
    assert (inference.rule[silent] == 0).all()
    assert ((inference.output[~silent] >= 0) & (inference.output[~silent] <= 100)).all()


def noise(ticks: int, axles: int) -> np.ndarray:
    return 0.01 * np.random.default_rng(3).standard_normal((ticks, 2, axles))


def test_axles_do_not_disturb_each_other(design: Design) -> None:
    z = noise(400, 3)
    together, alone = Estimator(design, 3), Estimator(design, 1)
    for k in range(400):
        together.step(tick(k, z[k]))
        alone.step(tick(k, z[k][:, 1:2]))
        if k == 250:
            together.reset(0)
    assert together.estimate().residuals[1] == pytest.approx(alone.estimate().residuals[0], rel=1e-12)
    assert together.estimate().residuals[0] != pytest.approx(alone.estimate().residuals[0])


def test_a_reset_axle_is_as_good_as_new(design: Design) -> None:
    z = noise(600, 1)
    used, fresh = Estimator(design, 1), Estimator(design, 1)
    for k in range(300):
        used.step(tick(k, z[k]))
    used.reset(0)
    for k in range(300, 600):
        used.step(tick(k, z[k]))
        fresh.step(tick(k, z[k]))
    assert np.array_equal(used.estimate().residuals, fresh.estimate().residuals)


@pytest.mark.parametrize("speed", [3.0, 3.04, 25.05, 59.99, 60.0, 80.0])
def test_every_speed_has_gains(design: Design, speed: float) -> None:
    estimator = Estimator(design, 1)
    for k, z in enumerate(noise(2000, 1)):
        e = estimator.step(tick(k, z, speed=speed))
        assert np.isfinite(e).all()
    assert np.abs(e).max() < 10.0
