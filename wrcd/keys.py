"""What keys of the configuration are made of: one declaration each, for the parser, the JSON schema and the docs."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from wrcd.section import Section, shown, suggest

MESSAGE_SIGNAL = r"^[^.]+\.[^.]+$"


@dataclass(frozen=True, slots=True)
class Key:
    """A key: its name, and what it means. Kinds of keys add reload: whether SIGHUP takes it over."""

    name: str
    what: str

    @property
    def takes(self) -> str:
        """What a value may be, in words."""
        raise NotImplementedError

    def read(self, section: Section) -> object:
        """The value; its default or None where it is missing, or wrong, which is a mistake."""
        raise NotImplementedError

    @property
    def shown_default(self) -> str:
        """The default, in words."""
        return "–"


@dataclass(frozen=True, slots=True)
class Text(Key):
    """Any text."""

    default: str | None = None
    needed: bool = False
    reload: bool = False

    @property
    def takes(self) -> str:
        """Text."""
        return "text"

    @property
    def shown_default(self) -> str:
        """The default, or that it is needed."""
        return "needed" if self.needed else self.default or "–"

    def read(self, section: Section) -> str | None:
        """The value, its default where there is one, or None. Raises InputError where a needed one is missing."""
        given = section.take(self.name, str) if self.needed else section.maybe(self.name, str)
        return self.default if given is None else given


@dataclass(frozen=True, slots=True)
class SignalName(Key):
    """Text of the form Message.Signal."""

    needed: bool = False
    reload: bool = False

    @property
    def takes(self) -> str:
        """The form."""
        return "`Message.Signal`"

    @property
    def shown_default(self) -> str:
        """Whether it is needed."""
        return "needed" if self.needed else "–"


def message_and_signal(section: Section, key: str, named: str) -> tuple[str, str]:
    """The two parts of Message.Signal. Raises InputError for a text of another form."""
    message, dot, signal = named.partition(".")
    if not (dot and message and signal) or "." in signal:
        raise section.error(f"{named!r} is not of the form Message.Signal", key)
    return message, signal


@dataclass(frozen=True, slots=True)
class Choice(Key):
    """One of some words."""

    options: tuple[str, ...]
    default: str | None = None
    reload: bool = False

    @property
    def takes(self) -> str:
        """The words."""
        return ", ".join(self.options)

    @property
    def shown_default(self) -> str:
        """The default."""
        return self.default or "–"

    def read(self, section: Section) -> str | None:
        """The word, its default, or None."""
        given = section.maybe(self.name, str)
        if given is None or given in self.options:
            return given or self.default
        section.mistake(
            section.error(
                f"is {given!r}, not one of {', '.join(self.options)}", self.name, suggest(given, self.options)
            )
        )
        return self.default

    def value(self, section: Section) -> str:
        """The word, or its default where it has one."""
        value = self.read(section)
        assert value is not None
        return value


@dataclass(frozen=True, slots=True)
class Number(Key):
    """A number from low to high; of both signs but never 0 with nonzero."""

    low: float
    high: float
    default: float | None = None
    nonzero: bool = False
    reload: bool = False

    @property
    def takes(self) -> str:
        """Its range."""
        if math.isinf(self.high):
            return "number but 0" if self.nonzero else "number"
        return f"{self.low:g} … {self.high:g}"

    @property
    def shown_default(self) -> str:
        """The default."""
        return "–" if self.default is None else f"{self.default:g}"

    def read(self, section: Section) -> float | None:
        """The number, its default, or None."""
        value = section.maybe(self.name, float)
        if value is None:
            return self.default
        if math.isinf(self.high) and self.nonzero and value == 0:
            section.mistake(section.error("takes a number other than 0", self.name))
            return self.default
        if not self.low <= value <= self.high:
            section.mistake(
                section.error(f"takes a number from {self.low:g} to {self.high:g}, not {value:g}", self.name)
            )
            return self.default
        return value

    def value(self, section: Section) -> float:
        """The number, or its default where it has one."""
        value = self.read(section)
        assert value is not None
        return value


@dataclass(frozen=True, slots=True)
class Whole(Key):
    """A whole number from low to high."""

    low: int
    high: int
    default: int | None = None
    needed: bool = False
    reload: bool = False

    @property
    def takes(self) -> str:
        """Its range."""
        return f"{self.low} … {self.high}"

    @property
    def shown_default(self) -> str:
        """The default, or that it is needed."""
        return "needed" if self.needed else "–" if self.default is None else str(self.default)

    def read(self, section: Section) -> int | None:
        """The number, its default, or None. Raises InputError where a needed one is missing or wrong."""
        value = section.take(self.name, int) if self.needed else section.maybe(self.name, int)
        if value is None:
            return self.default
        if not self.low <= value <= self.high:
            error = section.error(f"takes {self.low} … {self.high}, not {value}", self.name)
            if self.needed:
                raise error
            section.mistake(error)
            return self.default
        return value

    def value(self, section: Section) -> int:
        """The number, or its default where it has one."""
        value = self.read(section)
        assert value is not None
        return value


@dataclass(frozen=True, slots=True)
class Sign(Key):
    """1 or -1."""

    reload: bool = False

    @property
    def takes(self) -> str:
        """The two."""
        return "1, -1"

    @property
    def shown_default(self) -> str:
        """As it is."""
        return "1"

    def read(self, section: Section) -> int:
        """The sign."""
        value = section.get(self.name, int, 1)
        if value not in (1, -1):
            section.mistake(section.error(f"takes 1 or -1, not {value}", self.name))
            return 1
        return value


@dataclass(frozen=True, slots=True)
class Flag(Key):
    """True or false."""

    default: bool
    reload: bool = False

    @property
    def takes(self) -> str:
        """The two."""
        return "true, false"

    @property
    def shown_default(self) -> str:
        """The default."""
        return str(self.default).lower()

    def read(self, section: Section) -> bool:
        """The value or its default."""
        return section.get(self.name, bool, self.default)


@dataclass(frozen=True, slots=True)
class Interval(Key):
    """Two numbers, the lower one first."""

    reload: bool = False

    @property
    def takes(self) -> str:
        """Two numbers."""
        return "[low, high]"

    def read(self, section: Section) -> tuple[float, float] | None:
        """The two, or None."""
        value = section.raw(self.name)
        if value is None:
            return None
        if isinstance(value, list) and len(value) == 2 and all(_finite(x) for x in value) and value[0] < value[1]:
            return float(value[0]), float(value[1])
        section.mistake(section.error(f"takes two numbers, the lower one first, not {shown(value)}", self.name))
        return None


@dataclass(frozen=True, slots=True)
class RawValue(Key):
    """A raw value: a whole number, or a word of the signal's value table."""

    reload: bool = False

    @property
    def takes(self) -> str:
        """Either."""
        return "raw value or word"

    def read(self, section: Section) -> int | str | None:
        """The value, or None."""
        value = section.raw(self.name)
        if value is None or type(value) in (int, str):
            return value  # type: ignore[no-any-return]  # one of these by the line above
        section.mistake(section.error(f"takes a whole number or a word, not {shown(value)}", self.name))
        return None


