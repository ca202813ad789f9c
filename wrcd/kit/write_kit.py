"""`wrcd kit`: make the files and write them. Each says in its head who wrote it and what it was then, so that an edited
one is not lost."""

import hashlib
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from wrcd import __version__
from wrcd.config.config import load_config
from wrcd.errors import InputError, InputErrors, Status
from wrcd.kit.c_tables import tables
from wrcd.kit.field_table import fields, levels, warnings
from wrcd.kit.receiver import KitMessage, messages
from wrcd.kit.vectors import vectors, vectors_header

_PACKAGED = "the packaged DBC"
_TEMPLATES = Path(__file__).parent / "templates"
_KEY = re.compile("@([A-Z_]+)@")
_HEAD = re.compile(rb"\A[^\n]*written by wrcd kit [^\n]*; below this line: ([0-9a-f]{64})[^\n]*\n")
_COMMENTS = {".c": ("/* ", " */"), ".h": ("/* ", " */"), ".md": ("<!-- ", " -->"), "": ("# ", "")}
FILES = (
    "adhesion.h", "adhesion.c", "braking_rate.h", "braking_rate.c", "test_adhesion.c", "vectors.h",
    "example_socketcan.c", "Makefile", "fields.md", "README.md",
)  # fmt: skip


def kit(folder: Path, config_file: Path | None, force: bool) -> int:
    """Write the kit of a configuration, None: the packaged one, and say what it cannot do. Raises InputError."""
    config = load_config(config_file)
    found = messages(config)
    # cat train.toml train.dbc | sha256sum
    toml = b"" if config_file is None else config_file.read_bytes()
    checksum = hashlib.sha256(toml + config.dbc_file.read_bytes()).hexdigest()
    source = _PACKAGED if config_file is None else f"`{config_file.name}` and `{config.dbc_file.name}`"
    _write(folder, files_of(found, checksum, source), force)
    print(f"{folder}: receiver of {', '.join(m.name for m in found)}; make -C {shlex.quote(str(folder))} tests it")
    for line in warnings(found):
        print(f"warning: {line}", file=sys.stderr)
    return Status.DONE


def files_of(found: Sequence[KitMessage], configuration: str, source: str) -> dict[str, bytes]:
    """Every file's bytes by its name. The same messages give the same bytes."""
    doubts, frames = warnings(found), vectors_header(found)
    values = {
        "VERSION": __version__,
        "CHECKSUM": configuration,
        "MESSAGES": str(len(found)),
        "MAX_BYTES": str(max(m.length for m in found)),
        "SOURCE": source,
        "SUM_OF": "the DBC" if source == _PACKAGED else "the TOML file and the DBC, one after the other",
        "TABLES": tables(found),
        "FIELDS": fields(found),
        "LEVELS": levels(),
        "VECTORS": str(sum(len(vectors(m)) for m in found)),
        "WARNINGS": "".join(["\n", *(f"- **{line}**\n" for line in doubts), "\n"]) if doubts else "",
    }
    out = {}
    for name in FILES:
        if name == "vectors.h":
            body = f"/* Frames as wrcd sends them with this configuration. Only for test_adhesion.c. */\n{frames}\n"
        else:
            template = (_TEMPLATES / f"{name}.in").read_text(encoding="utf-8")
            body = _KEY.sub(lambda found: values[found[1]], template)
        begin, end = _COMMENTS[Path(name).suffix]
        below = f"below this line: {hashlib.sha256(body.encode()).hexdigest()}"
        head = f"{begin}written by wrcd kit {__version__}; configuration: {configuration}; {below}{end}"
        out[name] = f"{head}\n{body}".encode()
    return out


def _write(folder: Path, files: Mapping[str, bytes], force: bool) -> None:
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
        hint = "check the folder, its disk and your rights"
        raise InputError(f"cannot be written: {e.strerror}", file=path, hint=hint) from None


def _refusal(path: Path, force: bool) -> InputError | None:
    """What speaks against writing a file."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as e:
        return InputError(f"cannot be read: {e.strerror}", file=path, hint="give another folder")
    head = _HEAD.match(content)
    if force or (head is not None and hashlib.sha256(content[head.end() :]).hexdigest().encode() == head[1]):
        return None
    why = "was edited since" if head else "is there, and no file of a kit"
    return InputError(why, file=path, hint="move it away, give another folder, or overwrite it by --force")
