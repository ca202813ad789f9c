"""Fuzzy sets and rules."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.c_parts import infer
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.core.design import Design, FloatArray, Sets, load_design
from wrcd.core.terms import COLUMNS, INPUTS, LOG_SPREADS, MIN_FIRING, NOISE


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
    (found,) = infer(design, middle[None])
    assert found.rule == rule + 1
    assert found.rule_share == pytest.approx(1.0)
    assert found.output == pytest.approx(design.bases[rule])
    assert found.spread == pytest.approx(np.clip(design.spreads[rule], *(10.0**x for x in LOG_SPREADS)))


def test_beyond_their_range_columns_count_as_at_its_end(design: Design) -> None:
    for end in (design.low, design.high):
        beyond = np.where(end == design.low, end - 1.0, end + 1.0)
        x = np.where(np.arange(COLUMNS) < INPUTS, middle_of(design, 0), end)
        y = np.where(np.arange(COLUMNS) < INPUTS, x, beyond)
        beyond_it, at_it = infer(design, np.array([y, x]))
        assert beyond_it.output == at_it.output


def test_sensors_quieter_than_the_designs_count_as_they_do(design: Design) -> None:
    """Tactical ones are a sixth and half as noisy: the rules' lines do not go on to there."""
    inputs = np.array([middle_of(design, rule) for rule in range(len(design.rules))])
    as_designed, quiet, noisy = inputs.copy(), inputs.copy(), inputs.copy()
    as_designed[:, NOISE], quiet[:, NOISE], noisy[:, NOISE] = 0.0, np.log10([1 / 6, 1 / 2]), 0.3
    expected, found, other = ([(a.output, a.spread) for a in infer(design, x)] for x in (as_designed, quiet, noisy))
    assert found == expected
    assert np.mean([a != b for a, b in zip(other, expected, strict=True)]) > 0.5


def test_inputs_without_a_rule_give_no_answer(design: Design) -> None:
    corners = np.array(np.meshgrid(*[[s.centres[0], s.centres[-1]] for s in design.sets])).reshape(INPUTS, -1).T
    found = infer(design, np.column_stack((corners, np.tile(design.middle[INPUTS:], (len(corners), 1)))))
    silent = [a for a in found if a.firing < MIN_FIRING]
    assert silent
    assert np.isnan([(a.output, a.spread) for a in silent]).all()
    assert {a.rule for a in silent} == {0}
    assert all(0.0 <= a.output <= 100.0 for a in found if a.firing >= MIN_FIRING)


def test_an_unknown_input_gives_no_answer(design: Design) -> None:
    x = middle_of(design, 0)
    x[2] = np.nan
    (found,) = infer(design, x[None])
    assert np.isnan(found.output)
