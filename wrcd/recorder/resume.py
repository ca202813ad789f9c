"""Going on from a recorder's log: a state file put into a core, and what the loop did between the lines done again."""

import hashlib
from collections import deque
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing
from wrcd.errors import InputError
from wrcd.recorder.state import StateMismatch, as_list, restore, whole
from wrcd.recorder.state_file import StateEvent, read

# Fields of the configuration that say where things lie and come from, and what is odd there; not what is computed.
PLACES = {
    "file",
    "interface",
    "channel",
    "hardware_stamps",
    "dbc_file",
    "database",
    "design_file",
    "design",
    "recorder",
    "warnings",
}


@dataclass(frozen=True, slots=True)
class Saved:
    """A state file beside the core: what happened between the log's lines, of which there are so many."""

    events: tuple[StateEvent, ...]
    lines: int


def identity(config: Config) -> dict[str, Any]:
    """What a state fits: the design, the DBC's contents, and the settings. Raises OSError if the DBC has gone."""
    return {
        "design": config.design.checksum,
        "dbc": hashlib.sha256(config.dbc_file.read_bytes()).hexdigest(),
        "configuration": settings(config),
    }


def settings(config: Config) -> dict[str, str]:
    """A hash of each setting that the estimate hangs on."""
    return {f.name: _hash(repr(getattr(config, f.name))) for f in fields(Config) if f.name not in PLACES}


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def state_file(log: Path) -> Path:
    """Where the state of a log lies: X.state.json beside X.log."""
    return log.with_name(log.name.removesuffix(".gz").removesuffix(".log") + ".state.json")


def load(path: Path, core: Core) -> Saved:
    """Put a state file into a fresh core. Raises InputError: damaged, or made with another design, DBC or
    configuration."""
    body, config = read(path), core.config
    fits = identity(config)
    for key, name, file in (("design", "design", config.design_file), ("dbc", "DBC", config.dbc_file)):
        if body.get(key) != fits[key]:
            raise InputError(
                f"was made with another {name} than {file}", file=path, key=key, hint=f"replay with the {name} of then"
            )
    had = body.get("configuration")
    had = had if isinstance(had, dict) else {}
    differ = sorted(k for k in {*had, *fits["configuration"]} if had.get(k) != fits["configuration"].get(k))
    if differ:
        raise InputError(
            f"was made with another configuration: {', '.join(differ)} differ",
            file=path, key="configuration", hint="give the one that the daemon ran with: --config FILE",
        )  # fmt: skip
    try:
        events = tuple(_event(node) for node in body["events"])
        for event in events:
            if event.health is not None:
                restore(core.health, event.health, "health")
        restore(core, body["core"])
        return Saved(events, whole(body["lines"], "lines"))
    except (StateMismatch, KeyError, ValueError, TypeError) as e:
        raise InputError(f"is not a usable state: {e}", file=path) from None


def replay_events(core: Core, events: deque[StateEvent], lines: int) -> list[Outgoing]:
    """Do again what was done before the line after so many; events lose it. Returns what the core made of it."""
    out: list[Outgoing] = []
    while events and events[0].lines <= lines:
        event = events.popleft()
        if event.health is not None:
            restore(core.health, event.health, "health")
        if event.advance_us is not None:
            out += core.advance(event.advance_us)
    return out


def _event(node: Any) -> StateEvent:
    lines, advance_us, health = as_list(node, "events", 3)
    return StateEvent(
        whole(lines, "events"), None if advance_us is None else whole(advance_us, "events"), health
    )  # fmt: skip
