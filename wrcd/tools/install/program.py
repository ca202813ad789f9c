"""The program that units are to start."""

import re
import stat
import sys
import sysconfig
from pathlib import Path, PurePosixPath

from wrcd.errors import InputError

SAFE = re.compile(r"[\w./+@~-]+")  # systemd reads blanks, %, $, quotes and backslashes otherwise
# ProtectHome=yes and PrivateTmp=yes hide these from the unit
HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")
ADVICE = "install it where a dynamic user can read it: python3 -m venv /opt/wrcd; --program names one elsewhere"


def own() -> PurePosixPath:
    """Return the `wrcd` of the environment that runs this. Raises InputError if units could not start it."""
    program = Path(sysconfig.get_path("scripts")) / "wrcd"
    if not program.is_file():
        raise InputError("there is no such program", file=program, hint="install the wheel there with pip")
    readable(program)
    readable(Path(__file__))
    readable(Path(sys.executable).resolve())
    return stated(str(program))


def stated(text: str) -> PurePosixPath:
    """Return a path that units can name. Raises InputError for one that they cannot, or may not see."""
    program = PurePosixPath(text)
    if not program.is_absolute() or program.name != "wrcd" or ".." in program.parts:
        raise InputError(f"must be the absolute path of a program wrcd, not {text!r}", key="--program")
    if not SAFE.fullmatch(text):
        raise InputError("a unit cannot name this path: letters, digits and ./_+@~- only", file=text, hint=ADVICE)
    if hidden := next((h for h in HIDDEN if program.is_relative_to(h)), None):
        raise InputError(f"the unit's sandbox hides {hidden}", file=text, hint=ADVICE)
    return program


def readable(file: Path) -> None:
    """Raise InputError if another user could not read a file."""
    for path in (file, *file.parents):
        wanted = stat.S_IXOTH if path is not file else stat.S_IROTH
        if not path.stat().st_mode & wanted:
            raise InputError("other users cannot read it, and the unit runs as one", file=path, hint=ADVICE)
