"""A scenario's file with some keys otherwise than it says."""

import tomllib
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from wrcd.config.section import Section, TomlSource
from wrcd.config.settings import read_whole
from wrcd.errors import InputError

T = TypeVar("T")
KEPT = 16  # files of a kind that a process keeps


def read_changed(path: Path, contents: str, keys: Mapping[str, Any], read: Callable[[Section, str], T]) -> T:
    """Read a file by its own reader, with other values of some keys. contents: a digest of what is in it.

    A key goes into tables and lists by dots, places of a list from 1 on: `rail.2.mu_0`. Raises InputError: what is
    wrong in the file as it stands, at its line; what the keys make wrong, without a file.
    """
    data = tomllib.loads(_sound(path, contents, read))
    for key, value in keys.items():
        _put(data, key, value)
    try:
        return read(Section(data, TomlSource(path, {}, None), ()), path.stem)
    except InputError as e:
        raise InputError(e.reason, key=e.key, hint=e.hint) from None


@lru_cache(KEPT)
def _sound(path: Path, _contents: str, read: Callable[[Section, str], Any]) -> str:
    read_whole(path, read)
    return path.read_text(encoding="utf-8")


def _put(data: dict[str, Any], key: str, value: Any) -> None:
    """Set a key by its dotted name. Raises InputError where that leads into no table."""
    *way, last = key.split(".")
    at: Any = data
    for part in way:
        if isinstance(at, list):
            at = at[_place(at, part, key)]
        elif isinstance(at, dict):
            at = at.setdefault(part, {})
    if not isinstance(at, list | dict):
        raise InputError("leads into a value, no table", key=key, hint="see docs/reference/scenario.md")
    where: Any = _place(at, last, key) if isinstance(at, list) else last
    at[where] = value


def _place(rows: list[Any], part: str, key: str) -> int:
    if not part.isdecimal() or not 1 <= int(part) <= len(rows):
        raise InputError(f"takes a place of 1 … {len(rows)} there, not {part!r}", key=key)
    return int(part) - 1
