"""The report in a headless chromium: it is drawn, it zooms, it explains, and it fits a narrow screen."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.chromium import Opened, chromium, opened
from tests.support.story_columns import BEGIN_US, synthetic
from tests.support.tools import needs
from wrcd.report import report_page

SECONDS, AXLES = 60.0, 2
WIDE, NARROW = 1280, 400
NOT_DRAWN = """() => [...document.querySelectorAll("figure[data-plot]")].filter((f) => !f.querySelector(".plot > *"))
  .map((f) => f.dataset.plot)"""


def shown_range(found: Opened) -> tuple[float, float]:
    """Seconds in view, as the panel says them."""
    found.settle()
    seconds = re.findall(r"([\d.]+) s", found.page.locator("#range").inner_text())
    return float(seconds[0]), float(seconds[1])


def cursor_s(found: Opened) -> float:
    found.settle()
    return float(found.page.locator("#moment").inner_text().split(" s")[0])


def fits(found: Opened, width: int) -> None:
    assert found.page.evaluate("document.documentElement.scrollWidth") <= width


@needs("chromium", "libatomic.so.1")
def test_report_is_drawn_zooms_explains_and_fits_a_narrow_screen(tmp_path: Path) -> None:
    file, two = tmp_path / "report.html", tmp_path / "two.html"
    story = synthetic(SECONDS, AXLES)
    report_page.write(story, None, file)
    report_page.write(story, replace(synthetic(SECONDS, AXLES, seed=2), log=Path("other.log")), two)
    with chromium() as browser:
        with opened(browser, file, WIDE) as found:
            page = found.page
            assert page.locator("#trouble").is_hidden()
            plots = page.locator("figure[data-plot]").count()
            assert plots >= 15
            assert page.evaluate("Bokeh.documents.length") == plots
            assert page.evaluate(NOT_DRAWN) == []
            for axle in range(1, AXLES + 1):
                assert page.locator(f'figure[data-plot="axle{axle}.time"]').count() == 1
            fits(found, WIDE)
            box = page.locator('figure[data-plot="axle1.time"]').bounding_box()
            assert box is not None
            assert box["width"] > 0.9 * WIDE  # what stands at the cursor is below, not beside
            begins_s = [(e.begin_us - BEGIN_US) / 1e6 for e in story.axles[0].events]
            for key, event in (("n", 0), ("n", 1), ("p", 0)):
                page.keyboard.press(key)
                assert cursor_s(found) == pytest.approx(begins_s[event], abs=0.002)
            page.keyboard.press("Escape")
            page.keyboard.press("Home")
            page.keyboard.press("+")  # at the cursor
            low, high = shown_range(found)
            assert high - low == pytest.approx(SECONDS * 2 / 3, abs=0.05)
            page.keyboard.press("Home")
            assert shown_range(found) == (0.0, SECONDS)
            page.locator("button.fall", has_text="axle 2").first.click()
            low, high = shown_range(found)
            assert 0.0 < low < high < SECONDS
            told, a = page.inner_text("#explanation"), story.axles[1].adhesion
            row = int(np.searchsorted(a.time_us, BEGIN_US + round(cursor_s(found) * 1e6), side="right")) - 1
            assert f"available {a.available_pct[row]:.2f} %" in told
            assert re.search(r"Rule \d+: ", told)
            assert page.locator('#axles button[aria-checked="true"]').inner_text() == "axle 2"
            assert found.complaints == []
        with opened(browser, two, WIDE) as found:
            assert found.page.evaluate(NOT_DRAWN) == []
            assert "other.log" in found.page.inner_text("body")
            assert found.complaints == []
        with opened(browser, file, NARROW) as found:
            fits(found, NARROW)
            found.page.locator("button.fall").first.click()
            found.settle()
            fits(found, NARROW)
            assert found.complaints == []
