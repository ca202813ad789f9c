"""A DBC's text, statement by statement, in records that know their lines.

cantools keeps no lines, and the later of two things with one name hides the earlier: lint needs both. A wrong number is
a number here: lint judges it.
"""

import codecs
import contextlib
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from wrcd.bus.dbc import PROFILE, e2e_profile, is_profile, is_time
from wrcd.bus.dbc_text import read_text
from wrcd.errors import InputError

EXTENDED = 0x8000_0000  # in a DBC the number of an extended id carries this bit
NO_MESSAGE = 0xC000_0000  # Vector's holder of signals that belong to no message
NO_MESSAGE_NAME = "VECTOR__INDEPENDENT_SIG_MSG"
NO_NODE = "Vector__XXX"
_TOKEN = re.compile(
    r'(?P<skip>\s+|//[^\n]*)|(?P<number>[-+]?\d+\.?\d*(?:[eE][+-]?\d+)?)|(?P<word>\w+)|"(?P<string>(?:\\"|[^"])*)"'
    r"|(?P<mark>.)",
    re.ASCII | re.DOTALL,
)
# What begins a statement, as far as one can follow the names of BU_.
_BEGIN = {
    "BA_", "BA_DEF_", "BA_DEF_DEF_", "BA_DEF_REL_", "BA_DEF_DEF_REL_", "BA_REL_", "BO_", "BO_TX_BU_", "BS_", "BU_",
    "CM_", "ENVVAR_DATA_", "EV_", "NS_", "SG_MUL_VAL_", "SIG_GROUP_", "SIG_VALTYPE_", "VAL_", "VAL_TABLE_", "VERSION",
}  # fmt: skip
_ABOUT = {"CM_", "BA_", "BA_REL_", "VAL_", "SIG_VALTYPE_", "SG_MUL_VAL_"}  # say something about a message or a signal


class Attribute(NamedTuple):
    """A value that BA_ gives a message or a signal."""

    line: int
    value: str
    is_text: bool


@dataclass(slots=True)
class Signal:
    """An SG_ line, with what VAL_, BA_ and SIG_VALTYPE_ say of it. path: Message.Signal, as a configuration names it;
    low and high: [min|max], None for [0|0]; words: raw values and their words, in the file's order."""

    line: int
    path: str
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
    words: list[tuple[int, str]] = field(default_factory=list)
    words_line: int = 0
    attributes: dict[str, Attribute] = field(default_factory=dict)
    comment: str = ""

    @property
    def labels(self) -> list[str]:
        """The words of its value table."""
        return [word for _, word in self.words]

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


class Reference(NamedTuple):
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
    choices: dict[str, list[str]] = field(default_factory=dict)  # of attributes that are an ENUM
    defaults: dict[str, str] = field(default_factory=dict)
    references: list[Reference] = field(default_factory=list)

    @property
    def on_the_bus(self) -> list[Message]:
        """The messages, without Vector's holder of signals that belong to none."""
        return [m for m in self.messages if m.number != NO_MESSAGE and m.name != NO_MESSAGE_NAME]

    def attribute(self, thing: Message | Signal, name: str) -> str | None:
        """An attribute's value, else its default, else None; an ENUM's as its word."""
        given = thing.attributes.get(name)
        if given is None:
            return self.defaults.get(name)
        choices = dict(enumerate(self.choices.get(name, [])))
        chosen = choices and not given.is_text and given.value.isdigit()
        return choices.get(int(given.value), given.value) if chosen else given.value

    def e2e_profile(self, message: Message) -> str:
        """The profile that a message asks for, empty for none."""
        profile = e2e_profile(self.attribute(message, PROFILE))
        return profile if PROFILE in message.attributes or is_profile(profile) else ""

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
        return (self.attribute(message, "VFrameFormat") or "").upper().endswith(("FD", "14", "15"))


def _long_name(of: Message | Signal) -> str:
    """The name that a DBC gives beside one of at most 32 characters; cantools goes by it."""
    given = of.attributes.get(f"System{type(of).__name__}LongSymbol")
    return given.value if given is not None and given.value else of.name


