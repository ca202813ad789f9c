"""The file beside a recorder's log, written and read here: the core before the log's first line, and what the loop did
between the lines.

It imports little: the process that writes a dump starts with it.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wrcd import __version__
from wrcd.checksum import checksum
from wrcd.errors import InputError

FORMAT = "wrcd-state/11"
MAX_BYTES = 64 << 20


@dataclass(frozen=True, slots=True)
class StateEvent:
    """What the loop did between frames: behind so many lines of the log, time came to advance_us, or what the core
    knows of the loop and the link (health, encoded) changed."""

    lines: int
    advance_us: int | None = None
    health: Any = None


def document(fits: dict[str, Any], core: Any, events: Iterable[StateEvent], lines: int) -> bytes:
    """A state file's contents."""
    listed = [[e.lines, e.advance_us, e.health] for e in events]
    body = {"format": FORMAT, "version": __version__, **fits, "lines": lines, "events": listed, "core": core}
    return json.dumps({**body, "checksum": checksum(body)}, allow_nan=False).encode()


def read(path: Path) -> dict[str, Any]:
    """The contents. Raises InputError: damaged, or of another format; then it says which version wrote it."""
    hint = "copy it again, or move it away to replay from nothing"
    try:
        with path.open("rb") as f:
            data = f.read(MAX_BYTES + 1)
        body = json.loads(data, parse_constant=_refuse) if len(data) <= MAX_BYTES else None
        if not isinstance(body, dict) or body.get("format") != FORMAT:
            raise InputError(f"is not a {FORMAT} file{_written_by(body)}", file=path, hint=hint)
        if body.get("checksum") != checksum(body):
            raise InputError("does not match the contents", file=path, key="checksum", hint=hint)
        return body
    except (OSError, ValueError, RecursionError) as e:
        raise InputError(f"cannot be read: {e}", file=path, hint=hint) from None


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is not JSON")


def _written_by(body: Any) -> str:
    known = isinstance(body, dict) and str(body.get("format")).startswith("wrcd-state/")
    return f": it is {body['format']}, written by wrcd {body.get('version', '(older)')}" if known else ""
