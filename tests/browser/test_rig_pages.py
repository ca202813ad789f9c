"""The score's page in a browser: it fits every screen, light and dark, and asks for nothing."""

from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser

from sim_ecu.cli.main import main
from tests.browser.chromium import opened

WIDEST = (
    "Math.max(...[...document.querySelectorAll('table, svg, img, p, h2')].map(e => e.getBoundingClientRect().right))"
)


@pytest.fixture(scope="module")
def score(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quick score of the suite with the widest table."""
    file = tmp_path_factory.mktemp("score") / "score.html"
    assert main(["score", "--suite", "paper", "--quick", "--html", str(file)]) == 0
    return file


@pytest.mark.parametrize(("width", "scheme"), [(320, "dark"), (400, "light"), (700, "dark"), (1200, "light")])
def test_page_needs_no_sideways_scrolling(
    browser: Browser, score: Path, width: int, scheme: Literal["light", "dark"]
) -> None:
    with opened(browser, score, width, scheme=scheme, until="") as found:
        assert found.page.evaluate("document.documentElement.scrollWidth") == width
        assert found.page.evaluate(WIDEST) <= width
        assert found.complaints == []


def test_rows_of_a_wide_table_become_cards_that_name_every_value(browser: Browser, score: Path) -> None:
    row = "document.querySelector('.wide tbody tr')"
    with opened(browser, score, 1200, until="") as found:
        assert found.page.evaluate(f"getComputedStyle({row}).display") == "table-row"
    with opened(browser, score, 400, until="") as found:
        assert found.page.evaluate(f"getComputedStyle({row}).display") == "block"
        label = f"getComputedStyle({row}.querySelector('td'), '::before').content"
        assert found.page.evaluate(label) == '"true, %"'


def test_pictures_follow_width_and_scheme(browser: Browser, score: Path) -> None:
    shown = set()
    for width in (400, 1200):
        for scheme in ("light", "dark"):
            with opened(browser, score, width, scheme=scheme, until="") as found:
                shown.add(found.page.evaluate("document.querySelector('img').currentSrc"))
    assert len(shown) == 4


def test_quick_is_seen_without_scrolling(browser: Browser, score: Path) -> None:
    with opened(browser, score, 400, 700, until="") as found:
        box = found.page.locator("[role=note]").bounding_box()
        assert box is not None
        assert box["y"] + box["height"] < 700


def test_page_is_light_on_paper(browser: Browser, score: Path) -> None:
    with opened(browser, score, 1200, scheme="dark", until="") as found:
        found.page.emulate_media(media="print")
        assert found.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        assert found.page.evaluate("getComputedStyle(document.querySelector('.wide tbody tr')).display") == "table-row"
        assert len(found.page.pdf(format="A4")) > 20_000
