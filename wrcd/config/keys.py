"""What keys of the configuration are made of: one declaration each.

Plain classes: the daemon's start would wait for dataclasses of so many kinds to be made.
"""

import math
import re
from collections.abc import Iterable
from typing import Any, Generic, TypeAlias, TypeVar

from wrcd.config.packaged_designs import design_path
from wrcd.config.section import Section, shown, suggest
from wrcd.errors import InputError

MESSAGE_SIGNAL = r"^[^.]+\.[^.]+$"
RawNames: TypeAlias = tuple[int | str, ...]  # raw values, or words of a value table
T = TypeVar("T")


class KeyOf(Generic[T]):
    """A key: its name, what it means, and whether it must be there."""

    def __init__(self, name: str, what: str, default: T | None = None, *, needed: bool = False) -> None:
        self.name, self.what, self.default, self.needed = name, what, default, needed

    def read(self, section: Section) -> T | None:
        """The value; its default or None where it is missing, or wrong, which is a mistake. Raises InputError where a
        needed one is missing or wrong."""
        raise NotImplementedError

    def value(self, section: Section) -> T:
        """The value of a key that has a default, or is there. Raises InputError where it is wrong and has none."""
        value = self.read(section)
        if value is None:
            raise section.newest_mistake
        return value

    def refuse(self, section: Section, reason: str, hint: str = "") -> T | None:
        """Raise the mistake of a needed value; collect that of another one and return the default."""
        error = section.error(reason, self.name, hint)
        if self.needed:
            raise error
        section.mistake(error)
        return self.default

    @property
    def shown_default(self) -> str:
        """The default, in words."""
        if self.needed:
            return "needed"
        if self.default is None or isinstance(self.default, bool):
            return "–" if self.default is None else str(self.default).lower()
        return f"{self.default:g}" if isinstance(self.default, float) else str(self.default)


Key: TypeAlias = KeyOf[Any]  # whatever it takes


class Text(KeyOf[str]):
    """Any text."""

    def read(self, section: Section) -> str | None:
        """The text."""
        given = section.take(self.name, str) if self.needed else section.maybe(self.name, str)
        return self.default if given is None else given


class DesignFile(KeyOf[str]):
    """The name of a packaged design, or a path."""

    def read(self, section: Section) -> str | None:
        """The text, for design_path()."""
        given = section.maybe(self.name, str)
        try:
            if given is not None:
                design_path(given)
        except InputError as e:
            return self.refuse(section, e.reason, e.hint)
        return given


class SignalName(KeyOf[str]):
    """Text of the form Message.Signal."""

    def named(self, section: Section) -> tuple[str, str]:
        """The two parts. Raises InputError for a text of another form."""
        text = section.take(self.name, str)
        if not re.fullmatch(MESSAGE_SIGNAL, text):
            raise section.error(f"{text!r} is not of the form Message.Signal", self.name)
        message, _, signal = text.partition(".")
        return message, signal


class Choice(KeyOf[str]):
    """One of some words."""

    def __init__(self, name: str, what: str, options: tuple[str, ...], default: str | None = None) -> None:
        super().__init__(name, what, default)
        self.options = options

    def read(self, section: Section) -> str | None:
        """The word."""
        given = section.maybe(self.name, str)
        if given is None or given in self.options:
            return self.default if given is None else given
        return self.refuse(section, f"is {given!r}, not one of {', '.join(self.options)}", suggest(given, self.options))


class Number(KeyOf[float]):
    """A number from low to high; nonzero: of both signs but not 0."""

    def __init__(
        self, name: str, what: str, low: float, high: float, default: float | None = None, *,
        nonzero: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(name, what, default)
        self.low, self.high, self.nonzero = low, high, nonzero

    def read(self, section: Section) -> float | None:
        """The number."""
        value = section.maybe(self.name, float)
        if value is None:
            return self.default
        if self.nonzero and value == 0:
            return self.refuse(section, "takes a number other than 0")
        if not self.low <= value <= self.high:
            return self.refuse(section, f"takes a number from {self.low:g} to {self.high:g}, not {value:g}")
        return value


class Whole(KeyOf[int]):
    """A whole number from low to high."""

    def __init__(
        self, name: str, what: str, low: int, high: int, default: int | None = None, *,
        needed: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(name, what, default, needed=needed)
        self.low, self.high = low, high

    def read(self, section: Section) -> int | None:
        """The number."""
        value = section.take(self.name, int) if self.needed else section.maybe(self.name, int)
        if value is None:
            return self.default
        return (
            value
            if self.low <= value <= self.high
            else self.refuse(section, f"takes {self.low} … {self.high}, not {value}")
        )


class Sign(KeyOf[int]):
    """1 or -1."""

    def read(self, section: Section) -> int:
        """The sign."""
        value = section.get(self.name, int, 1)
        return value if value in (1, -1) else self.refuse(section, f"takes 1 or -1, not {value}") or 1


class Flag(KeyOf[bool]):
    """True or false."""

    def read(self, section: Section) -> bool:
        """The value."""
        return section.get(self.name, bool, bool(self.default))


class Interval(KeyOf[tuple[float, float]]):
    """Two numbers, the lower one first."""

    def read(self, section: Section) -> tuple[float, float] | None:
        """The two."""
        value = section.raw(self.name)
        if value is None:
            return None
        if isinstance(value, list) and len(value) == 2 and all(_finite(x) for x in value) and value[0] < value[1]:
            return float(value[0]), float(value[1])
        return self.refuse(section, f"takes two numbers, the lower one first, not {shown(value)}")


class RawValue(KeyOf[int | str]):
    """A raw value: a whole number, or a word of the signal's value table."""

    def read(self, section: Section) -> int | str | None:
        """The value."""
        value = section.raw(self.name)
        if value is None or type(value) in (int, str):
            return value  # type: ignore[no-any-return]  # one of these by the line above
        return self.refuse(section, f"takes a whole number or a word, not {shown(value)}")


class RawValues(KeyOf[RawNames]):
    """Several of them."""

    def read(self, section: Section) -> RawNames | None:
        """The values."""
        value = section.raw(self.name)
        if value is None:
            return None
        if isinstance(value, list) and value and all(type(x) in (int, str) for x in value):
            return tuple(value)
        return self.refuse(section, f"takes a list of raw values or words, not {shown(value)}", "write [1]")


class Sub(KeyOf[str]):
    """A table of its own, or text that stands for the one key of it that is needed; several: or a list of them."""


def names(keys: Iterable[Key]) -> tuple[str, ...]:
    """The names of some keys."""
    return tuple(k.name for k in keys)


def _finite(x: Any) -> bool:
    return type(x) in (int, float) and math.isfinite(x)
