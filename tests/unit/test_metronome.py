"""What the metronome excuses, and what it does not."""

import pytest

from tests.support.metronome import SLOT_US, Machine, Stall, calm, cycle, mostly, stalls, within

BEGIN = 85_000_000_000  # a slot
SLOTS = list(range(BEGIN + 1, BEGIN + 500))
BEGIN_US, END_US = BEGIN * SLOT_US, (BEGIN + 500) * SLOT_US


def test_late_wakes_and_slow_work_are_stalls_by_as_much_as_they_cost() -> None:
    """Usual work is 20 us: half as much again is noise, twice is half of the period lost."""
    wakes = [(k * 5000, 100_000, 20_000) for k in range(100)]
    assert stalls(wakes, 20_000) == []
    wakes[10], wakes[20], wakes[30] = (50_000, 3_000_000, 20_000), (100_000, 0, 29_000), (150_000, 0, 40_000)
    assert stalls(wakes, 20_000) == [(50_000, 3_000_000), (150_000, 2_500_000)]
    assert stalls([], 0) == []


def test_silence_at_either_end_is_missing() -> None:
    assert len(cycle(SLOTS[20:-30], BEGIN_US, END_US, Machine()).missing) == 50


@pytest.mark.parametrize("slots", [[7, 7], [8, 7]])
def test_a_slot_twice_or_out_of_order_raises(slots: list[int]) -> None:
    with pytest.raises(AssertionError, match="twice or out of their order"):
        cycle(slots, 0, 10 * SLOT_US, Machine())


def test_taken_is_what_overlaps() -> None:
    machine = Machine([Stall(10, 30), Stall(50, 60)])
    assert (machine.taken_us(0, 100), machine.taken_us(20, 55), machine.taken_us(30, 50)) == (30, 15, 0)


def test_calm_leaves_out_a_window_after_each_silence() -> None:
    stamps = [t for t in range(0, 20_000_000, 5000) if not 8_000_000 < t < 8_020_000]
    times = calm(stamps, 15_000)
    assert times == [(2_000_000, 8_000_000), (10_020_000, 19_995_000)]
    assert [within(t, times) for t in (1_000_000, 8_000_000, 9_000_000, 15_000_000)] == [False, True, False, True]


def test_nothing_judged_is_right_only_where_the_machine_explains_it(capsys: pytest.CaptureFixture[str]) -> None:
    every_second = Machine([Stall(t, t + 10_000) for t in range(BEGIN_US, END_US, 1_000_000)])
    once = Machine(every_second.stalls[:1])
    assert mostly([], 0.8, BEGIN_US, END_US, every_second)
    assert not mostly([], 0.8, BEGIN_US, END_US, once)
    assert not mostly([], 0.8, BEGIN_US, END_US, Machine())
    assert capsys.readouterr().out.count("NOTHING JUDGED") == 3
    assert mostly([True] * 8 + [False] * 2, 0.8, BEGIN_US, END_US, Machine())
    assert not mostly([True] * 7 + [False] * 3, 0.8, BEGIN_US, END_US, every_second)
