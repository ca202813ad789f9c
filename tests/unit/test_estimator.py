import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrcd import resources
from wrcd.estimator.bank import at_speed
from wrcd.estimator.design import Design, Sets, load_design
from wrcd.estimator.estimator import Estimator, Tick, rule_inputs
from wrcd.estimator.fuzzy import Fuzzy
from wrcd.estimator.offset import Offset
from wrcd.estimator.window import Window


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(resources.DESIGN)


def tick(k: int, z: np.ndarray, ratio: float = 0.1, speed: float = 25.0) -> Tick:
    n = z.shape[1]
    return Tick(k, z, np.isfinite(z), np.full(n, ratio), speed)


def detrended_rms(w: np.ndarray, t: np.ndarray) -> np.ndarray:
    """(4,) for w (ticks, 4, 2) at ticks t: by numpy's own line fit."""
    flat = w.reshape(len(w), -1)
    line = np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, flat, 1)).T
    return np.asarray(np.sqrt(np.square(flat - line).mean(axis=0).reshape(4, 2).mean(axis=1)))


def test_a_window_is_the_rms_without_mean_and_trend() -> None:
    rng = np.random.default_rng(1)
    w = rng.standard_normal((300, 4, 2, 1)) + 7.0 + 0.02 * np.arange(300)[:, None, None, None]
    window = Window(200, 40, 1)
    for k in range(300):
        window.put(1000 + k, w[k], np.array([True]), np.array([0.01 * k]))
    assert window.residuals()[0] == pytest.approx(detrended_rms(w[100:, ..., 0], np.arange(200)))
    assert window.recent_residuals()[0] == pytest.approx(detrended_rms(w[260:, ..., 0], np.arange(40)))
    assert window.torque_ratio()[0] == pytest.approx(0.01 * np.arange(100, 300).mean())
    assert window.recent_torque_ratio()[0] == pytest.approx(0.01 * np.arange(260, 300).mean())


def test_ticks_without_data_stay_out() -> None:
    rng = np.random.default_rng(2)
    w = rng.standard_normal((200, 4, 2, 1))
    good = rng.random(200) > 0.4
    window = Window(200, 40, 1)
    for k in range(200):
        window.put(k, w[k], np.array([good[k]]), np.array([0.2]))
    assert window.residuals()[0] == pytest.approx(detrended_rms(w[good, ..., 0], np.flatnonzero(good)))
    assert window.share()[0] == pytest.approx((good.sum() - 40) / 160)


def test_a_window_forgets_the_rail_before() -> None:
    rng = np.random.default_rng(7)
    window = Window(200, 40, 2)
    limits = np.full(4, 0.3)
    forgot = []
    for k in range(400):
        w = rng.standard_normal((4, 2, 2))
        w[:, :, 1] *= 1.0 if k < 300 else 10.0  # the second axle comes onto another rail
        window.put(k, w, np.array([True, True]), np.array([0.1, 0.1]))
        forgot.append(window.forget_old(limits))
        if k == 345:
            assert window.share()[0] == 1.0
            assert window.share()[1] < 0.2
            assert window.residuals()[1] == pytest.approx(10.0, rel=0.3)
    found = np.array(forgot)
    assert not found[:, 0].any()
    assert not found[:300, 1].any()
    assert found[300:320, 1].any()


def test_too_little_data_is_no_change() -> None:
    window = Window(200, 40, 1)
    for k in range(200):
        window.put(k, np.full((4, 2, 1), float(k % 2)), np.array([k < 60 or k >= 181]), np.array([0.1]))
    assert np.isnan(window.differences()).all()
    assert not window.forget_old(np.full(4, 1e-6)).any()


def test_a_bias_is_as_good_as_none_from_the_first_window_on(design: Design) -> None:
    z = noise(240, 1)
    bias = np.array([[0.0087], [0.5]])  # half a degree per second, 50 mg
    plain, biased = Estimator(design, 1), Estimator(design, 1)
    for k in range(240):
        plain.step(tick(k, z[k]))
        biased.step(tick(k, z[k] + bias))
    assert biased.estimate().residuals == pytest.approx(plain.estimate().residuals, rel=1e-6)


def test_a_channel_that_is_missing_teaches_no_offset() -> None:
    offset = Offset(100, 1)
    both, one = np.array([[True], [True]]), np.array([[True], [False]])
    for k in range(50):
        rest = offset.take(np.array([[2.0], [5.0 if k % 2 else 1e9]]), both if k % 2 else one)
    assert rest == pytest.approx(np.zeros((2, 1)))
    offset.reset(0)
    assert offset.take(np.array([[7.0], [7.0]]), both) == pytest.approx(np.zeros((2, 1)))


