"""Inside the guest, under systemd: install, run, upgrade and uninstall as docs/how-to/install-on-train.md tells it.

The step install starts it. It prints `seen: ` and what was seen, and ends with 1 at the first that is not.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.support.page_commands import run_by
from tests.support.unit_train import UNIT, Train, systemctl
from tests.walk.walk import StepFailed, expect
from wrcd import __version__

HOME = Path("/opt/wrcd")
NEXT = "0.99.0"
CONFIG, DUMPS = Path("/etc/wrcd/vcan0.toml"), Path("/var/lib/private/wrcd")
PLACES = ("/etc", "/usr/local", "/lib/systemd", "/var/lib", "/run/systemd/system")
# The watchdog is not what is tried here, and the host may be busy with something else.
PATIENT = Path("/run/systemd/system/wrcd@.service.d/patient.conf")


def run(*words: str | Path) -> str:
    """What a command says. Fails the step if it fails."""
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
    expect(done.returncode == 0, f"`{' '.join(map(str, words))}` ended with {done.returncode}:\n{done.stdout}")
    return done.stdout


def traces() -> list[str]:
    """Files named after it, wherever an installation leaves some."""
    return run(
        "find", *PLACES, "-xdev", "-regex", r".*/[^/]*\(wrcd\|sim-ecu\)[^/]*", "-not", "-path", "*/tests/*"
    ).split()


def commands() -> list[list[list[str]]]:
    """The words of the page's commands, by block, for this guest's vcan0."""
    blocks = run_by("tests/walk/in_guest.py", "docs/how-to/install-on-train.md")
    return [[c.replace("@can0", "@vcan0").split() for c in step.commands] for step in blocks]


def walk(train: Train) -> None:
    """Take the steps, a line each."""
    (dry_run, install, enable), (upgrade, restart) = commands()
    next_home = Path(upgrade[0]).parents[1]
    before = traces()
    run("tests/hil/install-program")
    run(*dry_run)
    expect(traces() == before, "a dry run has changed something")
    new = [line for line in run(*install).splitlines() if line.split()[0] == "new"]
    print(f"seen: installed {__version__}, {len(new)} files")

    began = time.time()
    CONFIG.parent.mkdir(exist_ok=True)
    text = run(HOME / "bin/python", "-c", "from wrcd.config import DEFAULT; print(DEFAULT)")
    CONFIG.write_text(text)
    CONFIG.with_suffix(".env").write_text(f"WRCD_OPTIONS=--config {CONFIG}\n")
    run(*enable)
    train.wait(began)
    print(f"seen: Valid adhesion {time.time() - began:.1f} s after systemctl enable --now")

    shutil.copytree(HOME, next_home, symlinks=True)
    for name in ("wrcd", "sim-ecu"):
        program = next_home / "bin" / name
        program.write_text(program.read_text().replace(f"{HOME}/", f"{next_home}/"))
    (package,) = next_home.glob("lib/python3*/site-packages/wrcd/__init__.py")
    package.write_text(package.read_text().replace(f'"{__version__}"', f'"{NEXT}"'))
    began = time.time()
    said = run(*upgrade)
    expect(f"wrcd {__version__} -> {NEXT}" in said and " ".join(restart) in said, f"the upgrade says:\n{said}")
    run(*restart)
    expect(str(next_home) in systemctl("show", "-p", "ExecStart", UNIT), "the unit still starts the old program")
    expect(CONFIG.read_text() == text, "the upgrade has changed the configuration")
    train.wait(began + 1.0)
    print(f"seen: upgraded to {NEXT}, restarted, Valid again; the configuration is as it was")

    run(next_home / "bin/wrcd", "uninstall", "--purge")
    for folder in (HOME, next_home):
        shutil.rmtree(folder)
    left = sorted(set(traces()) - set(before))
    expect(not left, f"uninstalled, but there is still {', '.join(left)}")
    known = subprocess.run(["systemctl", "cat", UNIT], capture_output=True).returncode == 0
    expect(not known, f"systemd still knows {UNIT}")
    print("seen: uninstalled, no trace")


def main() -> int:
    """Walk, with a train's sensors on vcan0."""
    PATIENT.parent.mkdir(parents=True)
    PATIENT.write_text("[Service]\nWatchdogSec=60s\nTimeoutStartSec=60s\n")
    with tempfile.TemporaryDirectory() as folder:
        train = Train(Path(folder))
        train.connect()
        try:
            walk(train)
        except (StepFailed, AssertionError, subprocess.CalledProcessError) as e:
            print(f"failed: {e}")
            return 1
        finally:
            train.disconnect()
    return 0


if __name__ == "__main__":
    sys.exit(main())
