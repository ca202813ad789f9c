"""The C sources compile without a warning, and run under gcc's sanitizers over all that happens to a train."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.support.processes import ROOT
from tests.support.tools import needs
from wrcd import native

SOURCES = sorted((ROOT / "wrcd").glob("*/c/*.c"))
STRICT = ("-std=c11", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-shared", "-fPIC")
NEEDS_GCC = needs("gcc")
TICKS = 600  # of each design and number of axles


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
        c, made = native.load(compiled(folder, compiler, "-O2"))
        assert c is not None
        assert ("gcc" if compiler == "gcc" else "clang") in made.lower()


@NEEDS_GCC
def test_estimator_runs_under_sanitizers(tmp_path: Path) -> None:
    """No access out of bounds, no overflow of a whole number, no conversion that the value does not fit."""
    checks = "-fsanitize=address,undefined,float-cast-overflow"
    library = compiled(tmp_path, "gcc", "-O1", "-g", checks, "-fno-sanitize-recover=all")
    asan = subprocess.run(["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    env = {"LD_PRELOAD": asan.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.fuzzed_ticks", library, str(TICKS)], cwd=ROOT, timeout=300,
        env={**os.environ, **env}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{4 * 8 * TICKS} ticks, gcc ")
