"""Columns of a page: packing against a second reading of the format by numpy, missing frames, too many of them."""

import base64
import gzip
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.story_columns import synthetic
from wrcd.report.data import CODE, TIME, PackedTable, PageColumn, pack, step_of, tables, thin, with_gaps


def unpack(packed: PackedTable) -> dict[str, NDArray[np.float64]]:
    data = np.frombuffer(gzip.decompress(base64.b64decode(packed.text)), dtype=np.uint8)
    rows, offset = packed.head["rows"], 0
    out: dict[str, NDArray[np.float64]] = {}
    for head in packed.head["columns"]:
        width = head["width"]
        planes = data[offset : offset + width * rows].reshape(width, rows)
        offset += width * rows
        whole = np.ascontiguousarray(planes.T).view(f"<u{width}").reshape(rows).copy()
        for _ in range(head["order"]):
            whole = np.cumsum(whole, dtype=whole.dtype)
        values = (whole.astype(np.float64) + head["low"] - 1.0) * head["step"]
        values[whole == 0] = np.nan
        out[head["name"]] = values if not head.get("base") else out[head["base"]] + head["sign"] * values
    assert offset == len(data)
    return out


def test_numbers_are_kept_to_the_nearest_step() -> None:
    values = np.array([0.0, 12.345, -3.0, np.nan, 99.994, np.nan])
    found = unpack(pack({"x": PageColumn(values, 0.01)}))["x"]
    assert np.isnan(found).tolist() == np.isnan(values).tolist()
    assert np.nanmax(np.abs(found - values)) <= 0.005 + 1e-9


@pytest.mark.parametrize("count", [0, 1, 2, 1000])
def test_any_number_of_rows_comes_back(count: int) -> None:
    values = np.random.default_rng(count).normal(0.0, 1e4, count)
    found = unpack(pack({"x": PageColumn(values, step_of(values))}))["x"]
    assert len(found) == count
    assert np.allclose(found, values, atol=step_of(values) / 2 + 1e-9)


@pytest.mark.parametrize(("highest", "width"), [(253, 1), (254, 1), (255, 2), (65_534, 2), (65_535, 4)])
def test_width_is_the_least_that_holds_all_values_and_none(highest: int, width: int) -> None:
    values = np.array([0.0, highest, np.nan, 0.0])
    packed = pack({"x": PageColumn(values, 1.0)})
    assert packed.head["columns"][0]["width"] == width
    assert np.array_equal(unpack(packed)["x"], values, equal_nan=True)


def test_hours_of_time_stamps_keep_their_order() -> None:
    times = np.cumsum(np.random.default_rng(3).uniform(0.019, 0.021, 2_000_000))
    found = unpack(pack({"time": PageColumn(times, 1e-4, TIME)}))["time"]
    assert np.abs(found - times).max() <= 0.5e-4 + 1e-9
    assert (np.diff(found) > 0).all()


def test_time_of_years_takes_a_coarser_step() -> None:
    times = np.array([0.0, 1e6, 3e7])
    found = unpack(pack({"time": PageColumn(times, 1e-4, TIME)}))["time"]
    assert np.allclose(found, times, atol=0.01)


def test_code_below_zero_is_none() -> None:
    found = unpack(pack({"c": PageColumn(np.array([0, 3, -1, 127]), 1.0, CODE)}))["c"]
    assert np.array_equal(found, [0.0, 3.0, np.nan, 127.0], equal_nan=True)


def test_interval_comes_back_around_its_estimate() -> None:
    mu = np.array([10.0, 20.0, np.nan])
    table = {"mu": PageColumn(mu, 0.01), "low": PageColumn(np.array([1.0, 2.5, np.nan]), 0.01, base="mu", sign=-1)}
    assert np.allclose(unpack(pack(table))["low"], [9.0, 17.5, np.nan], equal_nan=True)


def test_infinite_value_is_none() -> None:
    found = unpack(pack({"x": PageColumn(np.array([1.0, np.inf, -np.inf]), 1.0)}))["x"]
    assert np.array_equal(found, [1.0, np.nan, np.nan], equal_nan=True)


def test_same_columns_give_the_same_bytes() -> None:
    table: dict[str, Any] = {"x": PageColumn(np.arange(100.0), 1.0)}
    assert pack(table).text == pack(table).text


@pytest.mark.parametrize(("widest", "step"), [(30_000.0, 1.0), (30_001.0, 2.0), (25.0, 0.001), (0.0, 1.0), (1e6, 50.0)])
def test_step_is_a_round_number_by_the_widest_value(widest: float, step: float) -> None:
    assert step_of(np.array([0.0, widest, np.nan])) == pytest.approx(step)


def test_row_of_nothing_stands_where_frames_are_missing() -> None:
    time_us = np.array([0, 20_000, 40_000, 1_000_000, 1_020_000])
    table = {
        "time": PageColumn(time_us / 1e6, 1e-4, TIME),
        "mu": PageColumn(np.arange(5.0), 0.01),
        "code": PageColumn(np.arange(5), 1.0, CODE),
    }
    found = with_gaps(table, time_us, 20_000)
    assert found["time"].values.tolist() == pytest.approx([0.0, 0.02, 0.04, 0.1, 1.0, 1.02, 1.08])
    assert np.array_equal(found["mu"].values, [0, 1, 2, np.nan, 3, 4, np.nan], equal_nan=True)
    assert found["code"].values.tolist() == [0, 1, 2, -1, 3, 4, -1]


def test_jitter_below_three_cycles_is_no_gap() -> None:
    time_us = np.array([0, 20_000, 79_000, 99_000, 119_000])
    table = {"time": PageColumn(time_us / 1e6, 1e-4, TIME)}
    assert len(with_gaps(table, time_us, 20_000)["time"].values) == 5 + 1


@pytest.mark.parametrize(
    ("time_us", "expected"), [([5], [5, 60_005]), ([0, 600_000_000], [0, 60_000, 600_000_000, 600_060_000])]
)
def test_value_of_few_rows_is_not_held_for_ever(time_us: list[int], expected: list[int]) -> None:
    times = np.array(time_us, np.int64)
    table = {"time": PageColumn(times / 1e6, 1e-6, TIME), "mu": PageColumn(np.ones(len(times)), 0.01)}
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
    cut = health.part(rows)
    table = tables(replace(story, axles=(replace(story.axles[0], health=cut),)))["axle1.inputs"]
    reach = table["yaw_reach"].values
    assert (reach == -1).any()
    assert reach.max() == 255
    assert pack(table).text
