"""Reading a DBC: messages, signals and attributes, by cantools."""

import importlib.util
import logging
import re
import sys
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from wrcd.bus.dbc_soundness import Orphan, add_doubles, add_orphans, warnings_about, why_unsound
from wrcd.bus.dbc_text import (
    EXTENDED,
    huge_at,
    numbered_choices,
    read_text,
    subset,
    without_impossible_messages,
    without_statements,
)
from wrcd.errors import InputError, NotThere

# cantools' package imports its tester and more, and with them python-can, asyncio and ssl, none of which the daemon
# uses on SocketCAN. They are a third of the time from start to the first frame, and after a crash that time is time
# without adhesion. So only its database part is imported here; whoever imports cantools itself gets the whole of it.
_spec = importlib.util.find_spec("cantools") if "cantools" not in sys.modules else None
if _spec is not None:
    sys.modules["cantools"] = importlib.util.module_from_spec(_spec)
try:
    from cantools import database as _cantools
    from cantools.database.can import Database as _Database
    from cantools.database.can import Message, Signal
finally:
    if _spec is not None:
        del sys.modules["cantools"]

__all__ = [
    "DATA_ID", "DEFAULT_TIMEOUT_MS", "KNOWN_PROFILE", "PROFILE", "TIMEOUT", "Database", "Message", "Signal",
    "attribute", "cycle_ms", "data_id", "e2e_profile", "find_message", "find_signal", "load_dbc", "parse_dbc",
    "shortest_timeout_us", "timeout_ms",
]  # fmt: skip
# What it says of a file beside our own warnings. Without a handler Python writes it to standard error.
logging.getLogger("cantools").addHandler(logging.NullHandler())
CLASSICAL_BYTES, FD_BYTES = 8, 64
_HAS_MESSAGE = re.compile(r"^\s*BO_ ", re.MULTILINE)
# what cantools says of value tables and value types of signals that there are not
_ORPHANS = re.compile(r"^    (VAL_|SIG_VALTYPE_) (\d+) (\w+)$", re.MULTILINE)
DEFAULT_TIMEOUT_MS = 100  # of a signal for which nobody states a time-out or a cycle
TIMEOUT, PROFILE, DATA_ID = "GenSigTimeoutTime", "E2EProfile", "E2EDataId"
KNOWN_PROFILE = "P11"
NO_PROFILE = ("", "none", "no")
LONGEST_MS = 65_535  # of cycles and time-outs: the range that DBCs usually give these attributes


class Database(_Database):
    """A DBC. Only what is mapped need be sound.

    unsound: why a message cannot be mapped, by its name; some of these are not among the messages.
    warnings: what is odd in the file but bearable, for a person.
    """

    unsound: Mapping[str, str]
    warnings: tuple[str, ...]


def load_dbc(path: Path, names: Collection[str] | None = None, encoding: str | None = None) -> Database:
    """Read a DBC. Raises InputError with what is wrong with it.

    What is wrong with one message is no error: find_message tells it of a message that is looked for, `warnings` of the
    others. names: messages that are needed; the others' attributes and comments may be missing, and they are not
    checked. None: all. encoding: None takes UTF-8 where the file is valid UTF-8, else cp1252.
    """
    try:
        if path.suffix.lower() == ".dbc":
            return parse_dbc(read_text(path, encoding), path, names)
        found = _cantools.load_file(path, strict=True)
        if not isinstance(found, _Database):
            raise InputError("is a diagnostics database, not a DBC", file=path)
        database = Database(found.messages, found.nodes, found.buses, found.version, found.dbc, found.autosar)
        database.unsound, database.warnings = {}, ()
        return database
    except FileNotFoundError:
        raise NotThere("no such DBC file", file=path, hint="check the path") from None
    except OSError as e:
        raise NotThere(f"cannot be read: {e.strerror}", file=path, hint="check your rights and the disk") from None
    except InputError:
        raise
    except Exception as e:  # cantools raises its parser's own kinds; all of them mean: this file can't be used
        raise InputError(f"not a usable DBC: {e}", file=path) from None


def parse_dbc(text: str, path: Path, names: Collection[str] | None = None) -> Database:
    """The same for a text that is already there; path is what messages call it."""
    if names is not None:
        text = subset(text, names)
    at = huge_at(text)
    if at is not None:
        line = text.count("\n", 0, at) + 1
        raise InputError("not a usable DBC: no message, signal or number is that large", file=path, line=line)
    database, unsound, orphans = _parse(text)
    _complete(database)
    for message in database.messages:
        if names is None or message.name in names:
            reason = why_unsound(message)
            if reason:
                unsound.setdefault(message.name, reason)
    add_doubles(database.messages, unsound)
    add_orphans(database.messages, orphans, unsound)
    database.unsound = unsound
    database.warnings = warnings_about(database.messages, unsound, orphans)
    return database


def _parse(text: str) -> tuple[Database, dict[str, str], list[Orphan]]:
    """Parse a DBC's text; what cantools refuses of a single message is left out. Returns the database, reasons by
    message, and the statements about signals that there are not."""
    unsound: dict[str, str] = {}
    orphans: list[Orphan] = []
    while True:
        database = Database(strict=False)
        try:
            database.add_dbc_string(text)
        except Exception as e:
            less = text
            found = [Orphan(k, int(i), name) for k, i, name in _ORPHANS.findall(str(e)) if str(e).startswith("unused ")]
            if found:
                for keyword in {k for k, _, _ in found}:
                    less = without_statements(less, keyword, {(i, name) for k, i, name in found if k == keyword})
                orphans += found
            else:
                less, reasons = without_impossible_messages(numbered_choices(text))
                unsound |= reasons
            if less == text or not _HAS_MESSAGE.search(less):
                raise
            text = less
        else:
            return database, unsound, orphans


