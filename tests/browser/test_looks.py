"""How the report looks: complete, narrow, dark, printed; and what it says to a browser that is too old."""

import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from playwright.sync_api import Browser

from tests.browser.chromium import Opened, opened
from tests.browser.reading import colours_above_words, corner, plot, settle, tick_labels
from wrcd.logs.story_records import Story
from wrcd.logs.why import CONTACTS
from wrcd.report import report_page as report

# before the page's own listener, which takes them away again
COUNT_PICTURES = """addEventListener("afterprint", () => {
  window.pictures = document.querySelectorAll("img.printed").length;
});"""


def test_all_plots_are_drawn_without_a_complaint_or_a_request(shown: Opened) -> None:
    plots = shown.page.locator("figure[data-plot]").count()
    assert plots >= 15
    assert shown.page.evaluate("Bokeh.documents.length") == plots
    assert shown.page.locator("#trouble").is_hidden()


@pytest.mark.parametrize("width", [400, 1200])
def test_page_never_scrolls_sideways(browser: Browser, file: Path, width: int) -> None:
    with opened(browser, file, width) as found:
        page = found.page
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.locator("button.fall").first.click()
        settle(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert plot(page, "axle1.residuals")["width"] > 0.6 * width
        assert found.complaints == []


@pytest.mark.parametrize("width", [400, 1200])
def test_labels_of_ticks_do_not_touch(browser: Browser, file: Path, width: int) -> None:
    with opened(browser, file, width) as found:
        page = found.page
        for key in ("overview", "axle1.time", "axle1.distance", "ages"):
            plot(page, key)
            for zoom in range(3):
                labels = tick_labels(page, key)
                assert len(labels) >= 2
                for (_, end), (begin, _) in itertools.pairwise(labels):
                    assert begin - end > 8, (key, zoom, labels)
                page.keyboard.press("+")
                settle(page)
            page.keyboard.press("Home")
            settle(page)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_pattern_goes_through_a_word(
    browser: Browser, story: Story, tmp_path: Path, scheme: Literal["light", "dark"]
) -> None:
    axle = story.axles[0]
    saturated = np.full_like(axle.adhesion.contact, CONTACTS.index("Saturated"))
    axle = replace(axle, adhesion=replace(axle.adhesion, contact=saturated))
    report.write(replace(story, axles=(axle,)), None, tmp_path / "report.html")
    with opened(browser, tmp_path / "report.html", scheme=scheme) as found:
        plot(found.page, "axle1.states")
        words = colours_above_words(found.page, "axle1.states")
        assert "Saturated" in words
        for word, lines in words.items():
            assert min(lines) < 4, word  # its block's, and of an edge


def test_dark_is_dark_in_plots_too_and_follows_a_change(browser: Browser, file: Path) -> None:
    with opened(browser, file, scheme="dark") as found:
        page = found.page
        plot(page, "overview")
        assert max(corner(page, "overview")) < 80
        page.emulate_media(color_scheme="light")
        plot(page, "overview")
        assert min(corner(page, "overview")) > 200
        assert found.complaints == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_print_has_every_plot_in_light_colours(browser: Browser, file: Path, scheme: Literal["light", "dark"]) -> None:
    with opened(browser, file, scheme=scheme, script=COUNT_PICTURES) as found:
        page = found.page
        plots = page.locator("figure[data-plot]").count()
        pdf = page.pdf(prefer_css_page_size=True, print_background=True)
        assert page.evaluate("window.pictures") == plots
        assert len(re.findall(rb"/Subtype\s*/Image", pdf)) >= plots - 2  # equal pictures are kept once
        assert len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 4
        assert page.locator("img.printed").count() == 0
        assert found.complaints == []


def test_browser_that_cannot_unpack_says_so_and_has_the_verdict(browser: Browser, file: Path) -> None:
    with opened(browser, file, script="delete window.DecompressionStream;", until="") as found:
        trouble = found.page.locator("#trouble")
        trouble.wait_for(state="visible")
        assert "DecompressionStream" in trouble.inner_text()
        assert found.page.locator("#verdict").is_visible()
