"""The day on the virtual clock, shortened, and that its balance sheet can show a loss."""

import subprocess
import sys

import numpy as np
import pytest

from tests.soak.pool import Faults
from tests.soak.soak import Balance
from wrcd.config.config import load_config
from wrcd.core.core import Core


@pytest.mark.night
def test_a_short_soak_balances() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.soak.soak", "--hours", "0.02"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert all(line.startswith("ok ") for line in done.stdout.splitlines())
    assert "simulated 0.02 h" in done.stdout


def test_unbalanced_sheet_is_reported() -> None:
    balance = Balance(fed=1, made=1, rss_kb=[0.0, 2000.0], objects=[1000, 1100], drifts=[(1e-3, "state")])
    sheet = balance.lines(Core(load_config(None)), Faults(np.random.default_rng(1)))
    assert [text.split()[0] for text, holds in sheet if not holds] == [
        "frames",
        "Adhesion",
        "memory",
        "objects",
        "state",
    ]
