"""Errors a person caused and can mend: one clear message and an exit status, no traceback."""

import importlib
from collections.abc import Sequence
from enum import IntEnum
from pathlib import Path
from typing import TextIO


class Status(IntEnum):
    """Exit statuses of both programs. What each means to a command stands in its table of exit codes."""

    DONE = 0
    STOPPED = 1  # on the way, or a check failed
    BAD_INPUT = 2  # trying again would not mend it
    NOT_THERE = 3  # a bus or a file that may be there on the next try
    INTERRUPTED = 130  # Ctrl-C
    PIPE_CLOSED = 141  # by the reader of the output, before there was another status


class InputError(Exception):
    """Bad input. Names the file, the line and the key where there are any, the reason, and what to do."""

    status: int = Status.BAD_INPUT  # of the process that ends with it

    def __init__(
        self, reason: str, *, file: Path | str | None = None, line: int | None = None, key: str = "", hint: str = ""
    ) -> None:
        self.reason, self.file, self.line, self.key, self.hint = reason, file, line, key, hint
        where = "" if file is None else f"{file}:{line}: " if line else f"{file}: "
        super().__init__(f"{where}{key + ': ' if key else ''}{reason}{' — ' + hint if hint else ''}")


class InputErrors(InputError):
    """Several mistakes of one file; its text has a line for each. What asks for one of them gets the first."""

    def __init__(self, errors: Sequence[InputError]) -> None:
        first = errors[0]
        super().__init__(first.reason, file=first.file, line=first.line, key=first.key, hint=first.hint)
        self.errors = tuple(errors)
        # what is tried again must not fail for another reason then
        self.status = first.status if len({e.status for e in errors}) == 1 else Status.BAD_INPUT
        self.args = ("\n".join(map(str, errors)),)


class NotThere(InputError):
    """A bus or a file that cannot be opened. It may be there on the next try: a mount that comes later, an adapter."""

    status = Status.NOT_THERE


class BusError(NotThere):
    """The bus cannot be opened."""


def create(path: Path) -> TextIO:
    """A text file to write. Raises InputError if it can't be made."""
    try:
        return path.open("w", encoding="utf-8", newline="")
    except OSError as e:
        raise InputError(
            f"cannot be written: {e.strerror}", file=path, hint="check the folder and your rights"
        ) from None


def need(modules: Sequence[str], extra: str, key: str = "") -> None:
    """Raises InputError where a library of an extra is missing."""
    for module in modules:
        try:
            importlib.import_module(module)
        except ModuleNotFoundError as e:
            if (e.name or "").partition(".")[0] != module.partition(".")[0]:
                raise
            raise InputError(f"needs the extra {extra}", key=key, hint=install_hint(extra)) from None


def install_hint(extra: str) -> str:
    """How an extra is installed: no index has wrcd."""
    return f"in the source's folder pip install -e '.[{extra}]', of a wheel pip install 'WHEEL[{extra}]'"
