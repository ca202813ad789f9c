"""TOML read strictly: every key is known, of the right type and in range, or the error says where and what to do.

A file is read to its first mistake, which is raised, or with all of its mistakes collected.
"""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from wrcd.config.section import Section, TomlSource, nearest, suggest
from wrcd.errors import InputError, NotThere

__all__ = ["Section", "nearest", "parse_toml", "read_toml", "read_whole", "suggest"]
T = TypeVar("T")


def read_toml(path: Path, *, collect: bool = False) -> "Section":
    """Open a TOML file for strict reading. Raises InputError with the line when it is missing or malformed.

    collect: mistakes in it are collected; Section.finish() raises them.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise NotThere("no such file", file=path, hint="check the path") from None
    except OSError as e:
        raise NotThere(f"cannot be read: {e.strerror}", file=path, hint="check your rights and the disk") from None
    except UnicodeDecodeError as e:
        raise InputError(f"cannot be read: {e}", file=path) from None
    return parse_toml(text, path, collect=collect)


def read_whole(path: Path, read: Callable[[Section, str], T]) -> T:
    """What `read` makes of a file's tables and its name. Raises all mistakes that it comes to at once."""
    top = read_toml(path, collect=True)
    made: list[T] = []
    with top.collected():
        made.append(read(top, path.stem))
    top.finish()
    return made[0]


def parse_toml(text: str, file: Path | str, *, collect: bool = False) -> "Section":
    """The same for text that is already there; file is what messages call it."""
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise InputError("not valid TOML: nested too deeply", file=file) from None
    except tomllib.TOMLDecodeError as e:
        at = re.search(r"\(at line (\d+)", str(e))
        reason = re.sub(r" \(at .*\)$", "", str(e))
        line = int(at[1]) if at else text.count("\n") + 1
        raise InputError(f"not valid TOML: {reason}", file=file, line=line) from None
    except ValueError as e:  # a number of thousands of digits
        raise InputError(f"not valid TOML: {e}", file=file) from None
    source = TomlSource(file, _lines(text), [] if collect else None)
    _check_numbers(data, source)
    return Section(data, source, ())


def _check_numbers(data: dict[str, Any], source: "TomlSource") -> None:
    """Whole numbers have 64 bits in TOML. Longer ones would overflow wherever they are used."""
    left: list[tuple[tuple[str | int, ...], Any]] = [((), data)]
    while left:
        path, value = left.pop()
        if type(value) is int and not -(1 << 63) <= value < 1 << 63:
            raise Section({}, source, path).error("takes whole numbers of at most 64 bits")
        inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        left += [((*path, k), v) for k, v in inside]


def _lines(text: str) -> dict[tuple[str | int, ...], int]:
    """Line numbers of tables and keys, by path; [[arrays]] carry their index. Enough to point at, not a parser."""
    found: dict[tuple[str | int, ...], int] = {}
    table: tuple[str | int, ...] = ()
    counts: dict[tuple[str | int, ...], int] = {}

    def inner(dotted: str) -> tuple[str | int, ...]:
        """[axle.adhesion] is of the newest [[axle]]."""
        head, *rest = _split(dotted)
        return (head, counts[(head,)], *rest) if rest and (head,) in counts else (head, *rest)

    for number, line in enumerate(text.splitlines(), 1):
        if m := re.match(r"\s*\[\[\s*([^\[\]]+?)\s*\]\]", line):
            name = inner(m[1])
            counts[name] = counts.get(name, -1) + 1
            table = (*name, counts[name])
            found.setdefault(name, number)
            found[table] = number
        elif m := re.match(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?$", line):
            table = inner(m[1])
            found.setdefault(table, number)
        elif m := re.match(r"""\s*([A-Za-z0-9_\-."']+)\s*=""", line):
            path = table
            for part in _split(m[1]):
                path = (*path, part)
                found.setdefault(path, number)
    return found


def _split(dotted: str) -> tuple[str, ...]:
    """The parts of a key: a dot within quotes parts nothing. Escapes are not read: such a key has no line."""
    return tuple(part.strip().strip("\"'") for part in re.findall(r"""\s*(?:"[^"]*"|'[^']*'|[^."']+)\s*""", dotted))
