"""Fuzzy sets, rules, and what the rules are given."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.reference.rules import FuzzyReference
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.estimator.design import COLUMNS, INPUTS, MODELS, Design, FloatArray, Sets, load_design
from wrcd.estimator.paper.fuzzy import LOG_SPREADS, MIN_FIRING, Fuzzy
from wrcd.estimator.paper.rule_inputs import MAX_STEP, NOISE, SWING, Past, RuleInputs
from wrcd.estimator.paper.window import Statistics

SPEED = 25.0


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(LONE_DESIGN)


def middle_of(design: Design, rule: int) -> FloatArray:
    """(COLUMNS,): where a rule says its base."""
    named = [s.centres[k] for s, k in zip(design.sets, design.rules[rule], strict=True)]
    return np.concatenate((named, design.middle[INPUTS:]))


@given(st.floats(-10, 10), st.lists(st.floats(0.01, 3), min_size=0, max_size=6))
def test_the_sets_of_an_input_add_up_to_one(x: float, gaps: list[float]) -> None:
    centres = np.cumsum([0.0, *gaps])
    degrees = Sets(tuple(map(str, centres)), centres).memberships(np.array([x]))
    assert degrees.sum() == pytest.approx(1.0)
    assert (degrees >= 0).all()


def test_rule_says_its_base_in_the_middle_of_its_sets(design: Design) -> None:
    """In the middle of its sets one rule speaks alone, and says its base."""
    design = replace(design, low=np.minimum(design.low, design.middle))  # quieter sensors are held above the middle
    rule = int(np.argmax((design.bases > 10) & (design.bases < 90)))
    middle = middle_of(design, rule)
    found = Fuzzy(design).infer(middle[None, :])
    assert found.rule[0] == rule + 1
    assert found.rule_share[0] == pytest.approx(1.0)
    assert found.output[0] == pytest.approx(design.bases[rule])
    assert found.spread[0] == pytest.approx(np.clip(design.spreads[rule], *(10.0**x for x in LOG_SPREADS)))


def test_beyond_their_range_columns_count_as_at_its_end(design: Design) -> None:
    fuzzy = Fuzzy(design)
    for end in (design.low, design.high):
        beyond = np.where(end == design.low, end - 1.0, end + 1.0)
        x = np.where(np.arange(COLUMNS) < INPUTS, middle_of(design, 0), end)
        y = np.where(np.arange(COLUMNS) < INPUTS, x, beyond)
        assert fuzzy.infer(y[None, :]).output[0] == fuzzy.infer(x[None, :]).output[0]


def test_sensors_quieter_than_the_designs_count_as_they_do(design: Design) -> None:
    """Tactical ones are a sixth and half as noisy: the rules' lines do not go on to there. In both engines."""
    fast, reference = Fuzzy(design), FuzzyReference(design)
    inputs = np.array([middle_of(design, rule) for rule in range(len(design.rules))])
    as_designed, quiet, noisy = inputs.copy(), inputs.copy(), inputs.copy()
    as_designed[:, NOISE], quiet[:, NOISE], noisy[:, NOISE] = 0.0, np.log10([1 / 6, 1 / 2]), 0.3
    expected = fast.infer(as_designed)
    found = fast.infer(quiet)
    np.testing.assert_array_equal(found.output, expected.output)
    np.testing.assert_array_equal(found.spread, expected.spread)
    np.testing.assert_allclose(reference.outputs(quiet), expected.output, rtol=1e-9, atol=1e-9)
    assert (fast.infer(noisy).output != expected.output).mean() > 0.5


def test_between_sets_the_rules_lines_are_mixed(design: Design) -> None:
    rng = np.random.default_rng(11)
    x = rng.uniform(design.low, design.high, (300, COLUMNS))
    found = Fuzzy(design).infer(x)
    spoken = np.flatnonzero(np.isfinite(found.output))
    assert len(spoken) >= 20
    middles = np.array([middle_of(design, r) for r in range(len(design.rules))])
    for i in spoken:
        weights = np.ones(len(design.rules))
        for j, s in enumerate(design.sets):
            degrees = [np.interp(x[i, j], s.centres, row) for row in np.eye(len(s.centres))]
            weights *= np.array(degrees)[design.rules[:, j]]
        says = design.bases + np.sum(design.slopes * (x[i] - middles), axis=1)
        assert found.output[i] == pytest.approx(np.clip(weights @ says / weights.sum(), 0, 100), abs=1e-6)
        assert found.firing[i] == pytest.approx(weights.sum())
        assert found.rule[i] == np.argmax(weights) + 1


