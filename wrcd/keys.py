"""What keys of the configuration are made of: one declaration each, for the parser, the JSON schema and the docs.

Plain classes: the daemon's start would wait for dataclasses of so many kinds to be made.
"""

import math
from collections.abc import Iterable
from typing import Any

from wrcd.section import TO_FILL_IN, Section, shown, suggest

MESSAGE_SIGNAL = r"^[^.]+\.[^.]+$"


class Key:
    """A key: its name, what it means, whether it must be there, and whether SIGHUP takes it over."""

    takes = "text"  # what a value may be, in words
    default: object = None

    def __init__(self, name: str, what: str, *, needed: bool = False, reload: bool = False) -> None:
        self.name, self.what, self.needed, self.reload = name, what, needed, reload

    def read(self, section: Section) -> object:
        """The value; its default or None where it is missing, or wrong, which is a mistake. Raises InputError where a
        needed one is missing or wrong."""
        raise NotImplementedError

    @property
    def shown_default(self) -> str:
        """The default, in words."""
        if self.needed:
            return "needed"
        if self.default is None or isinstance(self.default, bool):
            return "–" if self.default is None else str(self.default).lower()
        return f"{self.default:g}" if isinstance(self.default, float) else str(self.default)


class Text(Key):
    """Any text."""

    default: str | None

    def __init__(
        self, name: str, what: str, default: str | None = None, *, needed: bool = False, reload: bool = False
    ) -> None:
        super().__init__(name, what, needed=needed, reload=reload)
        self.default = default

    def read(self, section: Section) -> str | None:
        """The text."""
        given = section.take(self.name, str) if self.needed else section.maybe(self.name, str)
        return self.default if given is None else given


class SignalName(Key):
    """Text of the form Message.Signal."""

    takes = "`Message.Signal`"


def message_and_signal(section: Section, key: str, named: str) -> tuple[str, str]:
    """The two parts of Message.Signal. Raises InputError for a text of another form."""
    message, dot, signal = named.partition(".")
    if not (dot and message and signal) or "." in signal:
        raise section.error(f"{named!r} is not of the form Message.Signal", key)
    return message, signal


class Choice(Key):
    """One of some words."""

    default: str | None

    def __init__(self, name: str, what: str, options: tuple[str, ...], default: str | None = None) -> None:
        super().__init__(name, what)
        self.options, self.default = options, default
        self.takes = ", ".join(options)

    def read(self, section: Section) -> str | None:
        """The word."""
        given = section.maybe(self.name, str)
        if given is None or given in self.options:
            return self.default if given is None else given
        reason = f"is {given!r}, not one of {self.takes}"
        section.mistake(section.error(reason, self.name, suggest(given, self.options)))
        return self.default

    def value(self, section: Section) -> str:
        """The word of a key that has a default."""
        value = self.read(section)
        assert value is not None
        return value


class Number(Key):
    """A number from low to high; nonzero: of both signs but not 0."""

    default: float | None

    def __init__(
        self,
        name: str,
        what: str,
        low: float,
        high: float,
        default: float | None = None,
        *,
        nonzero: bool = False,
        reload: bool = False,
    ) -> None:
        super().__init__(name, what, reload=reload)
        self.low, self.high, self.default, self.nonzero = low, high, default, nonzero
        self.takes = f"{low:g} … {high:g}" if math.isfinite(high) else "number but 0" if nonzero else "number"

    def read(self, section: Section) -> float | None:
        """The number."""
        value = section.maybe(self.name, float)
        if value is None:
            return self.default
        if self.nonzero and value == 0:
            section.mistake(section.error("takes a number other than 0", self.name))
            return self.default
        if not self.low <= value <= self.high:
            reason = f"takes a number from {self.low:g} to {self.high:g}, not {value:g}"
            section.mistake(section.error(reason, self.name))
            return self.default
        return value

    def value(self, section: Section) -> float:
        """The number of a key that has a default."""
        value = self.read(section)
        assert value is not None
        return value


