"""Missing frames and too many of them."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.story_columns import synthetic
from wrcd.tools.report.columns import CODE, TIME, Column, pack
from wrcd.tools.report.gaps import thin, with_gaps
from wrcd.tools.report.tables import tables


def test_row_of_nothing_stands_where_frames_are_missing() -> None:
    time_us = np.array([0, 20_000, 40_000, 1_000_000, 1_020_000])
    table = {
        "time": Column(time_us / 1e6, 1e-4, TIME),
        "mu": Column(np.arange(5.0), 0.01),
        "code": Column(np.arange(5), 1.0, CODE),
    }
    found = with_gaps(table, time_us, 20_000)
    assert found["time"].values.tolist() == pytest.approx([0.0, 0.02, 0.04, 0.1, 1.0, 1.02, 1.08])
    assert np.array_equal(found["mu"].values, [0, 1, 2, np.nan, 3, 4, np.nan], equal_nan=True)
    assert found["code"].values.tolist() == [0, 1, 2, -1, 3, 4, -1]


def test_jitter_below_three_cycles_is_no_gap() -> None:
    time_us = np.array([0, 20_000, 79_000, 99_000, 119_000])
    table = {"time": Column(time_us / 1e6, 1e-4, TIME)}
    assert len(with_gaps(table, time_us, 20_000)["time"].values) == 5 + 1


@pytest.mark.parametrize(
    ("time_us", "expected"), [([5], [5, 60_005]), ([0, 600_000_000], [0, 60_000, 600_000_000, 600_060_000])]
)
def test_value_of_few_rows_is_not_held_for_ever(time_us: list[int], expected: list[int]) -> None:
    times = np.array(time_us, np.int64)
    table = {"time": Column(times / 1e6, 1e-6, TIME), "mu": Column(np.ones(len(times)), 0.01)}
    found = with_gaps(table, times, 20_000)
    assert np.rint(found["time"].values * 1e6).astype(int).tolist() == expected
    assert np.isnan(found["mu"].values[1::2]).all()


def test_thinned_column_keeps_extremes_changes_and_both_ends() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(20.0, 1.0, 100_000).astype(np.float32)
    values[54_321], values[98_765], values[40_000:41_000] = 1.0, 90.0, np.nan
    codes = np.zeros(100_000, dtype=np.int8)
    codes[70_001:70_003] = 2
    rows = thin(values, (codes,), 10_000)
    assert rows is not None
    assert len(rows) <= 10_100
    assert {54_321, 98_765, 70_001, 70_003, 99_999} <= set(rows.tolist())
    assert rows[0] < 20
    assert (np.diff(rows) > 0).all()
    assert np.isnan(values[rows]).any()


def test_table_within_the_limit_is_kept_whole() -> None:
    assert thin(np.zeros(100, dtype=np.float32), (), 100) is None


def test_input_health_with_a_gap_is_packed() -> None:
    story = synthetic(20.0, 1)
    health = story.axles[0].health
    assert health is not None
    rows = (health.time_us < health.time_us[50]) | (health.time_us > health.time_us[90])
    cut = type(health)(*(getattr(health, name)[rows] for name in health.__slots__))
    table = tables(replace(story, axles=(replace(story.axles[0], health=cut),)))["axle1.inputs"]
    reach = table["yaw_reach"].values
    assert (reach == -1).any()
    assert reach.max() == 255
    assert pack(table).text
