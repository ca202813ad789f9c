"""Curves in characters."""

import numpy as np
import pytest

from wrcd.monitor.canvas import (
    STEPS,
    TOPS,
    Canvas,
    Rect,
    carried,
    draw_area,
    draw_band,
    draw_line,
    draw_marks,
    extremes,
    top_of,
    window,
)


def lines(canvas: Canvas) -> list[str]:
    return canvas.text().split("\n")


def test_extremes_are_of_each_step_alone() -> None:
    times = np.array([0, 5, 10, 30, 39], dtype=np.int64)
    low, high = extremes(times, np.array([1, 3, 2, 7, 5], dtype=np.float32), 0, 10, 4)
    assert low.tolist() == [1.0, 2.0, pytest.approx(np.nan, nan_ok=True), 5.0]
    assert high.tolist() == [3.0, 2.0, pytest.approx(np.nan, nan_ok=True), 7.0]


def test_extremes_leave_out_frames_without_a_value() -> None:
    low, high = extremes(np.arange(3), np.array([np.nan, 4, np.nan], dtype=np.float32), 0, 3, 1)
    assert (low[0], high[0]) == (4.0, 4.0)


def test_value_is_carried_no_further_than_asked() -> None:
    values = np.array([1.0, np.nan, np.nan, np.nan, 2.0, np.nan])
    assert np.nan_to_num(carried(values, 2)).tolist() == [1, 1, 1, 0, 2, 2]


def test_line_at_the_scales_ends_is_within_the_plot() -> None:
    canvas = Canvas(2, 2)
    draw_line(canvas, Rect(0, 0, 2, 2), np.array([0.0, 0, 10, 10]), np.array([0.0, 0, 10, 10]), 10.0, "available")
    assert lines(canvas) == [" ⡏", "⣀⡇"]


def test_line_beyond_the_scale_runs_along_its_edge() -> None:
    canvas = Canvas(1, 2)
    draw_line(canvas, Rect(0, 0, 1, 2), np.array([99.0, 99.0]), np.array([99.0, 99.0]), 10.0, "available")
    assert lines(canvas) == ["⠉", ""]


def test_line_without_values_draws_nothing() -> None:
    canvas = Canvas(3, 2)
    none = np.full(6, np.nan)
    draw_line(canvas, Rect(0, 0, 3, 2), none, none, 10.0, "available")
    assert canvas.text().strip() == ""


def test_step_of_a_line_is_joined() -> None:
    canvas = Canvas(1, 4)
    draw_line(canvas, Rect(0, 0, 1, 4), np.array([1.0, 9.0]), np.array([1.0, 9.0]), 10.0, "available")
    assert all(line for line in lines(canvas))


def test_area_has_an_edge_in_eighths_and_dots_below() -> None:
    canvas = Canvas(3, 3)
    draw_area(canvas, Rect(0, 0, 3, 3), np.array([0.0, 2.0, 3.0]), 3.0, "used")
    assert lines(canvas) == ["  █", " █·", " ··"]


def test_band_and_truth_have_shapes_of_their_own() -> None:
    canvas = Canvas(2, 4)
    draw_band(canvas, Rect(0, 0, 2, 4), np.array([4.0, np.nan]), np.array([8.0, np.nan]), 16.0, "interval")
    draw_marks(canvas, Rect(0, 0, 2, 4), np.array([np.nan, 15.0]), 16.0, "truth")
    assert lines(canvas)[0] == " ╌"
    assert "░" in canvas.text()
    assert {c for line in lines(canvas) for c in line[1:]} <= {" ", "╌"}


def test_scale_shows_the_highest_value_in_whole_steps() -> None:
    assert [top_of(x) for x in (0.0, 4.8, 5.1, 38.0, 50.0, 1000.0)] == [5, 5, 10, 40, 60, 100]
    assert all((top / STEPS[top]) % 1 == 0 for top in TOPS)


def test_window_moves_by_whole_cells() -> None:
    first = window(100_000_000, 30_000_000, 60)
    assert window(100_200_000, 30_000_000, 60).begin_us in (first.begin_us, first.begin_us + first.cell_us)
    assert first.end_us >= 100_000_000
    assert first.begin_us % first.cell_us == 0