def _complete(database: Database) -> None:
    """Give signals what the file says of them and cantools does not: no range by [0.0|0.0], the start value of all that
    can hold it, and the shortest of the time-outs of their receivers, where they have none of their own."""
    if (whole := database.dbc) is None:
        return
    start: Any = whole.attribute_definitions.get("GenSigStartValue")
    relations: Any = whole.relation_attributes
    for m in database.messages:
        number = m.frame_id | EXTENDED * m.is_extended_frame
        of_signals = relations.node_signal_relations.get(number, {}) if relations is not None else {}
        for s in m.signals:
            if s.minimum == s.maximum == 0:
                s.minimum = s.maximum = None
            if s.raw_initial is None and start is not None and _holds(s, start.default_value):
                s.raw_initial = start.default_value
            related = [given[TIMEOUT] for given in of_signals.get(s.name, {}).values() if TIMEOUT in given]
            stated = [a for a in related if is_time(a.value)]
            if stated and s.dbc is not None:
                s.dbc.attributes.setdefault(TIMEOUT, min(stated, key=lambda a: float(a.value)))


def _holds(s: Signal, raw: object) -> bool:
    if s.is_float or type(raw) is not int:
        return s.is_float and type(raw) in (int, float)
    return -(1 << s.length - 1) * s.is_signed <= raw < 1 << s.length - s.is_signed


def is_time(value: object) -> bool:
    """Whether an attribute's value is a time-out: a number of milliseconds, and not 0, which stands for none."""
    return isinstance(value, int | float) and 1 <= value <= LONGEST_MS


def attribute(thing: Message | Signal, name: str) -> Any:
    """The value of a DBC attribute, or None; of an ENUM its word. A file's default counts where it may hold for all: a
    time-out, and an E2E profile; the known one where a message has a data id of its own."""
    if thing.dbc is None:
        return None
    given, definition = thing.dbc.attributes.get(name), thing.dbc.attribute_definitions.get(name)
    if given is not None:
        return _word(given.definition, given.value)
    value = None if definition is None else _word(definition, definition.default_value)
    if name == PROFILE:
        holds = is_profile(value) and (value != KNOWN_PROFILE or DATA_ID in thing.dbc.attributes)
    else:
        holds = name == TIMEOUT and is_time(value)
    return value if holds else None


def is_profile(word: object) -> bool:
    """Whether a word is the name of an E2E profile. Files have many words for none."""
    return bool(re.fullmatch(r"P\d+[A-Za-z]?", str(word)))


def _word(definition: Any, value: Any) -> Any:
    words = definition.choices
    return words[value] if isinstance(value, int) and 0 <= value < len(words) else value


def find_message(database: Database, name: str) -> Message:
    """A message by name. Raises KeyError whose text names it and what is there; ValueError if it is not sound."""
    if name in database.unsound:
        raise ValueError(f"message {name} cannot be used: {database.unsound[name]}")
    for m in database.messages:
        if m.name == name:
            return m
    raise KeyError(f"the DBC has no message {name!r}")


def find_signal(message: Message, name: str) -> Signal:
    """A signal by name. Raises KeyError likewise."""
    for s in message.signals:
        if s.name == name:
            return s
    raise KeyError(f"message {message.name} has no signal {name!r}")


def timeout_ms(message: Message, signal: Signal) -> int | None:
    """After how long a signal counts as stale: GenSigTimeoutTime, else three cycles, else None.

    Raises ValueError for one that is no time.
    """
    stated = _milliseconds(attribute(signal, TIMEOUT), f"the time-out of {message.name}.{signal.name}")
    cycle = cycle_ms(message)
    return stated or (3 * cycle if cycle else None)


def shortest_timeout_us(message: Message, signals: Iterable[Signal], cycle_us: int) -> int:
    """Return the shortest time-out that the DBC states of one of some signals, else three cycles. Raises ValueError."""
    stated = [timeout_ms(message, s) for s in signals if attribute(s, TIMEOUT)]
    return min((1000 * ms for ms in stated if ms is not None), default=3 * cycle_us)


def cycle_ms(message: Message) -> int | None:
    """The cycle that the DBC states, or None. Raises ValueError for one that is no time."""
    return _milliseconds(message.cycle_time, f"the cycle of message {message.name}")


def _milliseconds(stated: Any, what: str) -> int | None:
    if not stated:
        return None
    try:
        ms = int(stated)
    except (ValueError, OverflowError):
        ms = 0
    if not 1 <= ms <= LONGEST_MS:
        raise ValueError(f"{what} must lie within 1 … {LONGEST_MS} ms")
    return ms


def e2e_profile(stated: object) -> str:
    """The profile that an attribute's value asks for; empty for none."""
    return "" if stated is None or str(stated).lower() in NO_PROFILE else str(stated)


def data_id(message: Message) -> int | None:
    """The E2E data id if the message is protected. Raises ValueError for a profile that is not known here."""
    profile = e2e_profile(attribute(message, PROFILE))
    if not profile:
        return None
    if profile != KNOWN_PROFILE:
        raise ValueError(f"message {message.name} asks for E2E profile {profile!r}; only P11 is known")
    if message.length < 2:
        raise ValueError(f"message {message.name} asks for E2E profile P11 and has no room for CRC and counter")
    identity = attribute(message, DATA_ID)
    if not isinstance(identity, int) or not 0 <= identity <= 0xFFFF:
        raise ValueError(f"message {message.name} needs an E2EDataId of 0 … 65535, not {identity!r}")
    return identity
