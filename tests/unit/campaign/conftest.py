"""Campaigns of the kind that tests try things with."""

from pathlib import Path

import pytest

from sim_ecu.campaign import definition
from tests.support.trial_kind import TRIAL, Write


@pytest.fixture
def trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kind `trial` is there."""
    monkeypatch.setattr(definition, "KINDS", (*definition.KINDS, TRIAL))


@pytest.fixture
def write(tmp_path: Path, trial: None) -> Write:
    """Writes a campaign's file: what stands above its tables, and the tables."""

    def written(head: str = "", fixed: str = "", factor: str = "x = [1, 2]", name: str = "c.toml") -> Path:
        file = tmp_path / name
        file.write_text(f'kind = "trial"\n{head}\n[fixed]\n{fixed}\n[factor]\n{factor}\n', encoding="utf-8")
        return file

    return written