@dataclass(frozen=True, slots=True)
class RawValues(Key):
    """Several of them."""

    reload: bool = False

    @property
    def takes(self) -> str:
        """A list."""
        return "list of raw values or words"

    def read(self, section: Section) -> tuple[int | str, ...] | None:
        """The values, or None."""
        value = section.raw(self.name)
        if value is None:
            return None
        if isinstance(value, list) and value and all(type(x) in (int, str) for x in value):
            return tuple(value)
        section.mistake(
            section.error(f"takes a list of raw values or words, not {shown(value)}", self.name, "write [1]")
        )
        return None


@dataclass(frozen=True, slots=True)
class Sub(Key):
    """A table of its own, or text that stands for the one key `short` of it; several: or a list of them."""

    tables: str  # its declaration in configuration_keys.TABLES
    short: str | None = None
    several: bool = False
    needed: bool = False
    default: str = "–"
    reload: bool = False

    @property
    def takes(self) -> str:
        """Either."""
        return "text, table or list of them" if self.several else "text or table" if self.short else "table"

    @property
    def shown_default(self) -> str:
        """What holds where it is missing."""
        return "needed" if self.needed else self.default


def names(keys: Iterable[Key]) -> tuple[str, ...]:
    """The names of some keys."""
    return tuple(k.name for k in keys)


def _finite(x: Any) -> bool:
    return type(x) in (int, float) and math.isfinite(x)