def test_inputs_without_a_rule_give_no_answer(design: Design) -> None:
    corners = np.array(np.meshgrid(*[[s.centres[0], s.centres[-1]] for s in design.sets])).reshape(INPUTS, -1).T
    inference = Fuzzy(design).infer(np.column_stack((corners, np.tile(design.middle[INPUTS:], (len(corners), 1)))))
    silent = inference.firing < MIN_FIRING
    assert silent.any()
    assert np.isnan(inference.output[silent]).all()
    assert np.isnan(inference.spread[silent]).all()
    assert (inference.rule[silent] == 0).all()
    assert ((inference.output[~silent] >= 0) & (inference.output[~silent] <= 100)).all()


def test_an_unknown_input_gives_no_answer(design: Design) -> None:
    x = middle_of(design, 0)
    x[2] = np.nan
    assert np.isnan(Fuzzy(design).infer(x[None, :]).output[0])


def seen(power: FloatArray, ticks: float = 200.0) -> Statistics:
    """Statistics of one axle with a given power (4, 2)."""
    return Statistics(
        power[None], power.mean(axis=1)[None], np.zeros((1, 8)), np.zeros((1, 4)), np.array([0.1]), np.array([ticks]),
        np.ones(1), np.ones(1),
    )  # fmt: skip


PAST = Past(now=np.array([0.1]), lowest=np.array([0.05]), highest=np.array([0.2]), decades=np.zeros((1, MODELS)))


def columns(design: Design, s: Statistics, factor: FloatArray, past: Past = PAST) -> FloatArray:
    """(COLUMNS,): what the rules are given of one window."""
    rules = RuleInputs(design)
    return np.asarray(rules.columns(s, np.array([0.1]), past, factor, rules.floor(factor, SPEED), SPEED)[0])


def test_sensor_noise_is_subtracted_from_the_residual(design: Design) -> None:
    """Twice the track, twice the residuals above the noise: only the input that says how rough the track is moves."""
    factor = np.ones((2, 1))
    floor = RuleInputs(design).floor(factor, SPEED)[0]
    track = np.array([9.0, 4.0, 16.0, 1.0]) * floor
    given = [columns(design, seen(np.tile((floor + s * track)[:, None], 2)), factor) for s in (1, 4)]
    moved = np.flatnonzero(~np.isclose(given[0], given[1]))
    assert moved.tolist() == [MODELS - 1]
    assert given[1][3] - given[0][3] == pytest.approx(np.log10(2.0))
    assert given[0][:3] == pytest.approx(0.5 * np.log10(track[:3] / track[3]))


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_noisier_sensors_with_the_same_track_give_the_same_residuals(design: Design, factor: float) -> None:
    inputs = []
    for f in (1.0, factor):
        factors = np.full((2, 1), f)
        floor = RuleInputs(design).floor(factors, SPEED)[0]
        nominal = RuleInputs(design).floor(np.ones((2, 1)), SPEED)[0]
        assert floor == pytest.approx(f * f * nominal)
        track = 5.0 * nominal
        inputs.append(columns(design, seen(np.tile((floor + track)[:, None], 2)), factors))
    moved = np.flatnonzero(~np.isclose(inputs[0], inputs[1]))
    assert inputs[0][:INPUTS] == pytest.approx(inputs[1][:INPUTS])
    assert 10.0 ** (inputs[1] - inputs[0])[moved] == pytest.approx([factor, factor])  # that they are so is told


def test_steps_of_the_residuals_are_held_and_none_where_nothing_is_known(design: Design) -> None:
    decades = np.array([[0.1, 0.3, -0.4, 9.0], [np.nan] * 4])
    steps = replace(PAST, decades=decades).steps
    assert steps == pytest.approx(np.array([[0.2, -0.4, MAX_STEP, MAX_STEP], [0.0] * 4]))
    x = columns(design, seen(np.ones((4, 2))), np.ones((2, 1)), replace(PAST, decades=decades[:1]))
    assert x[SWING.stop :] == pytest.approx(steps[0])


def test_torque_swing_is_in_decades(design: Design) -> None:
    x = columns(design, seen(np.ones((4, 2))), np.ones((2, 1)))
    assert x[SWING] == pytest.approx([np.log10(0.21 / 0.11), np.log10(0.11 / 0.06)])
    assert x[4] == pytest.approx(-1.0)
    assert x[5] == pytest.approx(np.log10(SPEED))
