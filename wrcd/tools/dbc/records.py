"""What a DBC's text says, statement by statement, with lines. A wrong number is a number here: lint judges it."""

from dataclasses import dataclass, field
from pathlib import Path

EXTENDED = 0x8000_0000  # in a DBC the number of an extended id carries this bit
NO_MESSAGE = 0xC000_0000  # Vector's holder of signals that belong to no message
NO_MESSAGE_NAME = "VECTOR__INDEPENDENT_SIG_MSG"
NO_NODE = "Vector__XXX"


@dataclass(frozen=True, slots=True)
class Attribute:
    """A value that BA_ gives a message or a signal."""

    line: int
    value: str
    is_text: bool


@dataclass(slots=True)
class Words:
    """The value table of a signal: raw values and their words, in the file's order."""

    line: int
    pairs: list[tuple[int, str]]


@dataclass(slots=True)
class Signal:
    """An SG_ line, with what VAL_, BA_ and SIG_VALTYPE_ say about it. low and high: [min|max], None for [0|0]."""

    line: int
    name: str
    mux: str
    start: int
    length: int
    big_endian: bool
    signed: bool
    scale: float
    offset: float
    low: float | None
    high: float | None
    unit: str
    receivers: tuple[str, ...]
    is_float: bool = False
    words: Words | None = None
    attributes: dict[str, Attribute] = field(default_factory=dict)
    comment: str = ""

    @property
    def lowest_raw(self) -> int:
        """The lowest raw value that the bits hold."""
        return -(1 << self.length - 1) if self.signed and self.length else 0

    @property
    def highest_raw(self) -> int:
        """The highest raw value that the bits hold."""
        return (1 << self.length - self.signed) - 1 if self.length else 0

    @property
    def bits(self) -> frozenset[int]:
        """Places of its bits in the frame: 8 times the byte, plus the bit within it."""
        if not self.big_endian:
            return frozenset(range(self.start, self.start + self.length))
        first = 8 * (self.start // 8) + 7 - self.start % 8
        return frozenset(8 * (p // 8) + 7 - p % 8 for p in range(first, first + self.length))


@dataclass(slots=True)
class Message:
    """A BO_ line with its signals, and what BA_ says about it."""

    line: int
    number: int  # as it stands in the file
    name: str
    length: int
    sender: str
    signals: list[Signal] = field(default_factory=list)
    attributes: dict[str, Attribute] = field(default_factory=dict)

    @property
    def can_id(self) -> int:
        """The id without the mark of an extended one."""
        return self.number & ~EXTENDED

    @property
    def extended(self) -> bool:
        """Whether the id has 29 bits."""
        return bool(self.number & EXTENDED)


@dataclass(frozen=True, slots=True)
class Definition:
    """An attribute that BA_DEF_ declares for "BO_" or "SG_" ("": the whole file); choices of an ENUM."""

    line: int
    of: str
    kind: str
    choices: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Reference:
    """A statement about a message or a signal, and where it stands."""

    line: int
    keyword: str
    number: int
    signal: str | None


@dataclass(slots=True)
class DbcText:
    """All of a DBC that lint judges."""

    file: Path
    encoding: str
    has_bom: bool
    lines: int
    nodes: dict[str, int] = field(default_factory=dict)
    messages: list[Message] = field(default_factory=list)
    definitions: dict[str, Definition] = field(default_factory=dict)
    defaults: dict[str, str] = field(default_factory=dict)
    references: list[Reference] = field(default_factory=list)

    @property
    def on_the_bus(self) -> list[Message]:
        """The messages, without Vector's holder of signals that belong to none."""
        return [m for m in self.messages if m.number != NO_MESSAGE and m.name != NO_MESSAGE_NAME]

    def attribute(self, thing: Message | Signal, name: str) -> str | None:
        """An attribute's value, else its default, else None; an ENUM's as its word."""
        given = thing.attributes.get(name)
        definition = self.definitions.get(name)
        if given is None:
            return self.defaults.get(name)
        if definition and definition.choices and not given.is_text and given.value.isdigit():
            place = int(given.value)
            return definition.choices[place] if place < len(definition.choices) else given.value
        return given.value

    def number(self, thing: Message | Signal, name: str) -> float | None:
        """The same as a number, or None where it is none."""
        value = self.attribute(thing, name)
        try:
            return None if value is None else float(value)
        except ValueError:
            return None

    def attribute_line(self, thing: Message | Signal, name: str) -> int:
        """Where the attribute is given; else the line of the thing itself."""
        return thing.attributes[name].line if name in thing.attributes else thing.line

    def is_fd(self, message: Message) -> bool:
        """Whether the DBC says that it is a CAN FD message."""
        return (self.attribute(message, "VFrameFormat") or "").upper().endswith("FD")
