"""The library in C: only one that was built from the sources beside it is used; else one line says what to do."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.processes import ROOT
from tests.support.stepped import SteppedEstimator
from wrcd.bus.reasons import Reason
from wrcd.checksum import checksum
from wrcd.core.causes import Cause
from wrcd.core.design import load_design
from wrcd.core.terms import MAX_AXLES, PairState
from wrcd.errors import InputError, Status
from wrcd.native import compiler

HEADER = ROOT / "wrcd/core/c/wrcd.h"
HINT = "install wrcd anew: it needs a C compiler, such as gcc\n"


@pytest.mark.parametrize(
    ("prefix", "names"),
    [("CAUSE", [c.name for c in Cause]), ("REASON", ["NONE", *(r.name for r in Reason)])],
    ids=["causes", "reasons"],
)
def test_names_have_the_same_numbers_in_c(prefix: str, names: list[str]) -> None:
    listed = re.search(rf"enum wrcd_{prefix.lower()} {{(.*?)}}", HEADER.read_text(), re.DOTALL)
    assert listed is not None
    assert re.findall(rf"WRCD_{prefix}_(\w+)", listed[1]) == names
    assert [int(c) for c in Cause] == list(range(len(Cause)))


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package, for a library of other sources."""
    shutil.copytree(ROOT / "wrcd", tmp_path / "wrcd", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def told(package: Path, *words: str) -> tuple[int, str]:
    """Exit status of wrcd, and what it says: of an error on standard error alone."""
    code = "import sys; from wrcd.cli.main import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, *words], cwd=package, env={**os.environ, "PYTHONPATH": str(package)},
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert not (done.stderr and done.stdout)
    return done.returncode, done.stderr or done.stdout


@pytest.mark.parametrize("command", ["--version", "check", "run", "replay x.log"])
def test_missing_library_is_one_line_that_says_what_to_do(package: Path, command: str) -> None:
    for built in (package / "wrcd").glob("_native*.so"):
        built.unlink()
    error = f"wrcd: error: {package / 'wrcd'}: the library in C was not built — {HINT}"
    assert told(package, *command.split()) == (Status.BAD_INPUT, error)


def test_library_of_other_sources_is_not_used(package: Path) -> None:
    assert f"compiled by {compiler()}\n" in told(package, "--version")[1]
    source = package / "wrcd/core/c/parts.h"
    before = source.read_text()
    source.write_text(before.replace("MIN_FIRING = 0.05", "MIN_FIRING = 0.06"))
    os.utime(source, (0, 0))  # older than the library: that says nothing
    status, said = told(package, "--version")
    assert (status, said.count("\n")) == (Status.BAD_INPUT, 1)
    assert said.endswith(f".so: was built from other C sources than those beside it — {HINT}")
    source.write_text(before)
    assert told(package, "--version")[0] == Status.DONE


def test_library_that_does_not_load_is_not_used(package: Path) -> None:
    (library,) = (package / "wrcd").glob("_native*.so")
    library.write_bytes(b"")
    status, said = told(package, "--version")
    assert (status, said.count("\n")) == (Status.BAD_INPUT, 1)
    assert f"{library}: cannot be used: " in said
    assert said.endswith(HINT)


def test_more_axles_than_there_is_room_for_are_refused() -> None:
    with pytest.raises(InputError, match=f"with {MAX_AXLES + 1} axles, at most {MAX_AXLES}"):
        SteppedEstimator(load_design(LONE_DESIGN), MAX_AXLES + 1)


@pytest.mark.parametrize(
    ("key", "part", "most"),
    [
        ("polynomial", "polynomial", 12), ("bank.lowpass", "bank.lowpass", 8), ("bank.highpass", "bank.highpass", 8),
        ("fuzzy.speed", "fuzzy: sets of an input", 16), ("health.hidden_bias", "health.hidden_bias", 128),
    ],
)  # fmt: skip
def test_design_that_is_larger_than_the_estimator_has_room_for_is_refused_with_its_key(
    key: str, part: str, most: int, tmp_path: Path
) -> None:
    document: dict[str, Any] = json.loads(LONE_DESIGN.read_text())
    *tables, last = key.split(".")
    table = document
    for name in tables:
        table = table[name]
    if last == "speed":
        table[last] = {"names": [str(k) for k in range(most + 1)], "centres": [0.1 * k for k in range(most + 1)]}
    elif last == "hidden_bias":
        wide, rows = (most + 1) * [0.0], len(table["hidden"])
        table |= {"hidden_bias": wide, "hidden": rows * [wide], "out": (most + 1) * [len(PairState) * [0.0]]}
    else:
        table[last] = (most + 1) * table[last][:1]
    file = tmp_path / "large.json"
    file.write_text(json.dumps(document | {"checksum": checksum(document)}))
    with pytest.raises(InputError) as error:
        load_design(file)
    assert str(error.value).startswith(f"{file}: {part}: {most + 1} are more than the {most} that the estimator takes")
