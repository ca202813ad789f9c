"""Packing against a second reading of the format, by numpy."""

import base64
import gzip
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from wrcd.tools.report.columns import CODE, TIME, Column, Packed, pack, step_of


def unpack(packed: Packed) -> dict[str, NDArray[np.float64]]:
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
    found = unpack(pack({"x": Column(values, 0.01)}))["x"]
    assert np.isnan(found).tolist() == np.isnan(values).tolist()
    assert np.nanmax(np.abs(found - values)) <= 0.005 + 1e-9


@pytest.mark.parametrize("count", [0, 1, 2, 1000])
def test_any_number_of_rows_comes_back(count: int) -> None:
    values = np.random.default_rng(count).normal(0.0, 1e4, count)
    found = unpack(pack({"x": Column(values, step_of(values))}))["x"]
    assert len(found) == count
    assert np.allclose(found, values, atol=step_of(values) / 2 + 1e-9)


@pytest.mark.parametrize(("highest", "width"), [(253, 1), (254, 1), (255, 2), (65_534, 2), (65_535, 4)])
def test_width_is_the_least_that_holds_all_values_and_none(highest: int, width: int) -> None:
    values = np.array([0.0, highest, np.nan, 0.0])
    packed = pack({"x": Column(values, 1.0)})
    assert packed.head["columns"][0]["width"] == width
    assert np.array_equal(unpack(packed)["x"], values, equal_nan=True)


def test_hours_of_time_stamps_keep_their_order() -> None:
    times = np.cumsum(np.random.default_rng(3).uniform(0.019, 0.021, 2_000_000))
    found = unpack(pack({"time": Column(times, 1e-4, TIME)}))["time"]
    assert np.abs(found - times).max() <= 0.5e-4 + 1e-9
    assert (np.diff(found) > 0).all()


def test_time_of_years_takes_a_coarser_step() -> None:
    times = np.array([0.0, 1e6, 3e7])
    found = unpack(pack({"time": Column(times, 1e-4, TIME)}))["time"]
    assert np.allclose(found, times, atol=0.01)


def test_code_below_zero_is_none() -> None:
    found = unpack(pack({"c": Column(np.array([0, 3, -1, 127]), 1.0, CODE)}))["c"]
    assert np.array_equal(found, [0.0, 3.0, np.nan, 127.0], equal_nan=True)


def test_interval_comes_back_around_its_estimate() -> None:
    mu = np.array([10.0, 20.0, np.nan])
    table = {"mu": Column(mu, 0.01), "low": Column(np.array([1.0, 2.5, np.nan]), 0.01, base="mu", sign=-1)}
    assert np.allclose(unpack(pack(table))["low"], [9.0, 17.5, np.nan], equal_nan=True)


def test_infinite_value_is_none() -> None:
    found = unpack(pack({"x": Column(np.array([1.0, np.inf, -np.inf]), 1.0)}))["x"]
    assert np.array_equal(found, [1.0, np.nan, np.nan], equal_nan=True)


def test_same_columns_give_the_same_bytes() -> None:
    table: dict[str, Any] = {"x": Column(np.arange(100.0), 1.0)}
    assert pack(table).text == pack(table).text


@pytest.mark.parametrize(("widest", "step"), [(30_000.0, 1.0), (30_001.0, 2.0), (25.0, 0.001), (0.0, 1.0), (1e6, 50.0)])
def test_step_is_a_round_number_by_the_widest_value(widest: float, step: float) -> None:
    assert step_of(np.array([0.0, widest, np.nan])) == pytest.approx(step)
