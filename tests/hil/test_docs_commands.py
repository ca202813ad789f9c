"""Every command of the pages that needs a bus runs on a real kernel's vcan0."""

import os
import shutil
from pathlib import Path

import pytest

from tests.support.page_commands import pages_with_steps, run_page, to_run
from tests.support.pages import ROOT

GUEST = os.environ.get("GUEST") == "uml"
HAS = frozenset({"vcan", "guest"} if GUEST else {"vcan"})
HERE = [p for p in pages_with_steps() if to_run(p, HAS)]


@pytest.mark.parametrize("page", HERE, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_commands_of_a_page_run_on_vcan(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which("sudo") is None:  # who is root already has no need of it
        sudo = tmp_path / "sudo"
        sudo.write_text('#!/bin/sh\nexec "$@"\n')
        sudo.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    work = tmp_path / "work"
    work.mkdir()
    run_page(page, work, HAS)
