"""Files below a root folder: looked at, written whole or not at all, removed with the folders made for them."""

import hashlib
import os
import stat
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from pathlib import Path, PurePosixPath

from wrcd.errors import InputError
from wrcd.tools.install.files import Laid

MAX_LINKS = 40  # on the way to a file: the kernel's own limit
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
