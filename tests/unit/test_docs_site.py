"""The site of the pages builds without a warning and offline, and its links, anchors and pictures are there."""

from pathlib import Path

import pytest

from tests.support import site
from tests.support.pages import ROOT, pages


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    assert site.build(folder) == ""
    return folder


def test_every_page_is_in_the_site_and_the_first_is_the_readme(built: Path) -> None:
    for page in pages():
        assert (built / page.relative_to(ROOT)).with_suffix(".html").is_file(), page
    assert (built / "index.html").read_text() == (built / "README.html").read_text()


def test_links_anchors_and_pictures_of_the_site_are_there_and_nothing_is_fetched(built: Path) -> None:
    assert site.broken(built) == []


def test_search_finds_words_of_a_page_without_a_server(built: Path) -> None:
    index = (built / "searchindex.js").read_text()
    assert index.startswith("Search.setIndex(")  # a script, which a page on a disk may load
    assert "docs/reference/validity" in index
    assert '"wheelsetunlik"' in index


def test_dead_links_and_foreign_pictures_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<p id="here"><a href="#here">x</a><a href="#gone">x</a><a href="b.html">x</a><a href="c.html#it">x</a>'
        '<img src="https://example.org/p.png"><a href="https://example.org">x</a>'
    )
    (tmp_path / "c.html").write_text('<p id="it">')
    assert site.broken(tmp_path) == ["a.html: fetches https://example.org/p.png", "a.html: #gone", "a.html: b.html"]
