"""Clone: the last commit of this tree, in a folder of its own, set up as make does it.

What the clone does not do again is to fetch: the libraries of its environment are those of this tree's, which pip has
installed from the lock file, and Debian's packages for the guest are linked. wrcd and sim_ecu are the clone's own.
"""

import os
import subprocess
import sys
from pathlib import Path

from tests.walk.walk import ROOT, Step, Walk, expect


def take(walk: Walk) -> str:
    """Clone, set up, ask for the version."""
    git = ["git", "-c", "advice.detachedHead=false"]
    commit = subprocess.run([*git, "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True)
    changed = subprocess.run([*git, "status", "--short"], cwd=ROOT, capture_output=True, text=True, check=True)
    subprocess.run([*git, "clone", "-q", "--no-local", ROOT, walk.folder], check=True, timeout=60)
    subprocess.run([*git, "checkout", "-q", commit.stdout.strip()], cwd=walk.folder, check=True, timeout=60)
    _set_up(walk)
    version = walk.wrcd("--version").splitlines()[0]
    origin = walk.run(".venv/bin/python", "-c", "import wrcd; print(wrcd.__file__)").strip()
    expect(Path(origin).is_relative_to(walk.folder), f"the clone's wrcd is {origin}")
    files = len(walk.run("git", "ls-files").splitlines())
    note = f"; NOT in it: {len(changed.stdout.splitlines())} files changed here" if changed.stdout else ""
    return f"{version}, {files} files, commit {commit.stdout[:7]}; libraries are this tree's{note}"


def _set_up(walk: Walk) -> None:
    """What `make` does for .venv/ready, with the libraries of this tree."""
    venv = walk.folder / ".venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", venv], check=True, timeout=60)
    (site,) = venv.glob("lib/python3*/site-packages")
    libraries = [p for p in sys.path if p.endswith("site-packages")]
    (site / "libraries.pth").write_text("".join(p + "\n" for p in libraries))
    pip = (".venv/bin/python", "-m", "pip", "install", "-q", "--disable-pip-version-check")
    walk.run(*pip, "--no-deps", "--no-build-isolation", "-e", ".")
    (venv / "ready").touch()
    fetched = ROOT / "build" / "guest"
    cache = walk.folder / "build" / "guest"
    cache.mkdir(parents=True)
    for package in ("user-mode-linux", "can-utils"):
        if (fetched / package).is_dir():
            os.symlink(fetched / package, cache / package)


STEP = Step("clone", take, (("git", "git"),))
