"""Files that commands on a log write: checked before the work."""

import importlib
from collections.abc import Sequence
from pathlib import Path

from wrcd.errors import InputError

START_BYTES = 4096  # of a file that is asked whose it is


def need(modules: Sequence[str], extra: str) -> None:
    """Raises InputError where a library of an extra is missing."""
    for module in modules:
        try:
            importlib.import_module(module)
        except ModuleNotFoundError as e:
            if (e.name or "").partition(".")[0] != module.partition(".")[0]:
                raise
            raise InputError(f"needs the extra {extra}", hint=f"pip install 'wrcd[{extra}]'") from None


def check_output(output: Path, inputs: Sequence[Path | None]) -> None:
    """Raises InputError for an output that is one of the inputs, or whose folder is not there."""
    for read in inputs:
        if read is not None and _same(output, read):
            raise InputError("is read by this command; it would be lost", file=output, key="-o", hint="give another")
    if output.is_dir():
        raise InputError("is a folder", file=output, key="-o", hint="give a file's name")
    if not output.parent.is_dir():
        raise InputError("its folder is not there", file=output, key="-o", hint=f"mkdir -p {output.parent}")


def check_overwrite(output: Path, mark: str, what: str) -> None:
    """Raises InputError for a file that is there, and that is not one of ours as its first bytes tell."""
    try:
        with output.open("rb") as file:
            start = file.read(START_BYTES)
    except FileNotFoundError:
        return
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=output, key="-o") from None
    if start and mark.encode() not in start:
        raise InputError(f"is there and is no {what}", file=output, key="-o", hint="another name, or --force")


def _same(one: Path, other: Path) -> bool:
    try:
        return one.resolve() == other.resolve() or (one.exists() and other.exists() and one.samefile(other))
    except (OSError, RuntimeError):
        return False
