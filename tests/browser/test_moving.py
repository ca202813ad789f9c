"""One zoom and one cursor over all plots: keys, wheel, drag, click."""

import numpy as np
import pytest

from tests.browser.chromium import Opened
from tests.browser.reading import moment, plot, range_of, settle, shown_range
from tests.support.story_columns import BEGIN_US
from wrcd.logs.story_records import Story


def test_keys_zoom_move_and_step(shown: Opened) -> None:
    page = shown.page

    def press(*keys: str) -> tuple[float, float]:
        for key in keys:
            page.keyboard.press(key)
        settle(page)
        return shown_range(page)

    low, high = press("+")
    assert high - low == pytest.approx(40.0, abs=0.05)
    assert press("]")[0] == pytest.approx(20.0, abs=0.05)
    assert press("[", "[")[0] == 0.0
    assert press("-", "-") == (0.0, 60.0)
    press("ArrowRight")
    first = moment(page)
    press("ArrowRight")
    assert moment(page) == pytest.approx(first + 0.3, abs=0.002)
    press("Shift+ArrowRight")
    frame = moment(page)
    press("Shift+ArrowRight")
    assert 0.015 < moment(page) - frame < 0.025
    press("2")
    assert "axle 2" in page.locator("#moment").inner_text()
    assert press("+", "Home") == (0.0, 60.0)


def test_keys_n_and_p_go_from_event_to_event(shown: Opened, story: Story) -> None:
    page = shown.page
    begins = [(e.begin_us - BEGIN_US) / 1e6 for e in story.axles[0].events]
    for key, place in (("n", 0), ("n", 1), ("n", 2), ("p", 1), ("p", 0)):
        page.keyboard.press(key)
        settle(page)
        assert moment(page) == pytest.approx(begins[place], abs=0.002)


def test_buttons_do_what_the_keys_do(shown: Opened) -> None:
    page = shown.page
    page.locator('[data-do="in"]').click()
    settle(page)
    low, high = shown_range(page)
    assert high - low == pytest.approx(40.0, abs=0.05)
    page.locator('[data-do="home"]').click()
    settle(page)
    assert shown_range(page) == (0.0, 60.0)


def test_one_zoom_holds_for_all_plots_those_in_view_later_too(shown: Opened) -> None:
    page = shown.page
    box = plot(page, "axle1.states")
    page.mouse.move(box["x"] + 500, box["y"] + 40)
    page.keyboard.down("Control")
    for _ in range(5):
        page.mouse.wheel(0, -120)
    page.keyboard.up("Control")
    settle(page)
    low, high = shown_range(page)
    assert 5.0 < high - low < 40.0
    for key in ("axle1.time", "axle1.states", "axle1.residuals", "torque", "daemon", "load"):
        plot(page, key)
        assert range_of(page, key) == pytest.approx([low, high], abs=0.02), key


def test_distance_and_its_cursor_follow_time(shown: Opened, story: Story) -> None:
    page = shown.page
    page.locator("button.fall").first.click()
    plot(page, "axle1.distance")
    assert story.distance is not None
    seconds = (story.distance.time_us - BEGIN_US) / 1e6
    expected = np.interp(shown_range(page), seconds, story.distance.values["distance_m"]) / 1000.0
    assert range_of(page, "axle1.distance") == pytest.approx(expected.tolist(), abs=0.002)
    assert page.locator('figure[data-plot="axle1.distance"] .line').is_visible()


def test_wheel_without_a_key_scrolls_the_page(shown: Opened) -> None:
    page = shown.page
    box = plot(page, "axle1.time")
    page.mouse.move(box["x"] + 300, box["y"] + 60)
    before, top = shown_range(page), page.evaluate("scrollY")
    page.mouse.wheel(0, 200)
    page.wait_for_timeout(300)
    assert page.evaluate("scrollY") > top
    assert shown_range(page) == before


def test_drag_zooms_to_what_is_marked_and_double_click_back(shown: Opened) -> None:
    page = shown.page
    box = plot(page, "axle1.time")
    page.mouse.move(box["x"] + 300, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 80, steps=4)
    assert page.locator('figure[data-plot="axle1.time"] .mark').is_visible()
    page.mouse.up()
    settle(page)
    low, high = shown_range(page)
    assert 4.0 < high - low < 10.0
    page.mouse.dblclick(box["x"] + 300, box["y"] + 60)
    settle(page)
    assert shown_range(page) == (0.0, 60.0)


def test_click_keeps_the_cursor_until_escape(shown: Opened) -> None:
    page = shown.page
    box = plot(page, "axle1.time")
    page.mouse.click(box["x"] + 300, box["y"] + 60)
    settle(page)
    kept = page.locator("#moment").inner_text()
    assert kept.endswith("fixed")
    page.mouse.move(box["x"] + 500, box["y"] + 60)
    settle(page)
    assert page.locator("#moment").inner_text() == kept
    page.keyboard.press("Escape")
    page.mouse.move(box["x"] + 510, box["y"] + 60)
    settle(page)
    assert page.locator("#moment").inner_text() != kept


def test_folded_part_shows_the_present_zoom_when_it_is_opened_again(shown: Opened) -> None:
    page = shown.page
    plot(page, "speed")
    page.locator("#train > summary").click()
    page.locator("button.fall").first.click()
    page.locator("#train > summary").click()
    plot(page, "speed")
    assert range_of(page, "speed") == pytest.approx(shown_range(page), abs=0.02)
