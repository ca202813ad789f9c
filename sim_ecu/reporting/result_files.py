"""Files that a command is to write: looked at before the work, which may be long, and written after it. Its status."""

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from sim_ecu.reporting.values import MISSED, TOO_FEW, plain
from wrcd.errors import InputError, Status, create

BESIDE = ".new"  # the suffix of a file that has not taken its place yet


def check_output(key: str, file: Path | None) -> None:
    """Raises InputError for a file that cannot be made: its folder is missing, or it is a folder. None is no file."""
    if file is None:
        return
    if not file.parent.is_dir():
        raise InputError("no such folder", file=file.parent, key=key)
    if file.is_dir():
        raise InputError("is a folder", file=file, key=key, hint="name the file to write")


def write_json(result: dict[str, Any], out: Path | None) -> None:
    """Write the figures, where requested."""
    if out:
        with create(out) as file:
            file.write(json.dumps(plain(result), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def save(file: Path, write: Callable[[Path], object]) -> None:
    """Write a file beside its place, then put it there: the whole file or the one before, whatever happens. Raises
    InputError where it cannot be written."""
    beside = file.with_name(f".{file.name}{BESIDE}")
    try:
        write(beside)
        with beside.open("rb") as opened:
            os.fsync(opened.fileno())
        beside.replace(file)
    except OSError as e:
        hint = "check the folder, its room and your rights"
        raise InputError(f"cannot be written: {e.strerror}", file=file, hint=hint) from None
    finally:
        with suppress(OSError):  # half of one: it could not be written, or Ctrl-C came
            beside.unlink(missing_ok=True)


def status_by_goals(fail_on: str | None, goals: Sequence[Mapping[str, Any]]) -> Status:
    """Return the exit status of a command by its goals' verdicts; where it fails, standard error gets the reason.
    Raises InputError where it was requested and no goal could be judged."""
    if not fail_on:
        return Status.DONE
    verdicts = [g["verdict"] for g in goals]
    if set(verdicts) <= {TOO_FEW}:
        raise InputError("no goal could be judged, for too few runs", key="--fail-on",
                         hint="leave out --quick, or play more suites or seeds")  # fmt: skip
    missed = verdicts.count(MISSED)
    if missed:
        print(f"--fail-on {fail_on}: {missed} of {len(verdicts)} goals {'is' if missed == 1 else 'are'} missed",
              file=sys.stderr)  # fmt: skip
    return Status.STOPPED if missed else Status.DONE
