"""The program that units are to start."""

import os
import re
import stat
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path, PurePath, PurePosixPath

from wrcd.errors import InputError

SAFE = re.compile(r"[\w./+@~-]+")  # systemd reads blanks, %, $, quotes and backslashes otherwise
# ProtectHome=yes and PrivateTmp=yes hide these from the unit
HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")
RIG = ("numba", "scipy", "filterpy", "skfuzzy", "packaging", "e2e", "matplotlib")  # modules of the extra bench
ADVICE = "install it where a dynamic user can read it: python3 -m venv /opt/wrcd; --program names one elsewhere"


def own() -> PurePosixPath:
    """Return the `wrcd` of the environment that runs this. Raises InputError if units could not start it."""
    program = Path(sysconfig.get_path("scripts")) / "wrcd"
    if not program.is_file():
        raise InputError("there is no such program", file=program, hint="install the wheel there with pip")
    # the program, its package, and the interpreter with its library, which may be elsewhere
    for file in (program, Path(__file__), Path(sys.executable), Path(os.__file__)):
        for path in (file, file.resolve()):
            _shown(path)
            readable(path)
    return stated(str(program))


def require_rig() -> None:
    """Raise InputError if the environment that runs this lacks a package that the rig's unit needs."""
    if missing := next((name for name in RIG if find_spec(name) is None), None):
        raise InputError(
            f"sim-ecu needs the extra bench: the package {missing} is missing", key="--with rig",
            hint="pip install 'wrcd[bench]' in the program's environment; or --without rig",
        )  # fmt: skip


def stated(text: str) -> PurePosixPath:
    """Return a path that units can name. Raises InputError for one that they cannot, or may not see."""
    program = PurePosixPath(text)
    if not program.is_absolute() or program.name != "wrcd" or ".." in program.parts:
        raise InputError(f"must be the absolute path of a program wrcd, not {text!r}", key="--program")
    if not SAFE.fullmatch(text):
        raise InputError("a unit cannot name this path: letters, digits and ./_+@~- only", file=text, hint=ADVICE)
    _shown(program)
    return program


def _shown(file: PurePath) -> None:
    """Raise InputError if the unit could not see a file."""
    if hidden := next((h for h in HIDDEN if file.is_relative_to(h)), None):
        raise InputError(f"the unit's sandbox hides {hidden}", file=str(file), hint=ADVICE)


def readable(file: Path) -> None:
    """Raise InputError if another user could not read a file."""
    for path in (file, *file.parents):
        wanted = stat.S_IXOTH if path is not file else stat.S_IROTH
        if not path.stat().st_mode & wanted:
            raise InputError("other users cannot read it, and the unit runs as one", file=path, hint=ADVICE)
