"""What the rail was a moment ago: words that are fused, and what was in use at the last peak."""

import math

import numpy as np
import pytest

from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.trust.memory import (
    ABOVE,
    ANOTHER_STEPS,
    BEGINS,
    BELOW,
    CUT,
    HOLD_S,
    KEPT,
    SATURATED,
    VAGUE,
    WEIGHT,
    Remembered,
    Word,
    remember,
    spoken,
)

STEP_S, SPEED = 0.08, 20.0
YES, NO, ALL = np.array([True]), np.array([False]), np.ones(1)


def word(pct: float, sigma: float = 0.1) -> Word:
    return Word(np.log([pct]), np.array([sigma]))


def nothing() -> Remembered:
    return Remembered(*np.zeros((len(Remembered._fields), 1)))


def after(
    memory: Remembered, steps: int, says: Word, recent: Word | None = None, in_use: float = 5.0,
    whole: BoolArray = YES, live: float = 1.0,
) -> Remembered:  # fmt: skip
    for _ in range(steps):
        newest, torque = says if recent is None else recent, np.array([in_use])
        memory = remember(memory, says, whole, newest, np.array([live]), torque, STEP_S, SPEED)
    return memory


def test_words_that_agree_become_one_that_is_as_sure_as_they_are() -> None:
    first, many = after(nothing(), 1, word(20.0)), after(nothing(), 500, word(20.0))
    assert spoken(first, word(20.0), YES)[0].sigma == pytest.approx(0.1)
    fused, share = spoken(many, word(20.0), YES)
    assert share == 0.0
    assert np.exp(fused.log_pct) == pytest.approx(20.0)
    sure = 0.1 * math.sqrt((1.0 - KEPT) / WEIGHT)
    assert many.precision == pytest.approx(1.0 / sure**2)
    assert fused.sigma == pytest.approx(min(sure, 0.1))


def test_words_weigh_by_their_spread() -> None:
    memory = after(after(nothing(), 200, word(20.0, 0.1)), 1, word(22.0, 0.3))
    sure = after(after(nothing(), 200, word(20.0, 0.1)), 1, word(22.0, 0.1))
    a, b = (m.weighed / m.precision for m in (memory, sure))
    assert np.log(20.0) < a < b < np.log(22.0)


@pytest.mark.parametrize(("sigmas", "share"), [(-BELOW, 1.0), (ABOVE, 1.0), (-0.5 * BELOW, 0.0), (0.75 * ABOVE, 0.5)])
def test_word_that_lies_far_from_the_memory_takes_over_by_degrees(sigmas: float, share: float) -> None:
    memory, new = after(nothing(), 500, word(20.0)), word(20.0 * math.exp(0.1 * sigmas))
    said, counts = spoken(memory, new, YES)
    assert counts == pytest.approx(share)
    between = (1.0 - share) * math.log(20.0) + share * new.log_pct
    assert said.log_pct == pytest.approx(between)


def test_memory_begins_anew_with_a_word_that_took_over() -> None:
    anew = after(after(nothing(), 500, word(20.0)), 1, word(8.0))
    assert np.exp(anew.weighed / anew.precision) == pytest.approx(8.0)


def test_memory_that_begins_follows_a_rail_that_still_changes() -> None:
    anew = after(after(nothing(), 500, word(20.0)), 1, word(8.0))
    old = after(nothing(), 500, word(8.0))
    follows, stays = (m.weighed / m.precision for m in (after(x, 4, word(7.4)) for x in (anew, old)))
    assert follows < np.log(7.7) < stays


def test_cut_window_that_says_the_same_was_a_false_alarm() -> None:
    memory = after(nothing(), 500, word(20.0))
    said, share = spoken(memory, word(19.5), NO)
    assert share == 0.0
    assert np.exp(said.log_pct) == pytest.approx(20.0)
    cut = after(memory, 1, word(19.5), whole=NO)
    assert cut.precision > 0.9 * memory.precision


@pytest.mark.parametrize(("pct", "sigma"), [(20.0 * math.exp(-0.1 * CUT * BELOW), 0.1), (12.0, 0.1), (20.0, VAGUE)])
def test_cut_window_that_says_something_else_or_is_vague_speaks_for_itself(pct: float, sigma: float) -> None:
    memory, new = after(nothing(), 500, word(20.0)), word(pct, sigma)
    assert spoken(memory, new, NO)[0].log_pct == pytest.approx(np.log(pct))
    assert spoken(memory, new, YES)[1] < 1.0 or pct == 12.0
    cut = after(memory, 1, word(8.0, sigma), whole=NO)
    assert cut.precision == pytest.approx(BEGINS / sigma**2)


@pytest.mark.parametrize("newest", [10.0, 40.0])
def test_newest_part_that_says_twice_that_the_rail_is_another_ends_the_memory(newest: float) -> None:
    memory = after(nothing(), 500, word(20.0))
    one = after(memory, 1, word(20.0), recent=word(newest, 0.1))
    assert (one.another < ANOTHER_STEPS) & (one.precision > 0.0)
    two = after(one, 1, word(20.0), recent=word(newest, 0.1))
    assert (two.another >= ANOTHER_STEPS) & (two.precision == 0.0)
    assert after(one, 1, word(20.0)).another == 0.0


def test_bound_of_the_last_peak_is_carried_and_erodes_with_time_and_way() -> None:
    peak = after(nothing(), 1, word(30.0), in_use=28.0)
    held = after(peak, int(HOLD_S / STEP_S), word(30.0), in_use=3.0)
    assert held.peak_pct == 28.0
    later = after(held, 25, word(30.0), in_use=3.0)  # 2 s
    assert 12.0 < later.peak_pct < 0.7 * 28.0
    assert after(later, 1, word(30.0), in_use=25.0).peak_pct == 25.0
    faster = remember(held, word(30.0), YES, word(30.0), ALL, np.array([3.0]), 1.0, 60.0)
    slower = remember(held, word(30.0), YES, word(30.0), ALL, np.array([3.0]), 1.0, 5.0)
    assert faster.peak_pct < slower.peak_pct


def test_saturated_on_less_the_bound_is_what_is_in_use() -> None:
    peak = after(nothing(), 1, word(30.0), in_use=28.0)
    low = after(peak, 1, word(30.0), recent=word(5.0), in_use=5.0 * SATURATED + 0.01)
    assert low.peak_pct == pytest.approx(5.0 * SATURATED + 0.01)


def test_what_is_not_known_changes_nothing_for_good() -> None:
    memory = after(nothing(), 500, word(20.0), in_use=10.0)
    unknown = Word(np.array([np.nan]), np.array([np.nan]))
    with np.errstate(all="ignore"):
        none = remember(memory, unknown, YES, unknown, ALL, np.array([np.nan]), STEP_S, SPEED)
        back = after(none, 1, word(20.0), in_use=math.inf)
    assert none.precision == 0.0
    assert np.isfinite(np.array(back)).all()
    assert back.peak_pct == pytest.approx(10.0, rel=0.1)
