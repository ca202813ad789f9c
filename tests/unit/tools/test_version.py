"""`--version`: what a bug report needs, and no cost to a start of the daemon."""

import json
import re
import subprocess
import sys
from collections.abc import Callable

import pytest

from sim_ecu.cli import main as rig_main
from wrcd import resources
from wrcd.estimator import design
from wrcd.recorder import state_file
from wrcd.tools import version
from wrcd.tools.cli import main


@pytest.mark.parametrize(("program", "run"), [("wrcd", main), ("sim-ecu", rig_main)])
def test_version_names_package_design_and_formats(
    program: str, run: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        run(["--version"])
    assert ended.value.code == 0
    said = capsys.readouterr().out.splitlines()
    packaged = json.loads(resources.DESIGN.read_text())
    assert re.fullmatch(rf"{program} \d+\.\d+\.\d+", said[0])
    assert said[1:4] == [
        f"design  {packaged['name']} {packaged['checksum'][:12]}, {design.FORMAT}",
        f"state   {state_file.FORMAT}",
        "log     candump -L",
    ]
    assert re.fullmatch(
        r"with    Python 3\.\d+\.\S+, numpy \d\S+, cantools \d\S+, python-can \d\S+, Linux \S+", said[4]
    )


def test_library_that_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(version, "LIBRARIES", ("numpy", "no-such-library"))
    assert ", no-such-library missing, " in version.lines("wrcd")[-1]


def test_command_line_imports_nothing_slow() -> None:
    """The daemon opens its bus before its slow imports."""
    code = "import sys, wrcd.tools.cli as c; c._parser(); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], timeout=60, check=True, capture_output=True, text=True)
    slow = {"numpy", "cantools", "can", "json", "email", "importlib.metadata", "platform", "asyncio", "socket"}
    assert slow.isdisjoint(done.stdout.split())


def test_daemon_starts_without_the_records_of_other_commands() -> None:
    code = "import sys, wrcd.tools.cli as c; sys.exit(c.main(['run', '--wait', '-1']) * 0 or print(*sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], timeout=60, check=True, capture_output=True, text=True)
    named = [m for m in done.stdout.split() if m.startswith("wrcd.tools.commands.")]
    assert named == ["wrcd.tools.commands.arguments", "wrcd.tools.commands.run_command"]
