"""Files that a command is to write: looked at before the work, which may be long."""

from pathlib import Path

from wrcd.errors import InputError


def check_output(key: str, file: Path | None) -> None:
    """Raises InputError for a file that cannot be made: its folder is missing, or it is a folder. None is no file."""
    if file is None:
        return
    if not file.parent.is_dir():
        raise InputError("no such folder", file=file.parent, key=key)
    if file.is_dir():
        raise InputError("is a folder", file=file, key=key, hint="name the file to write")
