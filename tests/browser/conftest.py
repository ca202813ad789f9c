"""One browser and one report for all tests of a module."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from tests.browser.chromium import PATH, Opened, chromium, opened
from tests.support.story_columns import synthetic
from wrcd.logs.story_records import Story
from wrcd.report import report_page as report


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if not Path(PATH).exists():
        pytest.skip(f"there is no {PATH}; install Debian's package chromium")
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def story() -> Story:
    return synthetic(60.0, 2)


@pytest.fixture(scope="module")
def file(story: Story, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("report") / "report.html"
    report.write(story, None, output)
    return output


@pytest.fixture
def shown(browser: Browser, file: Path) -> Iterator[Opened]:
    with opened(browser, file) as found:
        yield found
        assert found.complaints == []
