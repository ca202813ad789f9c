"""The site of the pages, as `make docs` builds it: offline, and without a warning of a dead link, anchor or picture."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.pages import ROOT, pages


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built by the Makefile's own words."""
    folder = tmp_path_factory.mktemp("site")
    (words,) = re.findall(r"-m (sphinx .*) build/site$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    done = subprocess.run(
        [sys.executable, "-m", *words.split(), folder], cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, "")
    return folder


def test_every_page_is_in_the_site_and_fetches_nothing_and_the_first_is_the_readme(built: Path) -> None:
    for page in pages():
        text = (built / page.relative_to(ROOT)).with_suffix(".html").read_text()
        assert re.findall(r"<(?:img|script|link|iframe|source)\b[^>]*(?:href|src)=\"(?:https?:)?//", text) == [], page
    assert (built / "index.html").read_text() == (built / "README.html").read_text()


def test_search_finds_words_of_a_page_without_a_server(built: Path) -> None:
    index = (built / "searchindex.js").read_text()
    assert index.startswith("Search.setIndex(")  # a script, which a page on a disk may load
    assert "docs/reference/validity" in index
    assert '"wheelsetunlik"' in index
