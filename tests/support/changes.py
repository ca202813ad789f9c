"""What is otherwise in the guest's file systems than on the host below it, or lies in its own."""

import hashlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

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
