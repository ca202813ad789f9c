"""Every command of the pages that needs no bus does what the page says: it runs, and ends as it should."""

import re
from collections import Counter
from pathlib import Path

import pytest

from tests.support.page_commands import pages_with_steps, run_page, steps, to_run
from tests.support.pages import ROOT, pages

# Why nobody runs a block, and how many blocks may say so.
REASONS = {
    "it asks a package index": 1,
    "it is all tests": 2,
    "it writes the pages": 1,
    "minutes": 4,
    "it needs the dump of your train": 1,
    "it would overwrite a golden file": 1,
}
COMMAND = re.compile(
    r"^ {4,}(?:\.venv|wrcd|sim-ecu|make|sudo|ip|candump|python3?|pip|systemctl|tests/with-vcan)(?: .*)?$", re.MULTILINE
)
KINDS = {"sh", "text", "toml", "python", "c"}
PAGES = [p for p in pages() if p.name != "CHANGELOG.md"]
HERE = [p for p in pages_with_steps() if to_run(p, frozenset())]


@pytest.mark.night
@pytest.mark.parametrize("page", HERE, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    run_page(page, tmp_path, frozenset())


def test_reasons_for_not_running_a_block_are_few_and_known() -> None:
    said = Counter(s.not_run for p in pages() for s in steps(p) if s.not_run)
    assert {r: n for r, n in said.items() if n > REASONS.get(r, 0)} == {}
    assert set(REASONS) <= set(said), "a reason that no block gives"


def test_commands_that_another_test_runs_stand_in_it() -> None:
    others = [s for p in pages() for s in steps(p) if s.run_by]
    assert others
    missing = []
    for step in others:
        assert step.run_by
        assert step.run_by.startswith("tests/")
        text = (ROOT / step.run_by).read_text(encoding="utf-8")
        if f'run_by("{step.run_by}", "{step.page.relative_to(ROOT)}")' in text:
            continue  # it takes them from the page
        missing += [(step.name, c) for c in step.commands if f" {_words(c)} " not in f" {_words(text)} "]
    assert missing == []


def _words(text: str) -> str:
    """A command's words, or those of a call that runs it: walk.sim_ecu("demo", "--config", file)."""
    return " ".join(re.sub(r"[\"',()]", " ", text.replace("walk.", " ").replace("_", "-")).split())


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_fence_names_its_kind(page: Path) -> None:
    opened = re.findall(r"^ *```(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)[::2]
    assert set(opened) <= KINDS


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_no_command_hides_in_an_indented_block(page: Path) -> None:
    outside = re.sub(r"^( *)```.*?^\1```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    assert COMMAND.findall(outside) == []