class Whole(Key):
    """A whole number from low to high."""

    default: int | None

    def __init__(
        self,
        name: str,
        what: str,
        low: int,
        high: int,
        default: int | None = None,
        *,
        needed: bool = False,
        reload: bool = False,
    ) -> None:
        super().__init__(name, what, needed=needed, reload=reload)
        self.low, self.high, self.default = low, high, default
        self.takes = f"{low} … {high}"

    def read(self, section: Section) -> int | None:
        """The number."""
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
        """The number of a key that has a default."""
        value = self.read(section)
        assert value is not None
        return value


class Sign(Key):
    """1 or -1."""

    takes = "1, -1"
    default = 1

    def read(self, section: Section) -> int:
        """The sign."""
        value = section.get(self.name, int, 1)
        if value not in (1, -1):
            section.mistake(section.error(f"takes 1 or -1, not {value}", self.name))
            return 1
        return value


class Flag(Key):
    """True or false."""

    takes = "true, false"
    default: bool

    def __init__(self, name: str, what: str, default: bool, *, reload: bool = False) -> None:
        super().__init__(name, what, reload=reload)
        self.default = default

    def read(self, section: Section) -> bool:
        """The value."""
        return section.get(self.name, bool, self.default)


class Interval(Key):
    """Two numbers, the lower one first."""

    takes = "[low, high]"

    def read(self, section: Section) -> tuple[float, float] | None:
        """The two."""
        value = section.raw(self.name)
        if value is None:
            return None
        if isinstance(value, list) and len(value) == 2 and all(_finite(x) for x in value) and value[0] < value[1]:
            return float(value[0]), float(value[1])
        section.mistake(section.error(f"takes two numbers, the lower one first, not {shown(value)}", self.name))
        return None


class Numbers(Key):
    """Finite numbers, one for each of several things."""

    takes = "list of numbers"

    def read(self, section: Section) -> tuple[float, ...] | None:
        """The numbers. Raises InputError where they are needed and missing."""
        if self.needed and self.name not in section:
            raise section.absent(self.name, f"it takes a {self.takes}", [TO_FILL_IN])
        value = section.raw(self.name)
        if value is None:
            return None
        if isinstance(value, list) and all(_finite(x) for x in value):
            return tuple(float(x) for x in value)
        section.mistake(section.error(f"takes a {self.takes}, not {shown(value)}", self.name))
        return None


class RawValue(Key):
    """A raw value: a whole number, or a word of the signal's value table."""

    takes = "raw value or word"

    def read(self, section: Section) -> int | str | None:
        """The value."""
        value = section.raw(self.name)
        if value is None or type(value) in (int, str):
            return value  # type: ignore[no-any-return]  # one of these by the line above
        section.mistake(section.error(f"takes a whole number or a word, not {shown(value)}", self.name))
        return None


class RawValues(Key):
    """Several of them."""

    takes = "list of raw values or words"

    def read(self, section: Section) -> tuple[int | str, ...] | None:
        """The values."""
        value = section.raw(self.name)
        if value is None:
            return None
        if isinstance(value, list) and value and all(type(x) in (int, str) for x in value):
            return tuple(value)
        reason = f"takes a list of raw values or words, not {shown(value)}"
        section.mistake(section.error(reason, self.name, "write [1]"))
        return None


class Sub(Key):
    """A table of its own, or text that stands for the one key `short` of it; several: or a list of them.

    tables: its declaration, in declared.INPUTS or vocabulary.MESSAGES.
    """

    def __init__(
        self,
        name: str,
        what: str,
        tables: str,
        short: str,
        *,
        several: bool = False,
        needed: bool = False,
        default: str | None = None,
    ) -> None:
        super().__init__(name, what, needed=needed)
        self.tables, self.short, self.several, self.default = tables, short, several, default
        self.takes = "text, table or list of them" if several else "text or table"


def names(keys: Iterable[Key]) -> tuple[str, ...]:
    """The names of some keys."""
    return tuple(k.name for k in keys)


def _finite(x: Any) -> bool:
    return type(x) in (int, float) and math.isfinite(x)
