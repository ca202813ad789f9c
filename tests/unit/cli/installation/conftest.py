"""A computer's files for every test of installing."""

from pathlib import Path

import pytest

from tests.unit.cli.installation.lab import Lab


@pytest.fixture
def lab(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Lab:
    return Lab(tmp_path / "root", capsys)
