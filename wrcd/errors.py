"""Errors a person caused and can mend: one clear message, exit 2, no traceback."""

from pathlib import Path


class InputError(Exception):
    """Bad input. Names the file, the line and the key where there are any, the reason, and what to do."""

    def __init__(
        self, reason: str, *, file: Path | str | None = None, line: int | None = None, key: str = "", hint: str = ""
    ) -> None:
        self.reason, self.file, self.line, self.key, self.hint = reason, file, line, key, hint
        where = "" if file is None else f"{file}:{line}: " if line else f"{file}: "
        super().__init__(f"{where}{key + ': ' if key else ''}{reason}{' — ' + hint if hint else ''}")
