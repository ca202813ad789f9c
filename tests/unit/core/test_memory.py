"""What the rail was a moment ago: words that are fused, and what was in use at the last peak."""

import math

import numpy as np
import pytest

from tests.support.c_parts import Word, fuse, spoken
from wrcd.core.design import FloatArray

BELOW, ABOVE, CUT, VAGUE = 2.5, 3.0, 0.5, 0.3
KEPT, WEIGHT, BEGINS, SATURATED, HOLD_S = 0.94, 0.08 * 0.6, 0.2, 0.87, 0.5
STEP_S, SPEED = 0.08, 20.0
PRECISION, WEIGHED, PEAK_PCT, _, ANOTHER, SINCE_M, ABOVE_S = range(7)
NOTHING = np.zeros(7)


def word(pct: float, sigma: float = 0.1) -> Word:
    return Word(math.log(pct), sigma)


def after(
    memory: FloatArray, steps: int, says: Word, recent: Word | None = None, in_use: float = 5.0, whole: bool = True,
    step_s: float = STEP_S, speed_m_s: float = SPEED,
) -> FloatArray:  # fmt: skip
    for _ in range(steps):
        memory = fuse(memory, says, whole, says if recent is None else recent, 1.0, in_use, step_s, speed_m_s)
    return memory


def said(memory: FloatArray, own: Word, whole: bool = True) -> tuple[Word, float]:
    return spoken(memory[PRECISION], memory[WEIGHED], own, whole)


def fused_pct(memory: FloatArray) -> float:
    return math.exp(memory[WEIGHED] / memory[PRECISION])


def test_words_that_agree_become_one_that_is_as_sure_as_they_are() -> None:
    first, many = after(NOTHING, 1, word(20.0)), after(NOTHING, 500, word(20.0))
    assert said(first, word(20.0))[0].sigma == pytest.approx(0.1)
    fused, share = said(many, word(20.0))
    assert share == 0.0
    assert math.exp(fused.log_pct) == pytest.approx(20.0)
    sure = 0.1 * math.sqrt((1.0 - KEPT) / WEIGHT)
    assert many[PRECISION] == pytest.approx(1.0 / sure**2)
    assert fused.sigma == pytest.approx(min(sure, 0.1))


def test_words_weigh_by_their_spread() -> None:
    memory = after(after(NOTHING, 200, word(20.0, 0.1)), 1, word(22.0, 0.3))
    sure = after(after(NOTHING, 200, word(20.0, 0.1)), 1, word(22.0, 0.1))
    a, b = (math.log(fused_pct(m)) for m in (memory, sure))
    assert np.log(20.0) < a < b < np.log(22.0)


@pytest.mark.parametrize(("sigmas", "share"), [(-BELOW, 1.0), (ABOVE, 1.0), (-0.5 * BELOW, 0.0), (0.75 * ABOVE, 0.5)])
def test_word_that_lies_far_from_the_memory_takes_over_by_degrees(sigmas: float, share: float) -> None:
    memory, new = after(NOTHING, 500, word(20.0)), word(20.0 * math.exp(0.1 * sigmas))
    word_of, counts = said(memory, new)
    assert counts == pytest.approx(share)
    between = (1.0 - share) * math.log(20.0) + share * new.log_pct
    assert word_of.log_pct == pytest.approx(between)


def test_memory_begins_anew_with_a_word_that_took_over() -> None:
    anew = after(after(NOTHING, 500, word(20.0)), 1, word(8.0))
    assert fused_pct(anew) == pytest.approx(8.0)


def test_word_is_as_old_as_its_memory() -> None:
    memory = after(NOTHING, 500, word(20.0))
    assert memory[SINCE_M] == pytest.approx(499 * STEP_S * SPEED)
    assert after(memory, 1, word(40.0))[SINCE_M] == 0.0
    assert after(memory, 1, word(20.0, math.inf))[SINCE_M] == 0.0
    once = after(memory, 1, word(20.0), recent=word(8.0))
    assert once[SINCE_M] > 0.0
    assert after(once, 1, word(20.0), recent=word(8.0))[SINCE_M] == 0.0


def test_memory_that_begins_follows_a_rail_that_still_changes() -> None:
    anew = after(after(NOTHING, 500, word(20.0)), 1, word(8.0))
    old = after(NOTHING, 500, word(8.0))
    follows, stays = (math.log(fused_pct(m)) for m in (after(x, 4, word(7.4)) for x in (anew, old)))
    assert follows < np.log(7.7) < stays


def test_cut_window_that_says_the_same_was_a_false_alarm() -> None:
    memory = after(NOTHING, 500, word(20.0))
    word_of, share = said(memory, word(19.5), whole=False)
    assert share == 0.0
    assert math.exp(word_of.log_pct) == pytest.approx(20.0)
    cut = after(memory, 1, word(19.5), whole=False)
    assert cut[PRECISION] > 0.9 * memory[PRECISION]


