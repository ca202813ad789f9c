"""Files that a command is to write: looked at before the work, which may be long, and written after it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sim_ecu.score.report import plain
from wrcd.errors import InputError, create


def check_output(key: str, file: Path | None) -> None:
    """Raises InputError for a file that cannot be made: its folder is missing, or it is a folder. None is no file."""
    if file is None:
        return
    if not file.parent.is_dir():
        raise InputError("no such folder", file=file.parent, key=key)
    if file.is_dir():
        raise InputError("is a folder", file=file, key=key, hint="name the file to write")


def write_results(
    result: dict[str, Any], json_out: Path | None, html_out: Path | None, page: Callable[[], str]
) -> None:
    """The figures as JSON and as a page, where asked for. page makes it: what draws is imported by then only."""
    if json_out:
        with create(json_out) as file:
            file.write(json.dumps(plain(result), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    if html_out:
        with create(html_out) as file:
            file.write(page())
