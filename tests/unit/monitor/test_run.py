"""`wrcd monitor` from its arguments on, where there is nothing to draw on."""

import subprocess
import sys
from pathlib import Path

import pytest

from wrcd.cli.main import main

ROOT = Path(__file__).parents[3]
WITHOUT = """
import sys
for name in ("textual", "rich"):
    sys.modules[name] = None
from wrcd.cli.main import main
sys.exit(main(["monitor", "ride.log"]))
"""


def test_missing_extra_is_named() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT], cwd=ROOT, timeout=60, check=False, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stderr == "wrcd: error: monitor: needs the extra monitor — pip install 'wrcd[monitor]'\n"


def test_pipe_in_the_place_of_a_terminal_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["monitor", "ride.log"]) == 2
    assert "needs a terminal to draw on" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--bit-rate", "5"], "--bit-rate: takes 10000 to 1000000 bit/s, not 5"),
        (["ride.log", "-i", "socketcan"], "--interface: a log or a bus, not both"),
    ],
)
def test_arguments_that_contradict_are_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["monitor", *arguments]) == 2
    assert said in capsys.readouterr().err
