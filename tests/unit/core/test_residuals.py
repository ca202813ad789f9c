"""Sums over blocks of ticks against numpy's own fits of the ticks themselves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.c_parts import RATIO, RATIO_N, SUMS, N, Statistics, Window, statistics
from wrcd.core.terms import BLOCK_TICKS, LAG

BLOCKS = 50
START = 1000  # a tick's number is what it is: the first block is not whole
RAW_N, RAW, RAW2 = (
    43,
    slice(44, 52),
    slice(52, 60),
)  # sums over calm ticks: their number, unfiltered innovations, squares


class Played:
    """Random innovations of one axle on top of a line, and the window that they were put into."""

    def __init__(self, ticks: int, seed: int = 1, start: int = START, blocks: int = BLOCKS) -> None:
        rng = np.random.default_rng(seed)
        self.start = start
        self.t = start + np.arange(ticks)
        noise = np.convolve(rng.standard_normal(ticks * 8 + 3), np.ones(4), "valid").reshape(ticks, 4, 2)
        noise[:, :, 1] += 0.5 * noise[:, :, 0]
        self.w = noise * rng.uniform(0.5, 3.0, (4, 2)) + rng.normal(0, 5, (4, 2))
        self.w += 0.02 * np.arange(ticks)[:, None, None] * rng.standard_normal((4, 2))
        self.raw = rng.standard_normal((ticks, 4, 2)) + 3.0
        self.live = rng.random(ticks) > 0.1
        self.heard = self.live | (np.arange(ticks) % 3 == 0)
        self.calm = self.live & (rng.random(ticks) > 0.1)
        self.ratio = rng.uniform(0.1, 0.2, ticks)
        self.window = Window(blocks, 1)
        for k in range(ticks):
            self.put(k)

    def put(self, k: int, running: bool = True) -> None:
        """The k-th tick."""
        self.window.put(
            self.start + k, self.w[k, :, :, None], self.raw[k, :, :, None], np.array([running]), self.heard[k, None],
            self.live[k, None], self.calm[k, None], self.ratio[k, None],
        )  # fmt: skip

    def statistics(self, blocks: int, least: float = 10.0) -> Statistics:
        """Of the newest blocks."""
        return statistics(self.window.sums(0, blocks), least)

    def of(self, blocks: int) -> np.ndarray:
        """Which ticks the newest blocks hold."""
        return np.asarray(self.t // BLOCK_TICKS > self.t[-1] // BLOCK_TICKS - blocks)


def about_a_line(w: np.ndarray, t: np.ndarray) -> np.ndarray:
    """w (ticks, …) without the line that numpy fits."""
    flat = w.reshape(len(w), -1)
    line = np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, flat, 1)).T
    return np.asarray((flat - line).reshape(w.shape))


@pytest.mark.parametrize("ticks", [160, 203, 500])  # less than the window, a block that is not whole, more than it
@pytest.mark.parametrize("blocks", [10, 25, BLOCKS])
def test_power_is_about_a_line_and_of_live_ticks(ticks: int, blocks: int) -> None:
    p = Played(ticks)
    held = p.of(blocks)
    rest = about_a_line(p.w[held], p.t[held])
    s = p.statistics(blocks)
    assert s.mean_square == pytest.approx(np.square(rest).sum(axis=(0, 2)) / 2 / p.live[held].sum())
    assert s.live_share == pytest.approx(p.live[held].mean())
    assert s.heard_share == pytest.approx(p.heard[held].mean())
    assert s.ratio == pytest.approx(p.ratio[held].mean())
    assert s.ticks == held.sum()
    cross = [np.corrcoef(rest[:, m, 0], rest[:, m, 1])[0, 1] for m in range(4)]
    assert s.cross == pytest.approx(cross)
    assert min(cross) > 0.1


def test_lag_is_the_correlation_with_what_was_before() -> None:
    """Each innovation times the one LAG ticks before; of the two lines' product the square of the newer's is taken."""
    p = Played(500)
    held = np.flatnonzero(p.of(BLOCKS))
    rest = about_a_line(p.w[held], p.t[held])
    line = p.w[held] - rest
    together = (p.w[held] * p.w[held - LAG]).mean(axis=0) - np.square(line).mean(axis=0)
    assert p.statistics(BLOCKS).lag == pytest.approx(together / np.square(rest).mean(axis=0))


def test_lag_tells_fast_from_slow() -> None:
    p = Played(500)
    angle = 2 * np.pi * p.t[:, None, None] / np.array([2 * LAG, 4 * LAG, 20 * LAG, 60.0 * LAG])[None, :, None]
    p.w = np.sin(angle + np.array([0.3, 1.1]))
    for k in range(500):
        p.put(k)
    lag = p.statistics(BLOCKS).lag
    assert lag[0] == pytest.approx(-1.0, abs=0.05)
    assert lag[1] == pytest.approx(0.0, abs=0.05)
    assert np.all(lag[2] > 0.9)
    assert np.all(np.abs(lag) <= 1.0)


@given(st.integers(1, 3 * BLOCKS * BLOCK_TICKS), st.integers(0, 3), st.integers(1, BLOCKS))
def test_sums_over_any_number_of_blocks_are_those_of_their_ticks(ticks: int, phase: int, blocks: int) -> None:
    p = Played(ticks, start=START + phase)
    held = p.of(blocks)
    n = held.sum()
    s = p.statistics(blocks, least=0.0)
    assert s.ticks == n
    assert s.ratio == pytest.approx(p.ratio[held].mean())
    if n > 4 and p.live[held].any():
        power = np.square(about_a_line(p.w[held], p.t[held])).sum(axis=(0, 2)) / 2 / p.live[held].sum()
        assert s.mean_square == pytest.approx(power, rel=1e-6)


@pytest.mark.parametrize(("first", "end"), [(0, 1), (0, 8), (8, 50), (49, 50)])
def test_plain_sums_are_of_calm_ticks_between_two_ages(first: int, end: int) -> None:
    p = Played(501)
    held = p.of(end) & ~p.of(first)
    sums = p.window.sums(first, end)
    calm = held & p.calm
    assert sums[RAW_N] == calm.sum()
    if calm.sum() > 2:
        variance = sums[RAW2] / sums[RAW_N] - np.square(sums[RAW] / sums[RAW_N])
        assert variance == pytest.approx(p.raw[calm].var(axis=0).ravel())
    assert sums[RATIO] / sums[RATIO_N] == pytest.approx(p.ratio[held].mean())


def test_too_little_data_is_unknown_and_no_perfect_fit() -> None:
    window = Window(BLOCKS, 2)
    assert np.isnan(statistics(np.zeros(SUMS), 16.0).mean_square).all()
    both, one = np.array([True, True]), np.array([True, False])
    for k in range(40):
        w = np.full((4, 2, 2), float(k % 2))
        window.put(k, w, w, both, one, one, one, np.array([0.1, 0.2]))
        first, second = (statistics(window.sums(0, BLOCKS, axle), 16.0) for axle in range(2))
        assert np.isnan(first.mean_square).all() == (k + 1 < 16)
        assert np.isnan(second.mean_square).all()
    assert (first.live_share, second.live_share) == (1.0, 0.0)
    assert (first.ratio, second.ratio) == pytest.approx((0.1, 0.2))


def test_a_torque_that_is_not_known_stays_out_of_its_mean() -> None:
    p = Played(200)
    p.ratio[::3] = np.nan
    p.window = Window(BLOCKS, 1)
    for k in range(200):
        p.put(k)
    assert p.statistics(BLOCKS).ratio == pytest.approx(np.nanmean(p.ratio))
    assert all(np.isfinite(p.window.sums(0, b)[[RATIO, RATIO_N]]).all() for b in range(BLOCKS + 1))


def test_ticks_that_never_came_leave_a_gap() -> None:
    """Numbers that are left out: what lies further back than the window is gone, what the gap splits is not whole."""
    p = Played(400)
    p.window = Window(BLOCKS, 1)
    there = [k for k in range(400) if not 300 <= k < 340]
    for k in there:
        p.put(k)
    held = p.of(BLOCKS) & np.isin(np.arange(400), there)
    assert p.statistics(BLOCKS).ticks == held.sum()
    power = np.square(about_a_line(p.w[held], p.t[held])).sum(axis=(0, 2)) / 2 / p.live[held].sum()
    assert p.statistics(BLOCKS).mean_square == pytest.approx(power)
    assert p.window.filled() == [(400 - 340) // BLOCK_TICKS]
    yes = np.array([True])
    last = START + 400 + BLOCKS * BLOCK_TICKS
    p.window.put(last, p.w[0, :, :, None], p.raw[0, :, :, None], yes, yes, yes, yes, np.array([0.5]))
    assert p.statistics(BLOCKS).ticks == 1
    assert p.statistics(BLOCKS).ratio == 0.5


def test_dropped_ticks_leave_no_trace_in_the_sums() -> None:
    p, short = Played(500), Played(500)
    p.window.truncate(12)
    short.window = Window(BLOCKS, 1)
    first = int(np.argmax(short.of(12)))
    short.window.state["window_past"] = short.w[first - LAG : first].reshape(1, -1)
    for k in range(first, 500):
        short.put(k)
    assert p.window.filled() == [12]
    for blocks in range(BLOCKS + 1):
        found, expected = (w.sums(0, blocks) for w in (p.window, short.window))
        assert np.allclose(found, expected, rtol=1e-12, atol=1e-9)
    assert p.statistics(BLOCKS).ticks == 500 - first
    p.start += 40  # it grows again by what comes
    for k in range(500 - 40, 500):
        p.put(k)
    assert p.window.filled() == [22]


def test_dropping_and_emptying_one_axle_leaves_the_other() -> None:
    rng = np.random.default_rng(5)
    window, alone = Window(BLOCKS, 2), Window(BLOCKS, 1)
    yes = np.ones(2, dtype=bool)
    for k in range(300):
        w, raw = rng.standard_normal((2, 4, 2, 2))
        window.put(k, w, raw, yes, yes, yes, yes, np.array([0.1, 0.2]))
        alone.put(k, w[..., 1:], raw[..., 1:], yes[1:], yes[1:], yes[1:], yes[1:], np.array([0.2]))
        if k == 200:
            window.truncate(5, 0)
        if k == 280:
            window.reset(0)
            # it stands until then: nothing of it is left
            assert window.filled() == [0, BLOCKS]
    for blocks in range(BLOCKS + 1):
        assert np.array_equal(window.sums(0, blocks, 1), alone.sums(0, blocks))
    assert window.filled() == [5, BLOCKS]


def test_an_axle_that_does_not_run_has_no_ticks() -> None:
    p = Played(100)
    for k in range(100):
        p.start += 100 if k == 0 else 0
        p.put(k, running=k >= 60)
    assert p.window.filled() == [10]
    assert p.statistics(10).ticks == 40
    assert p.statistics(25).ratio == pytest.approx(p.ratio[60:].mean())


@pytest.mark.parametrize("ticks", range(1, 10))
def test_window_of_an_axle_that_begins_within_a_block_holds_that_block(ticks: int) -> None:
    """Beside another axle, as after a reset within the block."""
    window, w = Window(20, 2), np.ones((4, 2, 2))
    for k in range(24):
        running = np.array([True, k >= 24 - ticks])
        window.put(k, w, w, running, running, running, running, np.full(2, 0.1))
    assert window.filled() == [6, -(-ticks // BLOCK_TICKS)]
    assert [window.sums(0, n, axle)[N] for axle, n in enumerate(window.filled())] == [24.0, ticks]


def test_the_torques_range_outlives_what_is_dropped() -> None:
    """Slip cycles through the peak: what the torque has been tells, though it is not what it is now."""
    p = Played(500)
    means = [p.ratio[p.t // BLOCK_TICKS == b].mean() for b in np.unique(p.t // BLOCK_TICKS)]
    p.window.truncate(5)
    for blocks in (3, 40):
        low, high = p.window.torque_range(blocks)
        assert (low, high) == pytest.approx((min(means[-blocks:]), max(means[-blocks:])))
    p.window.reset(0)
    assert not np.isfinite(p.window.torque_range(40)).any()


def test_residuals_before_a_change_are_kept() -> None:
    p = Played(500)
    before = p.window.sums(0, 40, past_change=True)
    p.window.truncate(5)
    assert np.array_equal(p.window.sums(0, 40, past_change=True), before)
    assert not p.window.sums(5, 40).any()
    p.window.reset(0)
    assert not p.window.sums(0, 40, past_change=True).any()
