"""TOML read strictly: every key is known, of the right type and in range, or the error says where and what to do."""

import math
import re
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from wrcd.errors import InputError, NotThere

T = TypeVar("T")
_TYPES = {str: "a string", bool: "true or false", int: "a whole number", float: "a number", list: "a list"}


def read_toml(path: Path) -> "Section":
    """Open a TOML file for strict reading. Raises InputError with the line when it is missing or malformed."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise NotThere("no such file", file=path, hint="check the path") from None
    except OSError as e:
        raise NotThere(f"cannot be read: {e.strerror}", file=path, hint="check your rights and the disk") from None
    except UnicodeDecodeError as e:
        raise InputError(f"cannot be read: {e}", file=path) from None
    return parse_toml(text, path)


def parse_toml(text: str, file: Path | str) -> "Section":
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
    source = _Source(file, _lines(text))
    _check_numbers(data, source)
    return Section(data, source, ())


def _check_numbers(data: dict[str, Any], source: "_Source") -> None:
    """Whole numbers have 64 bits in TOML. Longer ones would overflow wherever they are used."""
    left: list[tuple[tuple[str | int, ...], Any]] = [((), data)]
    while left:
        path, value = left.pop()
        if type(value) is int and not -(1 << 63) <= value < 1 << 63:
            raise Section({}, source, path).error("takes whole numbers of at most 64 bits")
        inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        left += [((*path, k), v) for k, v in inside]


class _Source:
    def __init__(self, file: Path | str, lines: dict[tuple[str | int, ...], int]) -> None:
        self.file, self._lines = file, lines

    def line(self, path: tuple[str | int, ...]) -> int | None:
        while path and path not in self._lines:
            path = path[:-1]
        return self._lines.get(path)


def _lines(text: str) -> dict[tuple[str | int, ...], int]:
    """Line numbers of tables and keys, by path; [[arrays]] carry their index. Enough to point at, not a parser."""
    found: dict[tuple[str | int, ...], int] = {}
    table: tuple[str | int, ...] = ()
    counts: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if m := re.match(r"\s*\[\[\s*([^\[\]]+?)\s*\]\]", line):
            counts[m[1]] = counts.get(m[1], -1) + 1
            table = (*_split(m[1]), counts[m[1]])
            found.setdefault(table[:-1], number)
            found[table] = number
        elif m := re.match(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?$", line):
            table = _split(m[1])
            found[table] = number
        elif m := re.match(r"""\s*([A-Za-z0-9_\-."']+)\s*=""", line):
            path = table
            for part in _split(m[1]):
                path = (*path, part)
                found.setdefault(path, number)
    return found


def _split(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


class Section:
    """One table. Take what is known, then call done(): what is left over is an unknown key."""

    def __init__(self, data: dict[str, Any], source: _Source, path: tuple[str | int, ...]) -> None:
        self._data, self._source, self._path = data, source, path
        self._known: set[str] = set()

    @property
    def file(self) -> Path | str:
        """The file as messages call it."""
        return self._source.file

    def __contains__(self, key: str) -> bool:
        return key in self._data

    def __iter__(self) -> Iterator[str]:
        """The keys present, in the file's order."""
        return iter(self._data)

    def error(self, reason: str, key: str | None = None, hint: str = "") -> InputError:
        """An error at a key of this table, or at the table itself."""
        path = self._path if key is None else (*self._path, key)
        dotted = "".join(f"[{p + 1}]" if isinstance(p, int) else f".{p}" for p in path).lstrip(".")
        return InputError(reason, file=self.file, line=self._source.line(path), key=dotted, hint=hint)

    def take(self, key: str, kind: type[T]) -> T:
        """A value that must be there. Whole numbers pass as float; true and false never pass as numbers."""
        self._known.add(key)
        if key not in self._data:
            raise self.error("is missing", key, f"it takes {_TYPES.get(kind, kind.__name__)}")
        value = self._data[key]
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise self.error(f"takes {_TYPES.get(kind, kind.__name__)}, not {value!r}", key)
        if isinstance(value, float) and not math.isfinite(value):
            raise self.error(f"takes a finite number, not {value!r}", key)
        return value

    def get(self, key: str, kind: type[T], default: T) -> T:
        """A value with a default."""
        self._known.add(key)
        return self.take(key, kind) if key in self._data else default

    def maybe(self, key: str, kind: type[T]) -> T | None:
        """A value or None."""
        self._known.add(key)
        return self.take(key, kind) if key in self._data else None

    def number(self, key: str, default: float, low: float, high: float) -> float:
        """A number within low … high."""
        value = self.get(key, float, default)
        if not low <= value <= high:
            raise self.error(f"takes a number from {low:g} to {high:g}, not {value:g}", key)
        return value

    def choice(self, key: str, options: Iterable[str], default: str) -> str:
        """One of some words."""
        value = self.get(key, str, default)
        names = list(options)
        if value not in names:
            raise self.error(f"is {value!r}, not one of {', '.join(names)}", key, suggest(value, names))
        return value

    def raw(self, key: str) -> Any:
        """A value of any type (None where it is missing); the caller checks it."""
        self._known.add(key)
        return self._data.get(key)

    def section(self, key: str) -> "Section":
        """A sub-table; an empty one where it is missing."""
        self._known.add(key)
        value = self._data.get(key, {})
        if not isinstance(value, dict):
            raise self.error(f"takes a table, not {value!r}", key, f"write [{key}]")
        return Section(value, self._source, (*self._path, key))

    def sections(self, key: str) -> Iterator["Section"]:
        """An array of tables, [[key]]."""
        self._known.add(key)
        value = self._data.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            raise self.error("takes tables", key, f"write [[{key}]]")
        for i, v in enumerate(value):
            yield Section(v, self._source, (*self._path, key, i))

    def strings(self) -> Iterator[str]:
        """Every string of this table and of those in it, whether or not it is asked for."""
        left: list[Any] = [self._data]
        while left:
            value = left.pop()
            if isinstance(value, str):
                yield value
            else:
                left += value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()

    def done(self) -> None:
        """Every key has been asked for, or the first one that was not is an error."""
        for key in self._data:
            if key not in self._known:
                hint = suggest(key, self._known) or f"known here: {', '.join(sorted(self._known))}"
                raise self.error("unknown key", key, hint)


def suggest(word: str, options: Iterable[str]) -> str:
    """A hint that names the nearest option, or nothing."""
    import difflib  # only for a person who mistyped; it is slow to import

    near = difflib.get_close_matches(word, list(options), n=1, cutoff=0.6)
    return f"did you mean {near[0]!r}?" if near else ""
