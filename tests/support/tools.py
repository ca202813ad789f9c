"""Programs that some tests need, and the line that brings each."""

import shutil
from pathlib import Path

import pytest

from wrcd import native

# a program, and the packages of Debian's that bring it
PROGRAMS = dict(line.split(maxsplit=1) for line in (Path(__file__).parents[1] / "data/programs.txt").open())


def missing(*programs: str) -> str:
    """What this machine lacks of them, and what brings it; "" if nothing."""
    lacks = [name for name in programs if shutil.which(name) is None]
    packages = " ".join(PROGRAMS[name].strip() for name in lacks)
    return f"{' and '.join(lacks)} missing; apt-get install {packages}" if lacks else ""


def missing_library() -> str:
    """What brings the compiled library, or why there is none; "" where there is one."""
    return "" if native.slow() is None else missing("gcc") or str(native.slow())


def needs(*programs: str) -> pytest.MarkDecorator:
    """Skip a test where one of these is missing."""
    return pytest.mark.skipif(bool(missing(*programs)), reason=missing(*programs))
