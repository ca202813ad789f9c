"""Files below a root folder: looked at, written whole or not at all, removed with the folders made for them; the links
that enable units there, and the record of what was installed, by which our own files are distinguished from others'."""

import hashlib
import json
import os
import stat
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any

from wrcd.cli.installation.lay_out import Laid
from wrcd.errors import InputError

MAX_LINKS = 40  # on the way to a file: the kernel's own limit
ENABLED = "etc/systemd/system"  # where systemctl enable makes the links by which units start with the computer ...
FOLDERS = ("*.wants", "*.requires")  # ... in these
RECORD = "usr/local/lib/wrcd/installed.json"
FORMAT = "wrcd-installed/1"
NO_FILE = "no file"  # the checksum of what is neither file nor link


class Tree:
    """Paths are from the root on, without the first slash. No link leads out: "/" and ".." are of the root's inside."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def require_place(self) -> None:
        """Raise InputError if the root is no folder and cannot become one."""
        there = next((p for p in (self.root, *self.root.parents) if os.path.lexists(p)), None)
        if there is not None and not there.is_dir():
            raise InputError("is no folder", file=there, key="--prefix")

    def path(self, name: str) -> Path:
        """Where it lies, links of its folders followed. The last part may be a symbolic link."""
        parts = PurePosixPath(name)
        return self.folder(str(parts.parent)) / parts.name

    def folder(self, name: str) -> Path:
        """Where a folder lies, all links followed as if the root were "/". Raises InputError for links in a circle."""
        parts: list[str] = []  # without a link
        left, links = list(reversed(PurePosixPath(name).parts)), 0
        while left:
            part = left.pop()
            if part in ("/", ".."):
                parts = [] if part == "/" else parts[:-1]
                continue
            path = self.root.joinpath(*parts, part)
            if not path.is_symlink():
                parts.append(part)
                continue
            links += 1
            if links > MAX_LINKS:
                raise InputError("too many symbolic links", file=self.root / name)
            left += reversed(PurePosixPath(path.readlink()).parts)
        return self.root.joinpath(*parts)

    def free(self, name: str, is_free: Callable[[str], bool] | None = None) -> str:
        """Return the first of name, name-2, name-3 ... where nothing is, or what is_free() says may be overwritten."""
        names = (name if n == 1 else f"{name}-{n}" for n in count(1))
        return next(n for n in names if self.checksum(n) is None or (is_free is not None and is_free(n)))

    def checksum(self, name: str) -> str | None:
        """As Laid.checksum says it; None if there is nothing. What is neither file nor link has one that fits none."""
        path = self.path(name)
        try:
            kind = path.lstat().st_mode
            if stat.S_ISLNK(kind):
                return f"-> {path.readlink()}"
            return hashlib.sha256(path.read_bytes()).hexdigest() if stat.S_ISREG(kind) else NO_FILE
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as e:
            raise InputError(f"cannot be read: {e.strerror}", file=path) from None

    def make_folders(self, name: str) -> list[str]:
        """Make the folders above a file. Return those that were not there, the outermost first."""
        self._try(self.root, lambda: self.root.mkdir(parents=True, exist_ok=True))
        made: list[str] = []
        for parent in reversed(Path(name).parents[:-1]):
            path = self.folder(str(parent))
            if not path.is_dir():
                self._try(path, lambda path=path: (path.mkdir(mode=0o755), path.chmod(0o755)))  # type: ignore[misc]
                made.append(str(parent))
        return made

    def write(self, name: str, laid: Laid) -> None:
        """Put a file or a link in place at once: a power failure leaves the old one or the new one."""
        path = self.path(name)
        beside = path.with_name(f".{path.name}.wrcd-new")
        self._try(path, lambda: self._write(path, beside, laid))

    def _write(self, path: Path, beside: Path, laid: Laid) -> None:
        with suppress(FileNotFoundError):
            beside.unlink()  # of an installation that was cut off
        if laid.target:
            beside.symlink_to(laid.target)
        else:
            with beside.open("xb") as f:
                f.write(laid.content)
                os.fchmod(f.fileno(), 0o644)
                f.flush()
                os.fsync(f.fileno())
        beside.replace(path)
        self._sync(path.parent)

    def remove(self, name: str) -> None:
        """Remove a file or a link that may be there."""
        path = self.path(name)
        with suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()
            self._try(path, path.unlink)

    def rename(self, name: str, to: str) -> None:
        """Rename a file; one that has the name already is lost."""
        path = self.path(name)
        self._try(path, lambda: path.replace(self.path(to)))

    def remove_empty(self, folders: list[str]) -> list[str]:
        """Remove the folders that are empty, the innermost first. Return those that are left and there."""
        left: list[str] = []
        for name in sorted(folders, key=lambda f: f.count("/"), reverse=True):
            try:
                self.path(name).rmdir()
            except FileNotFoundError:
                pass
            except OSError:
                left.append(name)
        return sorted(left)

    @staticmethod
    def _sync(folder: Path) -> None:
        fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)

    @staticmethod
    def _try(path: Path, action: Callable[[], object]) -> None:
        try:
            action()
        except OSError as e:
            raise InputError(
                f"cannot be changed: {e.strerror}", file=path, hint="check what is there, and your rights"
            ) from None


def enabled_links(tree: Tree, targets: Collection[str]) -> list[str]:
    """Paths of the enabled units whose links point to one of these files, or relatively to their names."""
    names = {target.rpartition("/")[2] for target in targets}
    found: list[str] = []
    for pattern in FOLDERS:
        for folder in sorted(f for f in tree.folder(ENABLED).glob(pattern) if f.is_dir()):
            links = (link for link in sorted(folder.iterdir()) if link.is_symlink())
            found += [str(link.relative_to(tree.root)) for link in links if _points_to(link, targets, names)]
    return found


def _points_to(link: Path, targets: Collection[str], names: Iterable[str]) -> bool:
    target = str(link.readlink())
    return target in targets or (not target.startswith("/") and target.rpartition("/")[2] in names)


@dataclass(slots=True)
class Manifest:
    """Paths are from the root on. A file has several checksums while an installation goes on: any of them is ours."""

    version: str
    program: str
    groups: list[str]
    files: dict[str, list[str]] = field(default_factory=dict)
    beside: dict[str, list[str]] = field(default_factory=dict)  # new files that wait beside edited ones
    folders: list[str] = field(default_factory=list)  # that were made
    boot: str = ""  # the kernel's id of the start during which something last changed ...
    changed_us: int = 0  # ... and CLOCK_MONOTONIC then

    def owns(self, path: str, checksum: str | None) -> bool:
        """Whether a file is as it was installed."""
        return checksum in self.files.get(path, ()) or checksum in self.beside.get(path, ())


def read_manifest(tree: Tree) -> Manifest | None:
    """Return the record, or None if nothing was installed. Raises InputError for one that cannot be used."""
    path = tree.path(RECORD)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read: {e}", file=path, hint=_hint(path)) from None
    return _manifest(document, path)


def write_manifest(tree: Tree, manifest: Manifest) -> None:
    """Write the record, and note the folders made for it in it."""
    manifest.folders = sorted({*manifest.folders, *tree.make_folders(RECORD)})
    document = {"format": FORMAT} | {name: getattr(manifest, name) for name in manifest.__slots__}
    tree.write(RECORD, Laid((json.dumps(document, indent=1, sort_keys=True) + "\n").encode()))


def _manifest(document: Any, path: Path) -> Manifest:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"is not in the format {FORMAT}", file=path, hint=_hint(path))
    try:
        manifest = Manifest(**{name: value for name, value in document.items() if name != "format"})
        paths = [*manifest.files, *manifest.beside, *manifest.folders]
    except TypeError as e:
        raise InputError(f"has other keys: {e}", file=path, hint=_hint(path)) from None
    if wrong := [p for p in paths if p.startswith("/") or ".." in p.split("/")]:
        raise InputError(f"names a path that is none below the root: {wrong[0]}", file=path, hint=_hint(path))
    return manifest


def _hint(path: Path) -> str:
    return f"a newer version may have written it: use that one; or move {path.name} away and install again"
