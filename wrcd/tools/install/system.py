"""The running system: root's rights, systemd, and which units run a program of before."""

import os
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wrcd.errors import InputError

BOOTED = Path("/run/systemd/system")  # is there where systemd is PID 1: sd_booted(3)
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
SYSCTL = ("/usr/lib/systemd/systemd-sysctl", "/lib/systemd/systemd-sysctl")
UNITS = ("wrcd@*.service", "sim-ecu@*.service")
TIMEOUT_S = 120.0


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
    """Run systemctl. Returns what it printed; raises InputError with what it said if it fails."""
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
