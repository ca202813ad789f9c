"""Programs and libraries that some tests need, and the line that brings each."""

import ctypes
import shutil
from pathlib import Path

import pytest

# a program or a library, and the packages of Debian's that bring it
_LIST = Path(__file__).parents[1] / "data/programs.txt"
PROGRAMS = {program: packages for program, *packages in map(str.split, _LIST.read_text().splitlines())}


def _there(name: str) -> bool:
    if ".so." not in name:
        return shutil.which(name) is not None
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def missing(*programs: str) -> str:
    """What this machine lacks of them, and what brings it; "" if nothing."""
    lacks = [name for name in programs if not _there(name)]
    packages = [package for name in lacks for package in PROGRAMS[name]]
    return f"{' and '.join(lacks)} missing; apt-get install {' '.join(packages)}" if lacks else ""


def needs(*programs: str) -> pytest.MarkDecorator:
    """Skip a test where one of these is missing."""
    return pytest.mark.skipif(bool(missing(*programs)), reason=missing(*programs))
