"""What both programs do with errors: one line and an exit status, no traceback."""

import contextlib
import errno
import os
import sys
from collections.abc import Callable

from wrcd.errors import InputError, Status

# of what is written: no mistake of the program's, and nothing that its input tells
NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


def guarded(name: str, command: Callable[[], int], *, retried: bool = True) -> int:
    """Run a command: an InputError is one line and its exit status, Ctrl-C exit 130, a closed pipe no error.
    A full disk, and whatever else cannot be written to its end, is one line and STOPPED.

    retried: whether a bus or a file that is not there has a status of its own.
    """
    try:
        status = command()
        sys.stdout.flush()
        return status
    except InputError as e:
        print(f"{name}: error: {e}", file=sys.stderr)
        return e.status if retried or e.status != Status.NOT_THERE else Status.BAD_INPUT
    except KeyboardInterrupt:
        return Status.INTERRUPTED
    except BrokenPipeError:  # whoever reads us has enough
        _silence()
        return 0
    except OSError as e:
        if e.errno not in NOT_WRITTEN:
            raise
        _silence()
        where = f"{e.filename}: " if e.filename else ""
        reason = f"{where}the output cannot be written to its end: {e.strerror}"
        with contextlib.suppress(OSError):  # standard error may lie on the same disk
            print(f"{name}: error: {reason} — what is there is not whole; make room and try again", file=sys.stderr)
        return Status.STOPPED


def _silence() -> None:
    """Keep the interpreter from complaining at exit of what standard output does not take any more."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
