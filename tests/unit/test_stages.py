"""`make test` and `make check` with a stub in make's place: every stage runs, and what failed is said at the end."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STAGES = ["unit", "hil", "browser", "walk", "faults", "systemd"]
# the target is its last word
STUB = """#!/bin/sh
for target; do :; done
echo "ran $target"
case " $FAILING " in *" $target "*) exit 3 ;; esac
"""


def run(folder: Path, failing: str, *command: str) -> "subprocess.CompletedProcess[str]":
    """A command with the stub as make."""
    stub = folder / "make"
    stub.write_text(STUB)
    stub.chmod(0o755)
    env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKEOVERRIDES", "MAKELEVEL", "MFLAGS")}
    env |= {"FAILING": failing, "PATH": f"{folder}:{env['PATH']}"}
    return subprocess.run(command, cwd=ROOT, env=env, timeout=120, check=False, capture_output=True, text=True)


@pytest.mark.parametrize(("failing", "status"), [("", 0), ("hil", 2), ("unit walk", 2)])
def test_each_stage_is_listed_with_what_became_of_it(failing: str, status: int, tmp_path: Path) -> None:
    done = run(tmp_path, failing, "tests/all-stages")
    table = done.stdout.partition("stages:\n")[2].splitlines()
    assert {name: "FAILED with 3" if name in failing.split() else "passed" for name in STAGES} == {
        line.split()[0]: line.partition(" s  ")[2] for line in table
    }
    assert len(table) == len(STAGES)
    assert (done.returncode, done.stderr) == (status, "")


@pytest.mark.parametrize("failing", ["", "lint", "test", "lint night"])
def test_check_runs_all_and_says_at_its_end_what_failed(failing: str, tmp_path: Path) -> None:
    # the stamp of the environment is taken as it is: nothing is installed
    real = shutil.which("make")
    assert real is not None
    make = (real, "--no-print-directory", "-o", ".venv/ready", f"MAKE={tmp_path / 'make'}", "check")
    done = run(tmp_path, failing, *make)
    lines = done.stdout.splitlines()
    assert lines == ["ran lint", "ran test", "ran night", *(f"make {stage} FAILED" for stage in failing.split())]
    assert done.returncode == (2 if failing else 0)
