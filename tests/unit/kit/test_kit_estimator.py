"""The estimator in C of a kit: it compiles without a warning, says what wrcd says, and fails where it does
not; on this processor and on a 32-bit Arm."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.oracle.estimator import Oracle
from tests.support.kit.building import COMPILERS, make, needs_compiler, run_make, written
from tests.support.kit.trains import odd_train
from tests.support.pages import ROOT, run_by
from tests.support.tools import needs
from wrcd import __version__
from wrcd.config.config import load_config
from wrcd.core.design import Design, load_design
from wrcd.core.design_members import Member, OverSpeed, members
from wrcd.errors import InputError
from wrcd.kit.design_table import DesignTable
from wrcd.kit.estimator_files import EVERY, MADE, SOURCES, files_of
from wrcd.kit.golden_track import track
from wrcd.kit.write_kit import estimator_kit

PAGE = "docs/how-to/run-on-an-ecu.md"
SAYS = re.compile(r"800 ticks of (\d) axles, 32 estimates, largest difference (\S+): as wrcd\n")
STACK = re.compile(r"^stack (\d+) bytes; it may be 49152$", re.MULTILINE)


@pytest.fixture(scope="module")
def default(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("estimator"), estimator=True)


@pytest.fixture(scope="module")
def built(default: Path) -> tuple[Path, str]:
    """A kit with its objects, and what its test said."""
    folder = Path(shutil.copytree(default, default.parent / f"{default.name}-built"))
    return folder, make(folder)


@pytest.fixture
def copied(built: tuple[Path, str], tmp_path: Path) -> Path:
    """A built kit to be changed."""
    return Path(shutil.copytree(built[0], tmp_path / "copy"))


def judge(said: str, axles: int) -> None:
    """What a test prints that went well: axles, difference, stack."""
    found, stack = SAYS.search(said), STACK.search(said)
    assert found, said
    assert int(found[1]) == axles
    assert float(found[2]) <= 1e-9
    assert stack, said
    assert 10_000 < int(stack[1]) <= 49_152  # the bank's matrices alone are 11 kB


@needs_compiler
def test_estimator_says_what_wrcd_says(built: tuple[Path, str]) -> None:
    judge(built[1], axles=4)


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_compiler_builds_it_without_a_warning(compiler: str, copied: Path) -> None:
    judge(make(copied, "-B", f"CC={compiler}", "CFLAGS=-O1"), axles=4)


@needs_compiler
def test_estimator_of_a_train_with_two_axles_says_what_wrcd_says(tmp_path: Path) -> None:
    judge(make(written(tmp_path / "kit", odd_train(tmp_path), estimator=True)), axles=2)


@needs_compiler
@pytest.mark.parametrize(
    ("file", "axles"),
    [("wrcd/data/designs/lone-wheelset.design.json", 1), ("sim_ecu/data/lone-wheelset.paper.design.json", 8)],
)
def test_any_design_becomes_a_table(file: str, axles: int, tmp_path: Path) -> None:
    for name, content in files_of(load_design(ROOT / file), axles).items():
        (tmp_path / name).write_bytes(content)
    judge(make(tmp_path), axles)


@needs_compiler
def test_sanitizers_find_nothing(copied: Path) -> None:
    assert SAYS.search(make(copied, "sanitize"))


@needs("arm-linux-gnueabihf-gcc", "qemu-arm")
def test_estimator_says_the_same_on_a_32_bit_arm(copied: Path) -> None:
    (step,) = run_by("tests/unit/kit/test_kit_estimator.py", PAGE)
    (command,) = step.commands
    judge(make(copied, *command.removeprefix("make -C estimator ").split()), axles=4)


@needs_compiler
def test_page_says_what_it_takes(built: tuple[Path, str]) -> None:
    page = (ROOT / PAGE).read_text()
    shown = re.search(r"^```text\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert shown

    def lasting(said: str) -> list[str]:  # not times, stack and difference
        lines = [line for line in said.splitlines() if not line.startswith(("make", "cc", "./", "a tick", "stack"))]
        return [line.split(", largest")[0] for line in lines]

    assert lasting(built[1]) == lasting(shown[1])
    usual, most = re.findall(r"about (\d+)", (built[0] / "README.md").read_text())
    assert f"takes {usual} multiply-adds in double precision for four axles, {most} at most" in page


@needs_compiler
def test_example_prints_an_adhesion_for_each_axle(copied: Path) -> None:
    said = re.findall(
        r"^axle \d: ([\d.]+) % available, \+-[\d.]+, 5\.\d % in use", make(copied, "example"), re.MULTILINE
    )
    assert len(said) == 4
    assert all(5.0 < float(adhesion) < 60.0 for adhesion in said)


@needs_compiler
@pytest.mark.parametrize(
    ("file", "was", "becomes"),
    [
        ("vectors.h", r"(mu_available_pct = 2\d\.\d{6})\d", r"\g<1>"),  # what wrcd said
        ("vectors.h", r"\{\{0\.\d+", "{{0.3"),  # what it was given
        ("design.c", r"(ADHESION|POLYNOMIAL)(\[7\] = \{\s+)-?\d", r"\1\g<2>9"),
        ("parts.h", "MIN_FIRING = 0.05", "MIN_FIRING = 0.9"),
    ],
)
def test_difference_is_found(file: str, was: str, becomes: str, copied: Path) -> None:
    text = (copied / file).read_text()
    changed = re.sub(was, becomes, text, count=1)
    assert changed != text
    (copied / file).write_text(changed)
    done = run_make(copied)
    assert done.returncode == 2
    assert "NOT as wrcd" in done.stdout
    assert re.search(r"^tick \d+, axle \d, \w+\[\d+\]: \S+, not \S+$", done.stdout, re.MULTILINE)


@needs_compiler
@pytest.mark.parametrize("limit", ["MAX_STACK=20000U", "MAX_SHARE=1e-7"])
def test_more_stack_or_time_than_is_allowed_is_found(limit: str, copied: Path) -> None:
    done = run_make(copied, "-W", "test_estimator.c", f"CFLAGS=-O2 -D{limit}")
    assert done.returncode == 2
    assert SAYS.search(done.stdout)


def test_files_name_version_and_design_and_the_sources_are_wrcds_own(default: Path) -> None:
    design = load_config(None).design
    assert {f.name for f in default.iterdir()} == {*SOURCES, *MADE}
    for name in (*SOURCES, *MADE):
        head, _, body = (default / name).read_text().partition("\n")
        assert f"written by wrcd kit {__version__}; design: multiple-unit wrcd-design/4 {design.checksum};" in head
        assert not re.search("@[A-Z_]+@", body), name
        if name in SOURCES:
            own = (ROOT / "wrcd/core/c" / name).read_text()
            assert body == own.replace("WRCD_MAX_AXLES = 8", "WRCD_MAX_AXLES = 4"), name
    assert (default / "vectors.h").stat().st_size < 400_000


def test_kit_of_another_kind_is_not_overwritten(tmp_path: Path) -> None:
    written(tmp_path)
    with pytest.raises(InputError, match="--force"):
        estimator_kit(tmp_path, None, False)
    estimator_kit(tmp_path, None, True)
    estimator_kit(tmp_path, None, False)


def numbers_of(of: Member) -> list[NDArray[Any]]:
    if isinstance(of, dict):
        return [a for value in of.values() for a in numbers_of(value)]
    if isinstance(of, OverSpeed | tuple):
        return [a for value in of for a in numbers_of(value)]
    return [of.ravel()] if isinstance(of, np.ndarray) else []


def test_table_has_every_number_to_the_last_bit() -> None:
    design: Design = load_config(None).design
    table = DesignTable(members(design)).text
    said = {tuple(map(float, body.split(",")[:-1])) for body in re.findall(r"\] = \{\n(.*?)\}", table, re.DOTALL)}
    arrays = [tuple(a.tolist()) for a in numbers_of(members(design))]
    assert len(arrays) > 30
    assert [a for a in arrays if a not in said and f"{{{', '.join(map(repr, a))}}}" not in table] == []


def test_vectors_are_what_the_oracle_says() -> None:
    """To the digits that they are written with."""
    design = load_config(None).design
    ticks, oracle = track(design, 2), Oracle(design, 2)
    text = files_of(design, 2)["vectors.h"].decode()
    written = [float(x) for x in re.findall(r"\.mu_available_pct = ([\w.+-]+)", text)]
    said: list[float] = []
    for k in range(len(ticks)):
        with np.errstate(all="ignore"):
            result = oracle.step(ticks.tick(k))
        for axle in np.flatnonzero(result.needs_reset).tolist():
            oracle.reset(axle)
        if k % EVERY == EVERY - 1:
            said += oracle.estimate().mu_available_pct.tolist()
    assert np.isfinite(said).sum() > 40
    assert written == pytest.approx(said, rel=1e-9, nan_ok=True)
