"""The score's page and that of a fleet of a thousand logs in a browser: they fit every screen, light and dark, ask for
nothing, and the fleet's leads from a sensor to its logs."""

from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser

from sim_ecu.campaign.fleet.fleet_page import page
from sim_ecu.campaign.fleet.summary import summary
from sim_ecu.cli.main import main
from tests.browser.chromium import opened
from tests.support.fleet import broken, job, row

LOGS, TRAINS = 1000, 20
WIDEST = (
    "Math.max(...[...document.querySelectorAll('table, svg, img, p, h2')].map(e => e.getBoundingClientRect().right))"
)
OPEN_ALL = "document.querySelectorAll('details').forEach(d => d.open = true)"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every hundredth log is broken, every tenth has a dead gyro."""
    dead, sound = row(suspects=(("GyroDead", 1, 5.0),)), row()
    rows = [broken() if k % 100 == 99 else dead if k % 10 == 0 else sound for k in range(LOGS)]
    pairs = [(job(f"{7400 + k % TRAINS}", f"ride-{k:04}.log"), one) for k, one in enumerate(rows)]
    file = tmp_path_factory.mktemp("fleet") / "summary.html"
    file.write_text(page(summary("Logs of a fleet", pairs), "/logs", {}), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def score(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quick score of the suite with the widest table."""
    file = tmp_path_factory.mktemp("score") / "score.html"
    assert main(["score", "--suite", "paper", "--quick", "--html", str(file)]) == 0
    return file


@pytest.mark.parametrize("which", ["fleet", "score"])
@pytest.mark.parametrize(("width", "scheme"), [(320, "dark"), (400, "light"), (700, "dark"), (1200, "light")])
def test_page_needs_no_sideways_scrolling(
    browser: Browser, which: str, width: int, scheme: Literal["light", "dark"], request: pytest.FixtureRequest
) -> None:
    with opened(browser, request.getfixturevalue(which), width, scheme=scheme, until="") as found:
        assert found.page.evaluate("document.documentElement.scrollWidth") == width
        found.page.evaluate("document.getElementById('train1')?.setAttribute('open', '')")
        assert found.page.evaluate(WIDEST) <= width
        assert found.complaints == []


def test_link_of_a_suspicious_sensor_opens_the_log_and_every_log_is_there_unfolded(
    browser: Browser, fleet: Path
) -> None:
    with opened(browser, fleet, 1200, until="") as found:
        link = found.page.locator("#suspicious-sensors ~ table a").first
        row = found.page.locator(str(link.get_attribute("href")))
        assert not row.is_visible()
        link.click()
        row.wait_for(state="visible")
        assert "GyroDead" in row.inner_text()
        found.page.evaluate(OPEN_ALL)
        assert found.page.evaluate("document.querySelectorAll('tr[id^=log]').length") == LOGS
        assert found.page.evaluate("document.querySelectorAll('svg.columns').length") == LOGS - LOGS // 100


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