def test_the_sensors_own_share_is_taken_off(design: Design) -> None:
    """Twice the track, twice the residuals above the noise: only the input that says how rough the track is moves."""
    noise = at_speed(design.noise, design.speeds_m_s, 25.0)
    track = np.array([[3.0, 2.0, 4.0, 1.0]]) * noise
    inputs = [rule_inputs(design, np.sqrt(noise**2 + (s * track) ** 2), np.array([0.1]), 25.0)[0] for s in (1.0, 2.0)]
    assert inputs[1][[0, 1, 2, 4, 5]] == pytest.approx(inputs[0][[0, 1, 2, 4, 5]])
    assert inputs[1][3] - inputs[0][3] == pytest.approx(np.log10(2.0))


def test_rules_are_local_lines(design: Design) -> None:
    """In the middle of its sets one rule speaks alone, and says its base; a little away, its slopes count."""
    rule = int(np.argmax((design.bases > 5) & (design.bases < 95)))
    middle = np.array([s.centres[k] for s, k in zip(design.sets, design.rules[rule], strict=True)])
    found = Fuzzy(design).infer(middle[None, :])
    assert found.rule[0] == rule + 1
    assert found.rule_share[0] == pytest.approx(1.0)
    assert found.output[0] == pytest.approx(np.clip(design.bases[rule], 0, 100))
    assert found.spread[0] == pytest.approx(np.clip(design.spreads[rule], 10**-2.7, 10**0.3))
    # beyond the outermost set nothing moves any more
    beyond = middle + np.where(middle == [s.centres[0] for s in design.sets], -1.0, 0.0)
    assert Fuzzy(design).infer(beyond[None, :]).output[0] == pytest.approx(found.output[0])


def test_between_sets_the_rules_lines_are_mixed(design: Design) -> None:
    rng = np.random.default_rng(11)
    low, high = (np.array([s.centres[i] for s in design.sets]) for i in (0, -1))
    x = rng.uniform(low, high, (200, 6))
    found = Fuzzy(design).infer(x)
    for i in np.flatnonzero(np.isfinite(found.output))[:50]:
        weights = np.ones(len(design.rules))
        for j, s in enumerate(design.sets):
            degrees = [np.interp(x[i, j], s.centres, row) for row in np.eye(len(s.centres))]
            weights *= np.array(degrees)[design.rules[:, j]]
        middles = np.column_stack([s.centres[design.rules[:, j]] for j, s in enumerate(design.sets)])
        says = design.bases + np.sum(design.slopes * (x[i] - middles), axis=1)
        assert found.output[i] == pytest.approx(np.clip(np.sum(weights * says) / weights.sum(), 0, 100), abs=1e-6)


def test_an_empty_window_knows_nothing() -> None:
    window = Window(200, 40, 2)
    for k in range(20):
        assert np.isnan(window.residuals()).all()  # a line through one or two points leaves nothing: no perfect fit
        window.put(k, np.full((4, 2, 2), k % 2), np.array([True, True]), np.array([0.1, 0.1]))
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
    every = design.sets
    corners = np.array(np.meshgrid(*[[s.centres[0], s.centres[-1]] for s in every]))
    inference = Fuzzy(design).infer(corners.reshape(len(every), -1).T)
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


@pytest.mark.parametrize("missing", [0, 1])
@pytest.mark.parametrize("speed", [10.0, 25.0, 50.0])
def test_a_missing_channel_never_lets_a_filter_run_away(design: Design, missing: int, speed: float) -> None:
    """Corrected by one channel with its part of a gain made for two, model 4 would double with every tick."""
    rng = np.random.default_rng(5)
    estimator = Estimator(design, 1)
    largest = []
    for k in range(400):
        present = np.ones((2, 1), dtype=bool)
        present[missing] = k not in range(200, 230)
        z = rng.normal(0.0, 1.0, (2, 1)) * np.array([[0.01], [0.3]])
        estimator.step(Tick(k, z, present, np.full(1, 0.2), speed))
        largest.append(float(np.abs(estimator._bank.x).max()))
    assert max(largest[200:]) <= 2.0 * max(largest[:200])


def test_a_tick_after_a_gap_stays_out(design: Design) -> None:
    rng = np.random.default_rng(6)
    estimator, good = Estimator(design, 1), []
    whole = [True] * 50 + [False] * 2 + [True] * 10
    for k, there in enumerate(whole):
        z = rng.normal(0.0, 1.0, (2, 1)) * np.array([[0.01], [0.3]])
        estimator.step(Tick(k, z, np.full((2, 1), there), np.full(1, 0.2), 25.0))
        good.append(bool(estimator.good[0]))
    assert good == [False] + [True] * 49 + [False] * 3 + [True] * 9