def _is_shorter(token: "Token", than: Attribute | None) -> bool:
    """Whether a receiver's time is one, and shorter than another's."""
    try:
        time, other = float(token.text), math.inf if than is None else float(than.value)
    except ValueError:
        return False
    return is_time(time) and not (is_time(other) and other < time)


class Token(NamedTuple):
    """A word, number, string or mark of the text, and its line."""

    kind: str
    text: str
    line: int


def read(path: Path) -> DbcText:
    """Read a DBC's text. Raises InputError with the line where the text cannot be followed."""
    try:
        text, data = read_text(path, None), path.read_bytes()
    except FileNotFoundError:
        raise InputError("no such DBC file", file=path, hint="check the path") from None
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror}", file=path) from None
    found = DbcText(path, _encoding(data), data.startswith(codecs.BOM_UTF8), text.count("\n") + 1)
    _Statements(found, list(_tokens(text))).read()
    return found


def _encoding(data: bytes) -> str:
    """What a file is taken for that has characters beyond ASCII."""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "UTF-8"


def _tokens(text: str) -> Iterator[Token]:
    line = 1
    for m in _TOKEN.finditer(text):
        kind = m.lastgroup or ""
        if kind != "skip":
            yield Token(kind, m[kind].replace('\\"', '"') if kind == "string" else m[kind], line)
        line += m[0].count("\n")


