"""The files of a kit: each says in its head who wrote it, of what and what it was then, so that an edited one is not
lost."""

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from wrcd import __version__
from wrcd.errors import InputError, InputErrors

_TEMPLATES = Path(__file__).parent / "templates"
_KEY = re.compile("@([A-Z_]+)@")
_HEAD = re.compile(rb"\A[^\n]*written by wrcd kit \S+; (\w+): [^\n]*; below this line: ([0-9a-f]{64})[^\n]*\n")
_COMMENTS = {".c": ("/* ", " */"), ".h": ("/* ", " */"), ".md": ("<!-- ", " -->"), "": ("# ", "")}


def filled(template: str, values: Mapping[str, str]) -> str:
    """A template's text with the values of its keys."""
    text = (_TEMPLATES / f"{template}.in").read_text(encoding="utf-8")
    return _KEY.sub(lambda found: values[found[1]], text)


def headed(name: str, body: str, kind: str, of: str) -> bytes:
    """A file's bytes. kind: what it was made from in a word, which tells one kit from another; of: its checksum."""
    begin, end = _COMMENTS[Path(name).suffix]
    below = f"below this line: {hashlib.sha256(body.encode()).hexdigest()}"
    return f"{begin}written by wrcd kit {__version__}; {kind}: {of}; {below}{end}\n{body}".encode()


def write(folder: Path, files: Mapping[str, bytes], force: bool) -> None:
    """Write them all, or none: raises InputError for a folder that cannot be made or written, a full disk, and files in
    it that are not this kit's, or were edited; force: overwrite those."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be made: {e.strerror}", file=folder, key="-o", hint="give another folder") from None
    errors = [error for name in files if (error := _refusal(folder / name, files[name], force))]
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
        hint = "check the folder, its disk and your rights"
        raise InputError(f"cannot be written: {e.strerror}", file=path, hint=hint) from None


def _refusal(path: Path, new: bytes, force: bool) -> InputError | None:
    """What speaks against writing a file."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as e:
        return InputError(f"cannot be read: {e.strerror}", file=path, hint="give another folder")
    head, own = _HEAD.match(content), _HEAD.match(new)
    assert own
    if force:
        return None
    if head is None:
        why = "is there, and no file of a kit"
    elif hashlib.sha256(content[head.end() :]).hexdigest().encode() != head[2]:
        why = "was edited since"
    elif head[1] != own[1]:
        why = "is another kit's"
    else:
        return None
    return InputError(why, file=path, hint="move it away, give another folder, or overwrite it by --force")
