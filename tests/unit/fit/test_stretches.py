"""Which stretches of a log are calm, and why others are left out."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from wrcd.fit.stretches import BAND_HZ, STRETCH_S, BogieSignals, LeftOut, blocks_of

TICK_S, WHEELBASE_M, SPEED_M_S, SECONDS = 0.005, 2.5, 20.0, 60.0
TICKS = round(SECONDS / TICK_S)
BEFORE, AFTER = slice(4000, 7000), slice(5600, 5601)  # what is disturbed


def calm() -> BogieSignals:
    """Return what noise gives, the trailing wheelset's signals the leading one's of a wheelbase before."""
    rng = np.random.default_rng(1)
    late = round(WHEELBASE_M / SPEED_M_S / TICK_S)
    noise = rng.normal(size=(TICKS + late, 2)) * (1e-3, 0.1)
    z = np.concatenate((noise[late:], noise[:TICKS]), axis=1)
    return BogieSignals(TICK_S, z, np.full(TICKS, SPEED_M_S), np.ones(TICKS, bool))


def changed(change: Callable[[BogieSignals], None]) -> BogieSignals:
    run = calm()
    run = replace(run, z=run.z.copy(), speed_m_s=run.speed_m_s.copy(), ticked=run.ticked.copy())
    change(run)
    return run


def test_calm_running_is_used_whole_and_both_wheelsets_meet_one_track() -> None:
    blocks, left_out = blocks_of([calm()], WHEELBASE_M)
    assert left_out.total() == left_out[LeftOut.INPUTS] <= 1  # the last wheelbase has no trailing signals
    assert blocks.stretches.sum() == pytest.approx(SECONDS / STRETCH_S * 2 - 2, abs=1)
    assert blocks.frequency_hz.min() >= BAND_HZ[0]
    assert blocks.frequency_hz.max() <= BAND_HZ[1]
    R = np.average(blocks.cross, axis=0, weights=blocks.stretches).mean(axis=0)
    assert R[0, 2].real / np.sqrt(R[0, 0].real * R[2, 2].real) == pytest.approx(1, abs=0.01)
    assert R[1, 1].real == pytest.approx(0.1**2, rel=0.2)


def gap(run: BogieSignals) -> None:
    run.ticked[BEFORE] = False
    run.z[BEFORE] = np.nan


def missing(run: BogieSignals) -> None:
    run.z[BEFORE, 3] = np.nan


def unknown_speed(run: BogieSignals) -> None:
    run.speed_m_s[BEFORE] = np.nan


def slow(run: BogieSignals) -> None:
    run.speed_m_s[:] = 8.0


def backwards(run: BogieSignals) -> None:
    run.speed_m_s[:] *= -1


def braking(run: BogieSignals) -> None:
    run.speed_m_s[:] -= 0.2 * TICK_S * np.arange(TICKS)


def curve(run: BogieSignals) -> None:
    run.z[BEFORE, 0] += SPEED_M_S / 2000
    run.z[BEFORE, 2] += SPEED_M_S / 2000


def flange(run: BogieSignals) -> None:
    run.z[AFTER, 1] += 2.0


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (gap, LeftOut.GAP), (missing, LeftOut.INPUTS), (unknown_speed, LeftOut.INPUTS), (slow, LeftOut.SLOW),
        (backwards, LeftOut.SLOW), (braking, LeftOut.UNSTEADY), (curve, LeftOut.CURVE), (flange, LeftOut.PULSE),
    ],
)  # fmt: skip
def test_what_is_not_calm_is_left_out_with_its_reason(change: Callable[[BogieSignals], None], reason: LeftOut) -> None:
    whole, none = blocks_of([calm()], WHEELBASE_M)
    blocks, left_out = blocks_of([changed(change)], WHEELBASE_M)
    assert left_out[reason] > none[reason]
    assert blocks.stretches.sum() + left_out.total() == whole.stretches.sum() + none.total()


def test_hole_of_a_tick_is_filled_in() -> None:
    def lost(run: BogieSignals) -> None:
        run.z[250::500, 1] = np.nan

    blocks, _ = blocks_of([changed(lost)], WHEELBASE_M)
    assert blocks.stretches.sum() == blocks_of([calm()], WHEELBASE_M)[0].stretches.sum()
    assert np.isfinite(blocks.cross).all()


def test_speeds_that_differ_are_blocks_of_their_own_and_a_lone_stretch_is_none() -> None:
    def two_speeds(run: BogieSignals) -> None:
        run.speed_m_s[TICKS // 2 :] = 1.5 * SPEED_M_S

    blocks, _ = blocks_of([changed(two_speeds)], WHEELBASE_M)
    np.testing.assert_allclose(blocks.speed_m_s, [SPEED_M_S, 1.5 * SPEED_M_S])
    short = calm()
    n = round(1.2 * STRETCH_S / TICK_S)
    short = BogieSignals(TICK_S, short.z[:n], short.speed_m_s[:n], short.ticked[:n])
    blocks, left_out = blocks_of([short], WHEELBASE_M)
    assert len(blocks) == 0
    assert left_out[LeftOut.ALONE] == 1


def test_runs_of_several_logs_are_put_together() -> None:
    one, two = (blocks_of([calm()] * n, WHEELBASE_M)[0] for n in (1, 2))
    assert len(two) == 2 * len(one)


def test_log_without_any_signal_has_no_stretch() -> None:
    run = replace(calm(), z=np.full((TICKS, 4), np.nan))
    blocks, left_out = blocks_of([run], WHEELBASE_M)
    assert len(blocks) == 0
    assert set(left_out) - {LeftOut.ALONE} == {LeftOut.INPUTS}
