"""The Debian package under a real systemd: run, upgraded from that of the commit `studies`, removed without a trace."""

import hashlib
import os
import shutil
import stat
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.pages import run_by
from tests.support.unit_train import BUILT, UNIT, Train, dpkg, journal, main_pid, package, prop, systemctl
from wrcd import __version__
from wrcd.config.config import DEFAULT

HOME = Path("/opt/wrcd")
WRCD = HOME / "bin/wrcd"
CONFIG = Path("/etc/wrcd/vcan0.toml")
BROKEN = Path("/etc/wrcd/vcan1.toml")
PATIENCE_S = 60.0  # how soon it is Valid is for test_systemd.py to say
DUMP = Path("/var/lib/wrcd/vcan0/kept.log")
SYSCTL = Path("/etc/sysctl.d/80-wrcd.conf")
RMEM = Path("/proc/sys/net/core/rmem_max")
UNIT_FILE = "/lib/systemd/system/wrcd@.service"
# the unit of another installation, which would hide the package's; the list of what one laid out; a virtual environment
OTHERS = (
    Path("/usr/local/lib/systemd/system/wrcd@.service"),
    Path("/usr/local/lib/wrcd/installed.json"),
    HOME / "pyvenv.cfg",
)
# What may be otherwise afterwards: systemd's own bookkeeping, and dpkg's.
SYSTEMD = ("/etc/.pwd.lock", "/run/systemd", "/run/log", "/run/credentials", "/var/lib/systemd", "/var/log/journal")
DPKG = ("/var/log/dpkg.log", "/var/log/alternatives.log", "/var/cache/debconf")


# tests/hil/guest/init: everything that was written since the guest was booted, and what lies below
UPPER, LOWER = Path("/run/guest/upper"), Path("/run/guest/lower")
LOOKED_AT = ("etc", "usr", "opt", "var", "srv", "boot", "lib", "bin", "sbin")
OWN = ("/run", "/etc/systemd/system", "/var/lib/private")  # file systems of the guest's


def changes(*but: str) -> dict[str, str]:
    """Return kind, mode and content of all that is otherwise, by path. Left out: what lies at or below one of `but`."""
    assert UPPER.is_dir(), "this test needs the guest: run it with `make systemd`"
    found: dict[str, str] = {}
    for top in LOOKED_AT:
        for path in _walk(UPPER / top, ""):
            name = path.relative_to(UPPER)
            here, below = _state(path), _state(LOWER / name)
            if here == "removed" and below == "nothing":
                continue
            if here != below:
                found[f"/{name}"] = here
    for own in OWN:
        found |= {str(path): _state(path) for path in _walk(Path(own), str(UPPER.parent)) if path != Path(own)}
    return {name: state for name, state in found.items() if not _is_at(name, but)}


def _is_at(name: str, places: tuple[str, ...]) -> bool:
    return any(name == place or name.startswith(f"{place}/") for place in places)


def _walk(top: Path, but: str) -> Iterator[Path]:
    """A path and all below it, links not followed."""
    if not os.path.lexists(top) or str(top) == but:
        return
    yield top
    if top.is_dir() and not top.is_symlink():
        for path in sorted(top.iterdir()):
            yield from _walk(path, but)


def _state(path: Path) -> str:
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return "nothing"
    mode = status.st_mode
    if stat.S_ISCHR(mode) and status.st_rdev == 0:
        return "removed"  # as the overlay says it
    if stat.S_ISLNK(mode):
        return f"link to {path.readlink()}"
    what = hashlib.sha256(path.read_bytes()).hexdigest() if stat.S_ISREG(mode) else ""
    return f"{stat.filemode(mode)} {what}".rstrip()


