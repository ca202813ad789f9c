"""One table of a TOML file, and where in the file its keys stand."""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from wrcd.errors import InputError, InputErrors

T = TypeVar("T")
_TYPES = {str: "a string", bool: "true or false", int: "a whole number", float: "a number", list: "a list"}
TO_FILL_IN = "…"  # stands for a value that only a person knows


class TomlSource:
    """A file: its name, the lines of its keys, and the mistakes in it."""

    def __init__(
        self, file: Path | str, lines: dict[tuple[str | int, ...], int], mistakes: list[InputError] | None
    ) -> None:
        self.file, self._lines = file, lines
        self.mistakes = mistakes  # None: the first one is raised
        self.missing: dict[tuple[str | int, ...], InputError] = {}

    def line(self, path: tuple[str | int, ...]) -> int | None:
        """The line of a key, or the first one of what stands below it, or of the nearest table around it."""
        while path and path not in self._lines:
            if below := [line for key, line in self._lines.items() if key[: len(path)] == path]:
                return min(below)
            path = path[:-1]
        return self._lines.get(path)


class Section:
    """One table. Take what is known, then call done(): what is left over is an unknown key.

    A file whose mistakes are collected gives the default where a value is wrong, and goes on; only what has no default
    is raised, to be caught by collected().
    """

    def __init__(
        self,
        data: dict[str, Any],
        source: TomlSource,
        path: tuple[str | int, ...],
        short: str | None = None,
        parent: "Section | None" = None,
    ) -> None:
        self._data, self._source, self._path = data, source, path
        self._short = short  # the key whose value stands in place of the table
        self._parent = parent
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

    @property
    def name(self) -> str:
        """The table as messages call it: axle[1].torque."""
        return self._dotted(self._path)

    @staticmethod
    def _dotted(path: tuple[str | int, ...]) -> str:
        return "".join(f"[{p + 1}]" if isinstance(p, int) else f".{p}" for p in path).lstrip(".")

    def error(self, reason: str, key: str | None = None, hint: str = "") -> InputError:
        """An error at a key of this table, or at the table itself."""
        path = self._path if key is None or key == self._short else (*self._path, key)
        return InputError(reason, file=self.file, line=self._source.line(path), key=self._dotted(path), hint=hint)

    def pop(self, key: str, reason: str, hint: str) -> InputError:
        """Take a key out, as if the file did not have it; returns the error that it would be."""
        del self._data[key]
        return self.error(reason, key, hint)

    def line(self, **keys: object) -> str:
        """What to write for this table to have some keys, too, or not (None): the line, and where it stands."""
        value: object = {key: one for key, one in {**self._data, **keys}.items() if one is not None}
        table = self
        while table._parent is not None and not table._has_header:
            parent, key = table._parent, str(table._path[-1])
            if isinstance(place := table._path[-1], int):  # one of several in a list
                key = str(table._path[-2])
                value = [value if k == place else part for k, part in enumerate(parent._data[key])]
            if parent._has_header:
                return f"write in {parent._header}: {key} = {toml(value)}"
            value, table = {**parent._data, key: value}, parent
        lines = ", ".join(f"{key} = {toml(one)}" for key, one in keys.items())
        return f"write in {self._header}: {lines}" if self._path else f"write {lines}"

    @property
    def _has_header(self) -> bool:
        """Whether it stands in the file by itself, as [limits] or [[axle]]."""
        return len(self._path) < 2 or (len(self._path) == 2 and isinstance(self._path[1], int))

    @property
    def _header(self) -> str:
        return f"[{self._path[0]}]" if len(self._path) == 1 else f"[[{self._path[0]}]]"

    def mistake(self, error: InputError) -> None:
        """Collect an error, or raise it."""
        if self._source.mistakes is None:
            raise error
        self._source.mistakes.append(error)

    def refuse(self, reason: str, key: str | None = None, hint: str = "") -> None:
        """Collect or raise the error at a key of this table, or at the table itself."""
        self.mistake(self.error(reason, key, hint))

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Collect what is raised within, where mistakes are collected."""
        try:
            yield
        except InputErrors as e:
            for one in e.errors:
                self.mistake(one)
        except InputError as e:
            self.mistake(e)

    @property
    def newest_mistake(self) -> InputError:
        """To be raised where nothing goes on without the value that it is about."""
        assert self._source.mistakes
        return self._source.mistakes[-1]

    @property
    def mistakes(self) -> int:
        """How many mistakes of the file are collected so far."""
        return len(self._source.mistakes or ())

    def finish(self) -> None:
        """Raise the mistakes that were collected, in the file's order."""
        found = self._source.mistakes or []
        if found:
            found = sorted({str(e): e for e in found}.values(), key=lambda e: e.line or 0)
            raise found[0] if len(found) == 1 else InputErrors(found)

    def take(self, key: str, kind: type[T]) -> T:
        """A value that must be there. Whole numbers pass as float; true and false never pass as numbers."""
        self._known.add(key)
        if key not in self._data:
            raise self.absent(key, f"it takes {_TYPES.get(kind, kind.__name__)}", TO_FILL_IN)
        value = self._data[key]
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise self.error(f"takes {_TYPES.get(kind, kind.__name__)}, not {shown(value)}", key)
        if isinstance(value, float) and not math.isfinite(value):
            raise self.error(f"takes a finite number, not {shown(value)}", key)
        return value

    def absent(self, key: str, hint: str, example: object = None) -> InputError:
        """The error of a needed key that is missing; example: the value in the line that it shows, if any. It goes
        when done() finds the key mistyped."""
        error = self.error("is missing", key, hint if example is None else f"{hint}: {self.line(**{key: example})}")
        self.explains(key, error)
        return error

    def explains(self, key: str, error: InputError) -> None:
        """A key that is missing is the reason of an error, which goes when done() finds the key mistyped."""
        self._source.missing[(*self._path, key)] = error

    def get(self, key: str, kind: type[T], default: T) -> T:
        """A value with a default."""
        value = self.maybe(key, kind)
        return default if value is None else value

    def maybe(self, key: str, kind: type[T]) -> T | None:
        """A value or None."""
        self._known.add(key)
        with self.collected():
            return self.take(key, kind) if key in self._data else None
        return None

    def raw(self, key: str) -> Any:
        """A value of any type (None where it is missing); the caller checks it."""
        self._known.add(key)
        return self._data.get(key)

    def section(self, key: str) -> "Section":
        """A sub-table; an empty one where it is missing."""
        self._known.add(key)
        value = self._data.get(key, {})
        if not isinstance(value, dict):
            self.refuse(f"takes a table, not {shown(value)}", key, f"write [{key}]")
            value = {}
        return Section(value, self._source, (*self._path, key), parent=self)

    def sections(self, key: str) -> Iterator["Section"]:
        """An array of tables, [[key]]."""
        self._known.add(key)
        value = self._data.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            self.refuse("takes tables", key, f"write [[{key}]]")
            value = []
        for i, v in enumerate(value):
            yield Section(v, self._source, (*self._path, key, i), parent=self)

    def tables_at(self, *path: str) -> Iterator["Section"]:
        """The tables at a path of keys, one or several at each. What is no table is left to who asks for it."""
        if not path:
            yield self
            return
        found = self._data.get(path[0])
        for place, value in enumerate(found if isinstance(found, list) else [found]):
            if isinstance(value, dict):
                at = (*self._path, path[0], *((place,) if isinstance(found, list) else ()))
                yield from Section(value, self._source, at, parent=self).tables_at(*path[1:])

    def table_or_text(self, key: str, short: str) -> "Section | None":
        """A sub-table, or a text that stands for one whose key `short` has it. None where it is missing or neither."""
        self._known.add(key)
        return self._shortened(self._data[key], (*self._path, key), short) if key in self._data else None

    def usual(self, key: str, short: str, text: str) -> "Section":
        """The table that holds where the key is missing."""
        return Section({short: text}, self._source, (*self._path, key), short, self)

    def place(self, key: str, short: str) -> "Section":
        """Where a sub-table stands, for errors; text may stand for it."""
        return Section({}, self._source, (*self._path, key), None if isinstance(self._data.get(key), dict) else short)

    def tables_or_text(self, key: str, short: str) -> list["Section"]:
        """The same, or several of them in a list."""
        self._known.add(key)
        value = self._data.get(key, [])
        path = (*self._path, key)
        if not isinstance(value, list):
            found = [self._shortened(value, path, short)]
        elif value or key not in self._data:
            found = [self._shortened(v, (*path, i), short) for i, v in enumerate(value)]
        else:
            self.refuse("takes text, a table or several of them, not an empty list", key)
            found = []
        return [s for s in found if s is not None]

    def _shortened(self, value: Any, path: tuple[str | int, ...], short: str) -> "Section | None":
        if isinstance(value, str):
            return Section({short: value}, self._source, path, short, self)
        if isinstance(value, dict):
            return Section(value, self._source, path, parent=self)
        error = Section({}, self._source, path).error(f"takes text or a table, not {shown(value)}")
        self.mistake(error)
        return None

    def strings(self) -> Iterator[str]:
        """Every string of this table and of those in it, whether or not it is asked for."""
        left: list[Any] = [self._data]
        while left:
            value = left.pop()
            if isinstance(value, str):
                yield value
            else:
                left += value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()

    def done(self, keys: Iterable[str] | None = None) -> None:
        """Every key has been asked for, or those that were not are errors. A needed key that is only mistyped is not
        missing, too. keys: those that may be there, whatever was asked for."""
        known = self._known if keys is None else set(keys)
        for key in self._data:
            if key in known:
                continue
            near = nearest(key, known)
            missing = self._source.missing.pop((*self._path, near), None)
            if missing is not None and self._source.mistakes is not None and missing in self._source.mistakes:
                self._source.mistakes.remove(missing)
            hint = _meant(near) if near else f"known here: {', '.join(sorted(known))}"
            self.refuse("unknown key", key, hint)


def toml(value: object) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {toml(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml, value)) + "]"
    return str(value).removesuffix(".0")  # of a float every digit: a line that is shown holds what the file has, too


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key, ensure_ascii=False)


def shown(value: object) -> str:
    """A value as TOML writes it, more or less."""
    return str(value).lower() if isinstance(value, bool) else repr(value)


def nearest(word: str, options: Iterable[str]) -> str:
    """The option that is nearest to a mistyped word, or nothing."""
    import difflib  # only for a person who mistyped; it is slow to import

    near = difflib.get_close_matches(word, list(options), n=1, cutoff=0.6)
    return near[0] if near else ""


def suggest(word: str, options: Iterable[str]) -> str:
    """A hint that names the nearest option, or nothing."""
    near = nearest(word, options)
    return _meant(near) if near else ""


def _meant(word: str) -> str:
    return f"did you mean {word!r}?"
