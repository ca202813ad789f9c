"""A fleet's page of a thousand logs in a browser: it opens, fits every screen, and leads from a sensor to its logs."""

from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser

from sim_ecu.campaign.fleet.fleet_page import page
from sim_ecu.campaign.fleet.summary import summary
from tests.browser.chromium import opened
from tests.support.fleet import broken, job, row

LOGS, TRAINS = 1000, 20
WIDEST = "Math.max(...[...document.querySelectorAll('table, svg, p, h2')].map(e => e.getBoundingClientRect().right))"
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


@pytest.mark.parametrize(("width", "scheme"), [(320, "dark"), (700, "light"), (1200, "light")])
def test_page_needs_no_sideways_scrolling(
    browser: Browser, fleet: Path, width: int, scheme: Literal["light", "dark"]
) -> None:
    with opened(browser, fleet, width, scheme=scheme, until="") as found:
        assert found.page.evaluate("document.documentElement.scrollWidth") == width
        found.page.evaluate("document.getElementById('train1').open = true")
        assert found.page.evaluate(WIDEST) <= width
        assert found.complaints == []


def test_link_of_a_suspicious_sensor_opens_the_log(browser: Browser, fleet: Path) -> None:
    with opened(browser, fleet, 1200, until="") as found:
        link = found.page.locator("#suspicious-sensors ~ table a").first
        row = found.page.locator(str(link.get_attribute("href")))
        assert not row.is_visible()
        link.click()
        row.wait_for(state="visible")
        assert "GyroDead" in row.inner_text()


def test_every_log_is_there_when_all_is_unfolded(browser: Browser, fleet: Path) -> None:
    with opened(browser, fleet, 1200, until="") as found:
        found.page.evaluate(OPEN_ALL)
        assert found.page.evaluate("document.querySelectorAll('tr[id^=log]').length") == LOGS
        assert found.page.evaluate("document.querySelectorAll('svg.columns').length") == LOGS - LOGS // 100