class _Statements:
    """Goes over the tokens once; statements about a message or a signal are laid on it at the end."""

    def __init__(self, into: DbcText, tokens: Sequence[Token]) -> None:
        self._into, self._tokens, self._at = into, tokens, 0
        self._late: list[list[Token]] = []  # VAL_, BA_, CM_, SIG_VALTYPE_: they may stand before what they are about

    def read(self) -> None:
        while self._at < len(self._tokens):
            token = self._next()
            keyword = token.text if token.kind == "word" else ""
            if keyword == "BU_":
                self._take(":")
                while self._at < len(self._tokens) and self._peek() not in _BEGIN:
                    node = self._take("word")
                    self._into.nodes.setdefault(node.text, node.line)
            elif keyword == "BO_":
                self._message()
            elif keyword == "SG_":
                self._signal()
            elif keyword in ("BA_DEF_", "BA_DEF_DEF_"):
                self._definition(keyword)
            elif keyword == "NS_":  # a list of keywords: none of them begins a statement here
                while self._at < len(self._tokens) and self._peek() != "BS_":
                    self._at += 1
            elif not (keyword in _BEGIN or keyword.endswith("_")):
                raise InputError(f"cannot be read at {token.text!r}", file=self._into.file, line=token.line)
            elif keyword not in ("VERSION", "BS_"):
                start = self._at - 1
                while self._next()[:2] != ("mark", ";"):
                    pass
                if keyword in _ABOUT:
                    self._late.append(list(self._tokens[start : self._at - 1]))
            elif keyword == "VERSION":
                self._take("string")
            else:
                self._take(":")
        for statement in sorted(self._late, key=lambda s: s[0].text != "BA_REL_"):  # BA_ has the last word
            self._lay(statement)
        for m in self._into.messages:
            m.name = _long_name(m)
            for s in m.signals:
                s.name = _long_name(s)
                s.path = f"{m.name}.{s.name}"

    def _next(self) -> Token:
        if self._at >= len(self._tokens):
            raise InputError("ends within a statement", file=self._into.file, line=self._into.lines)
        self._at += 1
        return self._tokens[self._at - 1]

    def _peek(self) -> str:
        return self._tokens[self._at].text if self._at < len(self._tokens) else ""

    def _take(self, *kinds: str) -> Token:
        """The next token if it is of one of these kinds, or is one of these marks."""
        token = self._next()
        if token.kind not in kinds and token.text not in kinds:
            raise InputError(f"cannot be read at {token.text!r}", file=self._into.file, line=token.line)
        return token

    def _message(self) -> None:
        number = self._take("number")
        name = self._take("word", "number").text
        self._take(":")
        length = self._whole(self._take("number"))
        sender = self._take("word").text
        self._into.messages.append(Message(number.line, self._whole(number), name, length, sender))

    def _signal(self) -> None:
        take = self._take
        first = take("word")
        mux = "" if self._peek() == ":" else take("word").text
        start, length = self._pair(":", "|", whole=True)
        take("@")
        order, sign = take("number").text, take("+", "-").text
        scale, offset = self._pair("(", ",")
        take(")")
        low, high = self._pair("[", "|")
        take("]")
        unit = take("string").text
        receivers = [take("word").text]
        while self._peek() == ",":
            take(",")
            receivers.append(take("word").text)
        none = low == high == 0.0
        if not self._into.messages:
            raise InputError("a signal stands before any message", file=self._into.file, line=first.line)
        message = self._into.messages[-1]
        message.signals.append(
            Signal(
                first.line, f"{message.name}.{first.text}", first.text, mux, int(start), int(length), order == "0",
                sign == "-", scale, offset, None if none else low, None if none else high, unit, tuple(receivers),
            )
        )  # fmt: skip

    def _pair(self, before: str, between: str, whole: bool = False) -> tuple[float, float]:
        """Two numbers with a mark before and one between them."""
        found = []
        for mark in (before, between):
            self._take(mark)
            token = self._take("number")
            found.append(self._whole(token) if whole else float(token.text))
        return found[0], found[1]

    def _definition(self, keyword: str) -> None:
        if self._peek() in ("BO_", "SG_", "BU_", "EV_"):
            self._next()
        name = self._take("string").text
        rest: list[Token] = []
        while self._at < len(self._tokens) and self._tokens[self._at][:2] != ("mark", ";"):
            rest.append(self._next())
        self._take(";")
        if keyword == "BA_DEF_":
            self._into.choices[name] = [t.text for t in rest[1:] if t.kind == "string"]
        elif rest:
            self._into.defaults[name] = rest[0].text

    def _lay(self, statement: list[Token]) -> None:
        """What a statement says about a message or a signal."""
        keyword, *rest = statement
        attribute = rest.pop(0).text if keyword.text.startswith("BA_") and rest else ""
        if keyword.text == "BA_REL_":  # … BU_SG_REL_ NODE SG_ ID SIGNAL VALUE
            rest = rest[2:] if rest and rest[0].text == "BU_SG_REL_" else []
        about = rest.pop(0).text if rest and rest[0].text in ("BO_", "SG_", "BU_", "EV_") else ""
        if about in ("BU_", "EV_") or not rest or rest[0].kind != "number":
            return
        if keyword.text in ("CM_", "BA_") and not about:
            return
        number = self._whole(rest.pop(0))
        signal = None if about == "BO_" or not rest else rest.pop(0).text
        self._into.references.append(Reference(keyword.line, keyword.text, number, signal))
        for message in (m for m in self._into.messages if m.number == number):
            if signal is None:
                if attribute and rest:
                    message.attributes[attribute] = Attribute(keyword.line, rest[0].text, rest[0].kind == "string")
                continue
            for s in (s for s in message.signals if s.name == signal):
                self._tell(s, keyword, attribute, rest)

    def _tell(self, s: Signal, keyword: Token, attribute: str, rest: list[Token]) -> None:
        """Lay what is left of a statement on a signal."""
        if keyword.text == "VAL_":
            s.words_line = keyword.line
            s.words = [(self._whole(n), w.text) for n, w in zip(rest[::2], rest[1::2], strict=False)]
        elif keyword.text == "SIG_VALTYPE_":
            s.is_float = bool(rest) and rest[-1].text in ("1", "2", "3")
        elif keyword.text == "CM_" and rest:
            s.comment = rest[0].text
        elif rest and attribute and (keyword.text == "BA_" or _is_shorter(rest[0], s.attributes.get(attribute))):
            s.attributes[attribute] = Attribute(keyword.line, rest[0].text, rest[0].kind == "string")

    def _whole(self, token: Token) -> int:
        """A whole number, also where it is written with a fraction."""
        with contextlib.suppress(ValueError):
            return int(token.text)
        try:
            return int(float(token.text))
        except (ValueError, OverflowError):
            reason = f"cannot be read at {token.text!r}: a whole number is needed"
            raise InputError(reason, file=self._into.file, line=token.line) from None