def run(*words: str | Path, status: int = 0) -> str:
    """What a command prints, which is shown if it ends otherwise than with a status."""
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == status, f"{words}: {done.returncode}\n{done.stdout}{done.stderr}"
    print(f"$ {' '.join(map(str, words))}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def train(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Train]:
    assert Path("/run/systemd/system").is_dir(), "this test needs systemd as PID 1: run it with `make systemd`"
    assert not HOME.exists()
    # The watchdog is not what is tried here, and the host may be busy with something else.
    patient = Path("/run/systemd/system/wrcd@.service.d/patient.conf")
    patient.parent.mkdir(parents=True)
    patient.write_text("[Service]\nWatchdogSec=60s\nTimeoutStartSec=60s\n")
    train = Train(tmp_path_factory.mktemp("install"))
    yield train
    train.disconnect()
    print("\n".join(journal().splitlines()[-30:]))
    shutil.rmtree(patient.parent)
    systemctl("daemon-reload")


def use(train: Train) -> None:
    """What an engineer does after the first installation: configure, enable, look; and a dump is written."""
    CONFIG.parent.mkdir(exist_ok=True)
    CONFIG.write_text(DEFAULT)
    CONFIG.with_suffix(".env").write_text(f"WRCD_OPTIONS=--config {CONFIG}\n")
    train.connect()  # each test has the log's minutes for itself
    began = time.time()
    systemctl("enable", "--now", UNIT)  # returns when READY=1 was said
    assert prop("ActiveState") == "active", journal(began)
    train.wait(began, seconds=PATIENCE_S)
    DUMP.write_text("a dump")


def check_running(train: Train, version: str) -> None:
    """It runs from the package, sends Valid frames, and starts with the computer."""
    assert prop("FragmentPath") == UNIT_FILE
    assert systemctl("is-enabled", UNIT) == "enabled"
    train.wait(time.time() - 0.5, seconds=PATIENCE_S)
    said = run(WRCD, "--version")
    assert said.startswith(f"wrcd {version}\n")
    assert "\nestimator: C11, compiled by " in said


def check_kept() -> None:
    assert CONFIG.read_text() == DEFAULT
    assert DUMP.read_text() == "a dump"


def check_refused_beside_another_installation(database: list[str], file: Path) -> None:
    for other in OTHERS:
        made = [folder for folder in other.parents if not folder.exists()]
        other.parent.mkdir(parents=True, exist_ok=True)
        other.touch()
        assert str(other.relative_to("/").parent) in run(*database, "-i", file, status=1)
        assert not WRCD.exists()
        other.unlink()
        for folder in made:
            folder.rmdir()


def test_package_is_run_upgraded_and_removed_without_a_trace(train: Train, tmp_path: Path) -> None:
    (install, enable), (upgrade, restart), (remove, purge) = (
        [c.replace("@can0", "@vcan0").split() for c in step.commands]
        for step in run_by("tests/hil/test_install.py", "docs/how-to/install-on-train.md")
    )
    assert enable == ["systemctl", "enable", "--now", UNIT]  # in use()
    old, new = package(BUILT / "older"), package()
    database = dpkg(tmp_path, old)
    before, rmem = changes(*SYSTEMD, *DPKG), RMEM.read_text()
    check_refused_beside_another_installation(database, new)
    run(*database, *install[1:-1], old)
    assert RMEM.read_text() == "8388608\n"
    use(train)
    check_running(train, old.name.split("_")[1])

    edited = SYSCTL.read_text() + "# edited\n"
    SYSCTL.write_text(edited)
    BROKEN.write_text(DEFAULT + "[limits]\nmin_sped_m_s = 3\n")
    BROKEN.with_suffix(".env").write_text(f"WRCD_OPTIONS=--config {BROKEN}\n")
    pid = main_pid()
    said = run(*database, "--force-confold", *upgrade[1:-1], new)
    assert f"{BROKEN}:{len(BROKEN.read_text().splitlines())}: limits.min_sped_m_s" in said
    assert f"{__version__} does not start with {BROKEN}:\n" in said
    assert str(CONFIG) not in said
    assert f"what was there before runs until: {' '.join(restart)}\n" in said
    assert main_pid() == pid
    assert SYSCTL.read_text() == edited
    assert SYSCTL.with_name(f"{SYSCTL.name}.dpkg-dist").exists()  # the older package's was another
    restarted = time.time()
    run(*restart)
    train.wait(restarted + 0.1, seconds=PATIENCE_S)
    assert main_pid() not in (0, pid)
    check_running(train, __version__)
    check_kept()
    assert "Traceback" not in journal()  # the old daemon has asked the new program for a last dump

    run(*database, *remove[1:])
    assert run("systemctl", "cat", UNIT, status=1)
    assert not HOME.exists()
    assert os.path.lexists("/usr/bin/wrcd") is False
    check_kept()
    assert SYSCTL.read_text() == edited
    run(*database, *purge[1:])
    assert changes(*SYSTEMD, *DPKG) == before
    RMEM.write_text(rmem)
