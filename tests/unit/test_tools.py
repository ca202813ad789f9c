"""Two lists are one: what CI installs, and what a test or a stage can be left out for want of."""

import re
from pathlib import Path

import pytest

from tests.support.pages import ROOT
from tests.support.tools import PROGRAMS, missing

INSTALLED = {package for packages in PROGRAMS.values() for package in packages}
ALWAYS = {"make", "python3", "apt"}  # what runs `make test`, and what would bring the rest


def test_ci_installs_each_package_that_can_be_missing_and_no_other() -> None:
    tests = "\n".join(p.read_text() for p in (ROOT / "tests").rglob("*.py") if p != Path(__file__))
    stages = (ROOT / "tests/hil/guest/run").read_text() + (ROOT / "tests/all-stages").read_text()
    programs = re.findall(r'"([^"]+)"', " ".join(re.findall(r"\b(?:needs|missing)\((.*?)\)", tests)))
    named = re.findall(r"(?:^|[|&;]) *need \S+ ([a-z0-9-]+)", stages, re.MULTILINE)
    wanted = {package for program in programs for package in PROGRAMS[program]} | set(named)
    assert wanted | ALWAYS == INSTALLED | ALWAYS
    assert "tests/tools missing" in (ROOT / ".ci/run").read_text()


def test_missing_program_is_said_with_the_line_that_brings_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "git").symlink_to("/bin/true")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert missing("git") == ""
    assert missing("tmux", "git", "gcc") == "tmux and gcc missing; apt-get install tmux gcc libc6-dev"
