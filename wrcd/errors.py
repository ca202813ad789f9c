"""Errors a person caused and can mend: one clear message, exit 2, no traceback."""

from collections.abc import Sequence
from pathlib import Path
from typing import TextIO


class InputError(Exception):
    """Bad input. Names the file, the line and the key where there are any, the reason, and what to do."""

    status = 2  # of the process that ends with it

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
        self.args = ("\n".join(map(str, errors)),)


class BusError(InputError):
    """The bus cannot be opened. Another exit status than for bad input: it may be there on the next try."""

    status = 3


def create(path: Path) -> TextIO:
    """A text file to write. Raises InputError if it can't be made."""
    try:
        return path.open("w", encoding="utf-8", newline="")
    except OSError as e:
        raise InputError(
            f"cannot be written: {e.strerror}", file=path, hint="check the folder and your rights"
        ) from None
