"""The C sources compile without a warning, and run under gcc's sanitizers over all that happens to a train."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.processes import ROOT
from tests.support.tools import needs
from wrcd import native

SOURCES = sorted((ROOT / "wrcd").glob("*/c/*.c"))
STRICT = ("-std=c11", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-shared", "-fPIC")
NEEDS_GCC = needs("gcc")
TICKS = 600  # of each design and number of axles
LOGS = (
    "odd.toml 04", "odd.toml 10", "floats.toml 00", "third-party.toml 02", "own-dbc/train.toml 06", "fuzzed 014",
    "reverse by speed 0", "fault 24 sender all 0.5 multiple-unit", "fault 06 dlc yaw_rate 0.5 multiple-unit",
)  # fmt: skip


def compiled(folder: Path, compiler: str, *flags: str) -> Path:
    library = folder / "_native.so"
    digest = f'-DWRCD_SOURCES="{native.sources()}"'
    folders = sorted({f"-I{source.parent}" for source in SOURCES})
    words = [compiler, *STRICT, digest, *folders, *flags, *map(str, SOURCES), "-o", str(library), "-lm"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return library


@NEEDS_GCC
def test_sources_compile_without_a_warning(tmp_path: Path) -> None:
    for compiler in filter(shutil.which, ("gcc", "clang", str(ROOT / "build/zig/bin/cc"))):
        folder = tmp_path / Path(compiler).name  # a library of one path is loaded once
        folder.mkdir()
        c = native.load(compiled(folder, compiler, "-O2"))
        assert ("gcc" if compiler == "gcc" else "clang") in c.wrcd_compiler().decode().lower()


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """No access out of bounds, no overflow of a whole number, no conversion that the value does not fit."""
    checks = "-fsanitize=address,undefined,float-cast-overflow"
    return compiled(
        tmp_path_factory.mktemp("sanitized"), "gcc", "-O1", "-g", checks, "-fno-sanitize-recover=all"
    )  # fmt: skip


def run_with(library: Path, *words: str) -> str:
    """What a module prints with a library; a sanitizer's word ends it before that."""
    asan = subprocess.run(["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    env = {"LD_PRELOAD": asan.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.with_library", library, *words], cwd=ROOT, timeout=300,
        env={**os.environ, **env}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "Sanitizer" not in done.stderr, done.stderr
    assert "runtime error" not in done.stderr, done.stderr
    return done.stdout


@NEEDS_GCC
def test_estimator_runs_under_sanitizers(sanitized: Path) -> None:
    assert run_with(sanitized, "tests.support.fuzzed_ticks", str(TICKS)).startswith(f"{4 * 8 * TICKS} ticks, gcc ")


@NEEDS_GCC
def test_core_runs_under_sanitizers(sanitized: Path) -> None:
    """Logs of every layout of a DBC, with what goes wrong on a bus. Another machine may make other logs of them."""
    told = run_with(sanitized, "tests.corpus", "--here", *LOGS)
    assert f"of {len(LOGS)} logs give what was recorded" in told
