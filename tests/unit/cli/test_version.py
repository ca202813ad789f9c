"""`--version`: what a bug report needs, and no cost to a start of the daemon."""

import json
import re
import subprocess
import sys
from collections.abc import Callable

import pytest

from sim_ecu.cli.main import main as rig_main
from wrcd import native, resources
from wrcd.cli import program as program_of_both
from wrcd.cli.main import main
from wrcd.core import design


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
    assert said[1:3] == [
        f"design  {packaged['name']} {packaged['checksum'][:12]}, {design.FORMAT}",
        "log     candump -L",
    ]
    assert said[3] == f"library C11, compiled by {native.compiler()}"
    assert re.fullmatch(
        r"with    Python 3\.\d+\.\S+, numpy \d\S+, cantools \d\S+, python-can \d\S+, Linux \S+", said[4]
    )


def test_library_that_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_of_both, "LIBRARIES", ("numpy", "no-such-library"))
    assert ", no-such-library missing, " in program_of_both.version_lines("wrcd")[-1]


@pytest.mark.parametrize(
    ("line", "slow"),
    [
        ("c.WRCD.parser()", {"numpy", "cantools", "can", "asyncio", "socket", "email", "platform"}),
        ("c.main(['run', '--wait', '-1'])", {"numpy", "cantools", "can", "json", "importlib.metadata", "platform"}),
    ],
)
def test_command_line_imports_nothing_slow_and_the_daemon_no_other_command(line: str, slow: set[str]) -> None:
    """The daemon opens its bus before its slow imports."""
    code = f"import sys, wrcd.cli.main as c; {line}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], timeout=60, check=True, capture_output=True, text=True)
    modules = done.stdout.split()
    assert slow.isdisjoint(modules)
    ours = [m.removeprefix("wrcd.cli.") for m in modules if m.startswith("wrcd.cli.")]
    assert "'run'" not in line or ours == ["program", "main", "arguments", "run"]
