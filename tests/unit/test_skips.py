"""A test that is skipped passes on a developer's computer, and fails in CI."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.pages import ROOT

TESTS = """import pytest

@pytest.mark.skipif(True, reason="needs a saw")
def test_mark() -> None: ...

def test_call() -> None:
    pytest.skip("needs a hammer")

@pytest.mark.xfail
def test_expected_to_fail() -> None:
    assert False
"""


@pytest.mark.parametrize(("no_skips", "status"), [("", 0), ("1", 1)])
def test_skip_fails_where_none_is_allowed_and_names_its_reason(tmp_path: Path, no_skips: str, status: int) -> None:
    (tmp_path / "test_tools.py").write_text(TESTS)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "tests.conftest", "-p", "no:cacheprovider", "--rootdir=.", "-rs"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT), "NO_SKIPS": no_skips, "PYTEST_ADDOPTS": ""},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == status, done.stdout
    assert "needs a saw" in done.stdout
    assert "needs a hammer" in done.stdout
    assert ("1 failed, 1 xfailed, 1 error" if no_skips else "2 skipped, 1 xfailed") in done.stdout


def test_ci_allows_no_skips() -> None:
    assert "\nNO_SKIPS=1 make check\n" in (ROOT / ".ci/run").read_text(encoding="utf-8")
