"""`wrcd kit`: make the files, write them, and say what they are."""

import hashlib
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from wrcd import __version__
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import Status
from wrcd.kit import core_files
from wrcd.kit.c_tables import tables
from wrcd.kit.field_table import fields, levels, warnings
from wrcd.kit.files import filled, headed, write
from wrcd.kit.receiver import KitMessage, messages
from wrcd.kit.vectors import vectors, vectors_header

_PACKAGED = "the packaged DBC"
FILES = (
    "adhesion.h", "adhesion.c", "test_adhesion.c", "vectors.h", "example_socketcan.c", "Makefile", "fields.md",
    "README.md",
)  # fmt: skip


def kit(folder: Path, config_file: Path | None, force: bool) -> int:
    """Write the kit of a configuration, None: the packaged one, and say what it cannot do. Raises InputError."""
    config = load_config(config_file)
    found = messages(config)
    source = _PACKAGED if config_file is None else f"`{config_file.name}` and `{config.dbc_file.name}`"
    write(folder, files_of(found, _checksum(config, config_file), source), force)
    print(f"{folder}: receiver of {', '.join(m.name for m in found)}; {_how_to_test(folder)}")
    for line in warnings(found):
        print(f"warning: {line}", file=sys.stderr)
    return Status.DONE


def core_kit(folder: Path, config_file: Path | None, force: bool) -> int:
    """Write the core with a configuration's tables and design, None: the packaged one. Raises InputError."""
    config = load_config(config_file)
    write(folder, core_files.files_of(config, _checksum(config, config_file)), force)
    axles, design = len(config.axles), core_files.name_of(config.design)
    print(f"{folder}: core of {axles} axle{'s' * (axles > 1)}, design {design}; {_how_to_test(folder)}")
    return Status.DONE


def _checksum(config: Config, config_file: Path | None) -> str:
    """cat train.toml train.dbc | sha256sum."""
    toml = b"" if config_file is None else config_file.read_bytes()
    return hashlib.sha256(toml + config.dbc_file.read_bytes()).hexdigest()


def _how_to_test(folder: Path) -> str:
    return f"make -C {shlex.quote(str(folder))} tests it"


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
    bodies = {
        name: f"/* Frames as wrcd sends them with this configuration. Only for test_adhesion.c. */\n{frames}\n"
        if name == "vectors.h"
        else filled(name, values)
        for name in FILES
    }
    return {name: headed(name, body, "configuration", configuration) for name, body in bodies.items()}
