"""The files of a kit: each says in its head who wrote it and what it was then, so that an edited one is not lost."""

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from wrcd.errors import InputError, InputErrors

MARK = "wrcd kit"
_HEAD = re.compile(rb"\A[^\n]*written by wrcd kit [^\n]*; below this line: ([0-9a-f]{64})[^\n]*\n")
_COMMENTS = {".c": ("/* ", " */"), ".h": ("/* ", " */"), ".md": ("<!-- ", " -->"), "": ("# ", "")}


def with_head(name: str, body: str, version: str, configuration: str) -> bytes:
    """The file's bytes: its head, and the body, whose checksum the head has."""
    begin, end = _COMMENTS[Path(name).suffix]
    below = hashlib.sha256(body.encode()).hexdigest()
    head = f"{begin}written by {MARK} {version}; configuration: {configuration}; below this line: {below}{end}\n"
    return (head + body).encode()


def is_untouched(content: bytes) -> bool:
    """Whether a file is as a kit has written it."""
    found = _HEAD.match(content)
    return found is not None and hashlib.sha256(content[found.end() :]).hexdigest().encode() == found[1]


def write(folder: Path, files: Mapping[str, bytes], force: bool) -> None:
    """Write them all, or none: raises InputError for a folder that cannot be made or written, a full disk, and files in
    it that are not a kit's, or were edited; force: overwrite those."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be made: {e.strerror}", file=folder, key="-o", hint="give another folder") from None
    errors = [error for name in files if (error := _refusal(folder / name, force))]
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors)
    path = folder
    try:
        with TemporaryDirectory(prefix=".kit-", dir=folder) as beside:
            for name, content in files.items():
                path = folder / name
                (Path(beside) / name).write_bytes(content)
            for name in files:
                path = folder / name
                (Path(beside) / name).replace(path)
    except OSError as e:
        raise InputError(
            f"cannot be written: {e.strerror}", file=path, hint="check the folder, its disk and your rights"
        ) from None


def _refusal(path: Path, force: bool) -> InputError | None:
    """What speaks against writing a file."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as e:
        return InputError(f"cannot be read: {e.strerror}", file=path, hint="give another folder")
    if force or is_untouched(content):
        return None
    why = "was edited since" if _HEAD.match(content) else "is there, and no file of a kit"
    return InputError(why, file=path, hint="move it away, give another folder, or overwrite it by --force")
