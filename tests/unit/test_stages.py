"""`make test` and `make check` with a stub in make's place: every stage runs, and what failed is said at the end.

A test that is skipped passes on a developer's computer, and fails in CI.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

pytest_plugins = ("pytester",)
ROOT = Path(__file__).parents[2]
STAGES = ["unit", "hil", "faults", "systemd"]
# the target is its last word
STUB = """#!/bin/sh
for target; do :; done
echo "ran $target"
case " $FAILING " in *" $target "*) exit 3 ;; esac
"""


def run(folder: Path, failing: str, *command: str, **more: str) -> "subprocess.CompletedProcess[str]":
    """A command with the stub as make, and more in its environment."""
    stub = folder / "make"
    stub.write_text(STUB)
    stub.chmod(0o755)
    ours = ("MAKEFLAGS", "MAKEOVERRIDES", "MAKELEVEL", "MFLAGS", "NO_SKIPS")
    env = {k: v for k, v in os.environ.items() if k not in ours}
    env |= {"FAILING": failing, "PATH": f"{folder}:{env['PATH']}", **more}
    return subprocess.run(command, cwd=ROOT, env=env, timeout=120, check=False, capture_output=True, text=True)


@pytest.mark.parametrize(("failing", "status"), [("", 0), ("unit", 2)])
def test_each_stage_is_listed_with_what_became_of_it(failing: str, status: int, tmp_path: Path) -> None:
    done = run(tmp_path, failing, "tests/all-stages")
    table = done.stdout.partition("stages:\n")[2].splitlines()[: len(STAGES)]
    became = {line.split()[0]: line.partition(" s  ")[2] for line in table}
    assert sorted(became) == sorted(STAGES)
    # what runs in the guest may be left out on this machine
    of_the_guest = {name: became.pop(name) for name in ("hil", "faults", "systemd")}
    assert set(of_the_guest.values()) <= {"passed", "left out"}
    assert became == {name: "FAILED with 3" if name in failing.split() else "passed" for name in became}
    assert (done.returncode, done.stderr) == (status, "")


@pytest.mark.parametrize(("no_skips", "status"), [("", 0), ("1", 2)])
def test_stage_that_lacks_a_program_is_left_out_and_listed(no_skips: str, status: int, tmp_path: Path) -> None:
    programs = {p.name: p for d in reversed(os.get_exec_path()) for p in Path(d).glob("*")}
    for name, program in programs.items():
        if name not in ("perl", "make"):
            (tmp_path / name).symlink_to(program)
    done = run(tmp_path, "", "tests/all-stages", PATH=str(tmp_path), NO_SKIPS=no_skips)
    assert "ran faults" not in done.stdout
    left = done.stdout.partition("left out, for want of what this machine lacks:\n")[2]
    assert "  faults: perl is missing; install Debian's package perl-base\n" in left
    assert (done.returncode, done.stderr) == (status, "")


@pytest.mark.parametrize("failing", ["", "lint", "test", "lint test"])
def test_check_runs_all_and_says_at_its_end_what_failed(failing: str, tmp_path: Path) -> None:
    # the stamp of the environment is taken as it is: nothing is installed
    real = shutil.which("make")
    assert real is not None
    make = (real, "--no-print-directory", "-o", ".venv/ready", f"MAKE={tmp_path / 'make'}", "check")
    done = run(tmp_path, failing, *make)
    lines = done.stdout.splitlines()
    assert lines == ["ran lint", "ran test", *(f"make {stage} FAILED" for stage in failing.split())]
    assert done.returncode == (2 if failing else 0)


TESTS = """import pytest

@pytest.mark.skipif(True, reason="needs a saw")
def test_mark() -> None: ...

def test_call() -> None:
    pytest.skip("needs a hammer")

@pytest.mark.xfail
def test_expected_to_fail() -> None:
    assert False
"""


@pytest.mark.parametrize(
    ("no_skips", "found"), [("", {"skipped": 2, "xfailed": 1}), ("1", {"failed": 1, "errors": 1, "xfailed": 1})]
)
def test_skip_fails_where_none_is_allowed_and_names_its_reason(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, no_skips: str, found: dict[str, int]
) -> None:
    monkeypatch.setenv("NO_SKIPS", no_skips)
    pytester.makepyfile(TESTS)
    done = pytester.runpytest_inprocess("-p", "tests.conftest", "-rs")
    done.assert_outcomes(**found)
    assert all(reason in done.stdout.str() for reason in ("needs a saw", "needs a hammer"))


def test_ci_allows_no_skips() -> None:
    assert "\nNO_SKIPS=1 make check\n" in (ROOT / ".ci/run").read_text(encoding="utf-8")
