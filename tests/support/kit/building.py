"""Kits written, compiled and run."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.support.tools import missing
from wrcd.kit.write_kit import core_kit, kit

HERE = Path(__file__).parent
WARNINGS = ("-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wpedantic", "-Werror")
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
needs_compiler = pytest.mark.skipif(not COMPILERS, reason=missing("gcc"))


def written(folder: Path, config_file: Path | None = None, *, core: bool = False) -> Path:
    """The folder, with a kit in it."""
    (core_kit if core else kit)(folder, config_file, False)
    return folder


def make(folder: Path, *words: str) -> str:
    """Run make there, and return what it says; it must succeed, and say nothing on standard error."""
    done = run_make(folder, *words)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    return done.stdout


def run_make(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run make there, however it ends."""
    apart = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}  # from one that runs us
    return subprocess.run(  # zig compiles a C library first, beside other tests for minutes
        ["make", "-C", folder, *words], env=apart, capture_output=True, text=True, timeout=1800, check=False
    )


def build(folder: Path, program: str) -> Path:
    """Compile one of our own programs against a kit, as strictly."""
    out = folder / program
    files = [HERE / f"{program}.c", *([folder / "adhesion.c"] if program != "crc" else [])]
    command = [COMPILERS[0], *WARNINGS, "-g", "-fsanitize=undefined,address", "-I", folder, "-o", out, *files]
    subprocess.run([str(word) for word in command], timeout=60, check=True)
    return out


def run(program: Path, lines: Sequence[str]) -> list[str]:
    """What a program says to some lines, a line for each."""
    text = "".join(f"{line}\n" for line in lines)
    done = subprocess.run([program], input=text, capture_output=True, text=True, timeout=60, check=True)
    assert done.stderr == ""
    return done.stdout.splitlines()
