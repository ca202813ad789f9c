"""Pause, cursor, zoom and jumps."""

import pytest

from wrcd.tools.monitor.happenings import Happening
from wrcd.tools.monitor.view import View

S = 1_000_000
BEGIN, NOW, WIDTH = 1000 * S, 1100 * S, 60
FOUND = [Happening(1010 * S, "one", True), Happening(1050 * S, "two", False), Happening(1090 * S, "three", True)]


def test_live_view_moves_on_with_time() -> None:
    view = View()
    assert view.is_live
    assert view.at_us(NOW + 5 * S) == NOW + 5 * S
    assert view.window(NOW + 5 * S, WIDTH).end_us >= NOW + 5 * S


def test_paused_view_stands_still_and_resumes_at_the_newest() -> None:
    view = View()
    view.pause(NOW)
    later = NOW + 30 * S
    assert (view.at_us(later), view.window(later, WIDTH)) == (NOW, view.window(NOW, WIDTH))
    view.resume()
    assert view.at_us(later) == later


def test_cursor_left_of_the_plot_takes_it_along() -> None:
    view = View()
    for _ in range(100):
        view.move(-10, NOW, BEGIN, WIDTH)
        w = view.window(NOW, WIDTH)
        assert view.cursor_us is not None
        assert w.begin_us <= view.cursor_us < w.end_us
    assert view.cursor_us == BEGIN
    assert not view.is_live


def test_cursor_goes_neither_before_the_beginning_nor_beyond_the_newest() -> None:
    view = View()
    view.move(-100_000, NOW, BEGIN, WIDTH)
    assert view.cursor_us == BEGIN
    view.move(1_000_000, NOW, BEGIN, WIDTH)
    assert view.cursor_us == NOW


@pytest.mark.parametrize("closer", [True, False])
def test_zoom_keeps_the_cursor_in_the_plot(closer: bool) -> None:
    view = View()
    view.go(1040 * S, NOW, BEGIN, WIDTH)
    for _ in range(30):
        view.zoom(closer, NOW, WIDTH)
        w = view.window(NOW, WIDTH)
        assert w.begin_us <= 1040 * S < w.end_us
    assert view.span_s == (2 if closer else 86400)


def test_jump_without_a_cursor_goes_to_the_newest_happening() -> None:
    view = View()
    assert view.jump(FOUND, True, NOW, BEGIN, WIDTH) == FOUND[2]
    assert view.cursor_us == FOUND[2].time_us
    assert not view.is_live


def test_jumps_go_through_all_happenings_and_stop_at_the_ends() -> None:
    view = View()
    back = [view.jump(FOUND, False, NOW, BEGIN, WIDTH) for _ in range(4)]
    assert back == [*reversed(FOUND), None]
    assert view.cursor_us == FOUND[0].time_us
    forward = [view.jump(FOUND, True, NOW, BEGIN, WIDTH) for _ in range(3)]
    assert forward == [FOUND[1], FOUND[2], None]


def test_happening_after_the_pause_is_not_jumped_to() -> None:
    view = View()
    view.pause(1060 * S)
    assert view.jump(FOUND, True, NOW, BEGIN, WIDTH) == FOUND[1]
    assert view.jump(FOUND, True, NOW, BEGIN, WIDTH) is None
