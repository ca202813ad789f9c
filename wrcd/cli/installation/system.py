"""The running system: root's rights, systemd, which units run a program of before, and which program they can start."""

import os
import re
import stat
import subprocess
import sys
import sysconfig
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path, PurePath, PurePosixPath

from wrcd.errors import InputError

BOOTED = Path("/run/systemd/system")  # is there where systemd is PID 1: sd_booted(3)
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
SYSCTL = ("/usr/lib/systemd/systemd-sysctl", "/lib/systemd/systemd-sysctl")
UNITS = ("wrcd@*.service", "sim-ecu@*.service")
TIMEOUT_S = 120.0
SAFE = re.compile(r"[\w./+@~-]+")  # systemd reads blanks, %, $, quotes and backslashes otherwise
# ProtectHome=yes and PrivateTmp=yes hide these from the unit
HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")
# modules of the extra bench
RIG = ("numba", "scipy", "filterpy", "skfuzzy", "packaging", "e2e", "matplotlib", "jinja2", "dask", "distributed")
ADVICE = "install it where a dynamic user can read it: python3 -m venv /opt/wrcd; --program names one elsewhere"


@dataclass(frozen=True, slots=True)
class Running:
    """A unit that runs, and CLOCK_MONOTONIC when its process was started."""

    unit: str
    started_us: int


def require_root() -> None:
    """Raise InputError if we may not change the system."""
    if os.geteuid() != 0:
        raise InputError("needs root", hint="sudo, or --dry-run to see what it would do, or --prefix DIR for a copy")


def require_systemd() -> None:
    """Raise InputError if systemd does not run this computer."""
    if not BOOTED.is_dir():
        raise InputError(
            "systemd does not run here: no unit could be started",
            hint="--prefix DIR lays the files out below DIR (/ too), and leaves the running system alone",
        )


def now() -> tuple[str, int]:
    """The kernel's id of this start, and CLOCK_MONOTONIC in microseconds: no step of time touches them."""
    return BOOT_ID.read_text().strip(), time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000


def systemctl(*words: str) -> str:
    """Run systemctl. Returns what it printed; raises InputError with its output if it fails."""
    try:
        done = subprocess.run(
            ["systemctl", "--no-pager", *words], capture_output=True, text=True, timeout=TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as e:
        raise InputError(f"systemctl {words[0]}: {e}") from None
    if done.returncode != 0:
        raise InputError(f"systemctl {' '.join(words)} failed: {done.stderr.strip()}")
    return done.stdout


def running(patterns: Sequence[str] = UNITS) -> list[Running]:
    """Return our units, or those of some patterns, that run or are on their way."""
    listed = systemctl("list-units", "--plain", "--no-legend", "--state=active,activating,reloading", *patterns)
    units = [line.split()[0] for line in listed.splitlines() if line.strip()]
    return [Running(unit.removesuffix(".service"), _started(unit)) for unit in units]


def _started(unit: str) -> int:
    value = systemctl("show", "-p", "ExecMainStartTimestampMonotonic", "--value", unit).strip()
    return int(value) if value.isdigit() else 0


def restart_advice(units: Sequence[str]) -> str:
    """One line: which units run what was there before an upgrade, and how that ends."""
    return f"these run what was there before, until: systemctl restart {' '.join(units)}"


def apply_sysctl() -> None:
    """Have the receive buffers set as all of sysctl.d says together, an administrator's files included."""
    program = next((p for p in SYSCTL if Path(p).is_file()), None)
    if program is None:
        return
    subprocess.run([program, "--prefix=/net/core/rmem_max"], timeout=TIMEOUT_S, check=False)


def stop(patterns: Sequence[str] = UNITS) -> list[str]:
    """Stop our units, or those of some patterns. Returns which ran."""
    units = [r.unit for r in running(patterns)]
    if units:
        systemctl("stop", *units)
    return units


def forget() -> None:
    """Have systemd read its units again, and forget those that had failed."""
    systemctl("daemon-reload")
    subprocess.run(["systemctl", "reset-failed", *UNITS], capture_output=True, timeout=TIMEOUT_S, check=False)


def own_program() -> PurePosixPath:
    """Return the `wrcd` of the environment that runs this. Raises InputError if units could not start it."""
    program = Path(sysconfig.get_path("scripts")) / "wrcd"
    if not program.is_file():
        raise InputError("there is no such program", file=program, hint="install the wheel there with pip")
    # the program, its package, and the interpreter with its library, which may be elsewhere
    for file in (program, Path(__file__), Path(sys.executable), Path(os.__file__)):
        for path in (file, file.resolve()):
            _shown(path)
            readable(path)
    return stated_program(str(program))


def require_rig() -> None:
    """Raise InputError if the environment that runs this lacks a package that the rig's unit needs."""
    if missing := next((name for name in RIG if find_spec(name) is None), None):
        raise InputError(
            f"sim-ecu needs the extra bench: the package {missing} is missing", key="--with rig",
            hint="pip install 'wrcd[bench]' in the program's environment; or --without rig",
        )  # fmt: skip


def stated_program(text: str) -> PurePosixPath:
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
