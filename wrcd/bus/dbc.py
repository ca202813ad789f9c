"""Reading a DBC: messages, signals and attributes, by cantools."""

import importlib.util
import re
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

from wrcd.bus.dbc_subset import subset
from wrcd.errors import InputError

# cantools' package imports its tester and more, and with them python-can, asyncio and ssl, none of which the daemon
# uses on SocketCAN. They are a third of the time from start to the first frame, and after a crash that time is time
# without adhesion. So only its database part is imported here; whoever imports cantools itself gets the whole of it.
_spec = importlib.util.find_spec("cantools") if "cantools" not in sys.modules else None
if _spec is not None:
    sys.modules["cantools"] = importlib.util.module_from_spec(_spec)
try:
    from cantools import database as _cantools
    from cantools.database.can import Database, Message, Signal
finally:
    if _spec is not None:
        del sys.modules["cantools"]

__all__ = [
    "Database", "Message", "Signal", "attribute", "cycle_ms", "data_id",
    "find_message", "find_signal", "load_dbc", "timeout_ms",
]  # fmt: skip
# Message lengths, signal positions, multiplexer ranges and powers of ten for which cantools would compute for hours.
# One by one: a pattern that begins with a literal is searched for ten times as fast.
_HUGE = tuple(
    re.compile(pattern, re.ASCII)
    for pattern in (
        r"BO_\s+\d+\s+\w+\s*:\s*\d{5}",
        r":\s*\d{6,}\s*\|",
        r"\|\s*\d{6,}\s*@",
        r"SG_MUL_VAL_\b[^;]*?-\s*\d{6}",
        r"(?<![\w.])[\d.]+[eE]\+?\d{4}",
    )
)
CLASSICAL_BYTES, FD_BYTES = 8, 64
LONGEST_MS = 65_535  # of cycles and time-outs: the range that DBCs usually give these attributes


def load_dbc(path: Path, names: Collection[str] | None = None, encoding: str | None = None) -> Database:
    """Read a DBC strictly. Raises InputError with what is wrong with it.

    names: messages that are needed; the others' attributes and comments may be missing. None: all.
    """
    try:
        # the suffix and the encoding by which cantools knows a DBC
        is_dbc = path.suffix.lower() == ".dbc"
        text = path.read_text(encoding or ("cp1252" if is_dbc else "utf-8"), "replace")
        if names is not None and is_dbc:
            text = subset(text, names)
        huge = next(filter(None, (pattern.search(text) for pattern in _HUGE)), None)
        if huge is not None:
            line = text.count("\n", 0, huge.start()) + 1
            raise InputError("not a usable DBC: no message, signal or number is that large", file=path, line=line)
        database = _cantools.load_string(text, "dbc", strict=True) if is_dbc else _cantools.load_file(path, strict=True)
    except FileNotFoundError:
        raise InputError("no such DBC file", file=path, hint="check the path") from None
    except InputError:
        raise
    except Exception as e:  # cantools raises its parser's own kinds; all of them mean: this file can't be used
        raise InputError(f"not a usable DBC: {e}", file=path) from None
    if not isinstance(database, Database):
        raise InputError("is a diagnostics database, not a DBC", file=path)
    return database


def attribute(thing: Message | Signal, name: str) -> Any:
    """The value of a DBC attribute, or None."""
    found = thing.dbc.attributes.get(name) if thing.dbc is not None else None
    return None if found is None else found.value


def find_message(database: Database, name: str) -> Message:
    """A message by name. Raises KeyError whose text names it and what is there."""
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
    stated = _milliseconds(attribute(signal, "GenSigTimeoutTime"), f"the time-out of {message.name}.{signal.name}")
    cycle = cycle_ms(message)
    return stated or (3 * cycle if cycle else None)


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


def data_id(message: Message) -> int | None:
    """The E2E data id if the message is protected. Raises ValueError for a profile that is not known here."""
    profile = attribute(message, "E2EProfile")
    if not profile:
        return None
    if str(profile) != "P11" or message.length < 2:
        raise ValueError(f"message {message.name} asks for E2E profile {profile!r}; only P11 is known")
    identity = attribute(message, "E2EDataId")
    if not isinstance(identity, int) or not 0 <= identity <= 0xFFFF:
        raise ValueError(f"message {message.name} needs an E2EDataId of 0 … 65535, not {identity!r}")
    return identity