@pytest.mark.parametrize(("pct", "sigma"), [(20.0 * math.exp(-0.1 * CUT * BELOW), 0.1), (12.0, 0.1), (20.0, VAGUE)])
def test_cut_window_that_says_something_else_or_is_vague_speaks_for_itself(pct: float, sigma: float) -> None:
    memory, new = after(NOTHING, 500, word(20.0)), word(pct, sigma)
    assert said(memory, new, whole=False)[0].log_pct == pytest.approx(np.log(pct))
    assert said(memory, new)[1] < 1.0 or pct == 12.0
    cut = after(memory, 1, word(8.0, sigma), whole=False)
    assert cut[PRECISION] == pytest.approx(BEGINS / sigma**2)


def test_words_that_lie_above_the_memory_for_long_begin_it_anew() -> None:
    """Two standard deviations: below what the memory holds for another rail."""
    memory, better = after(NOTHING, 500, word(20.0)), word(20.0 * math.exp(0.2))
    soon, late = (after(memory, steps, better, recent=word(20.0)) for steps in (3, 11))
    worse = after(memory, 11, word(20.0 * math.exp(-0.2)), recent=word(20.0))
    assert 0.0 < soon[ABOVE_S] < 0.6
    assert soon[SINCE_M] > memory[SINCE_M]
    assert fused_pct(soon) < 21.5
    assert fused_pct(late) == pytest.approx(20.0 * math.exp(0.2), rel=0.01)
    assert late[SINCE_M] < 11 * STEP_S * SPEED
    assert worse[ABOVE_S] == 0.0


@pytest.mark.parametrize("newest", [10.0, 40.0])
def test_newest_part_that_says_twice_that_the_rail_is_another_ends_the_memory(newest: float) -> None:
    memory = after(NOTHING, 500, word(20.0))
    one = after(memory, 1, word(20.0), recent=word(newest, 0.1))
    assert one[ANOTHER] == 1.0
    assert one[PRECISION] > 0.0
    two = after(one, 1, word(20.0), recent=word(newest, 0.1))
    assert two[ANOTHER] == 2.0
    assert two[PRECISION] == 0.0
    assert after(one, 1, word(20.0))[ANOTHER] == 0.0


@pytest.mark.parametrize(("sigmas", "is_another"), [(-2.1, True), (-1.9, False), (2.4, False), (2.6, True)])
def test_rail_is_another_sooner_where_it_is_worse(sigmas: float, is_another: bool) -> None:
    """Standard deviations of both: the newest part's words scatter 1.8 times as far as they say."""
    memory = after(NOTHING, 500, word(20.0))
    both = math.hypot(1.8 * 0.1, 1.0 / math.sqrt(memory[PRECISION]))
    assert (after(memory, 1, word(20.0), recent=word(20.0 * math.exp(sigmas * both)))[ANOTHER] > 0.0) == is_another


def test_bound_of_the_last_peak_is_carried_and_erodes_with_time_and_way() -> None:
    peak = after(NOTHING, 1, word(30.0), in_use=28.0)
    held = after(peak, int(HOLD_S / STEP_S), word(30.0), in_use=3.0)
    assert held[PEAK_PCT] == 28.0
    later = after(held, 25, word(30.0), in_use=3.0)  # 2 s
    assert 12.0 < later[PEAK_PCT] < 0.7 * 28.0
    assert after(later, 1, word(30.0), in_use=25.0)[PEAK_PCT] == 25.0
    faster, slower = (after(held, 1, word(30.0), in_use=3.0, step_s=1.0, speed_m_s=v) for v in (60.0, 5.0))
    assert faster[PEAK_PCT] < slower[PEAK_PCT]


def test_saturated_on_less_the_bound_is_what_is_in_use() -> None:
    peak = after(NOTHING, 1, word(30.0), in_use=28.0)
    low = after(peak, 1, word(30.0), recent=word(5.0), in_use=5.0 * SATURATED + 0.01)
    assert low[PEAK_PCT] == pytest.approx(5.0 * SATURATED + 0.01)


def test_what_is_not_known_changes_nothing_for_good() -> None:
    memory = after(NOTHING, 500, word(20.0), in_use=10.0)
    unknown = Word(math.nan, math.nan)
    none = after(memory, 1, unknown, in_use=math.nan)
    back = after(none, 1, word(20.0), in_use=math.inf)
    assert none[PRECISION] == 0.0
    assert np.isfinite(back).all()
    assert back[PEAK_PCT] == pytest.approx(10.0, rel=0.1)
