"""The recorder, with patience: a busy computer takes its time to write the last dump."""

import pytest

from wrcd.recorder import recorder


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """The writer of the last dump has a minute, not the seconds that systemd leaves a daemon."""
    monkeypatch.setattr(recorder, "EXIT_S", 60.0)
