"""`wrcd kit`: make the files and write them."""

import hashlib
import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from wrcd import __version__
from wrcd.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import Status
from wrcd.tools.kit.fields import fields, levels, warnings
from wrcd.tools.kit.files import with_head, write
from wrcd.tools.kit.model import KitMessage, messages
from wrcd.tools.kit.tables import tables
from wrcd.tools.kit.vectors import vectors, vectors_header

_PACKAGED = "the packaged DBC"
_TEMPLATES = Path(__file__).parent / "templates"
_KEY = re.compile("@([A-Z_]+)@")
FILES = (
    "adhesion.h", "adhesion.c", "test_adhesion.c", "vectors.h", "example_socketcan.c", "Makefile", "fields.md",
    "README.md",
)  # fmt: skip


def kit(folder: Path, config_file: Path | None, force: bool) -> int:
    """Write the kit of a configuration, None: the packaged one, and say what it cannot do. Raises InputError."""
    config = load_config(config_file)
    found = messages(config)
    write(folder, files_of(found, checksum(config, config_file), _source(config, config_file)), force)
    print(f"{folder}: receiver of {', '.join(m.name for m in found)}; make -C {shlex.quote(str(folder))} tests it")
    for line in warnings(found):
        print(f"warning: {line}", file=sys.stderr)
    return Status.DONE


def checksum(config: Config, config_file: Path | None) -> str:
    """SHA-256 of the TOML, where there is one, and the DBC: cat train.toml train.dbc | sha256sum."""
    toml = b"" if config_file is None else config_file.read_bytes()
    return hashlib.sha256(toml + config.dbc_file.read_bytes()).hexdigest()


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
    bodies = {name: _filled(name, values) for name in FILES if name != "vectors.h"}
    bodies["vectors.h"] = (
        f"/* Frames as wrcd sends them with this configuration. Only for test_adhesion.c. */\n{frames}\n"
    )
    return {name: with_head(name, bodies[name], __version__, configuration) for name in FILES}


def _source(config: Config, config_file: Path | None) -> str:
    if config_file is None:
        return _PACKAGED
    return f"`{config_file.name}` and `{config.dbc_file.name}`"


def _filled(name: str, values: dict[str, str]) -> str:
    text = (_TEMPLATES / f"{name}.in").read_text(encoding="utf-8")
    return _KEY.sub(lambda found: values[found[1]], text)
