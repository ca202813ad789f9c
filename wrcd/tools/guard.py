"""What both programs do with errors: one line and an exit status, no traceback."""

import contextlib
import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator

from wrcd.errors import InputError, Status

# of what is written: no mistake of the program's, and nothing that its input tells
NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


def guarded(name: str, command: Callable[[], int], *, retried: bool = True, own_signals: bool = False) -> int:
    """Run a command: an InputError is one line and its exit status, Ctrl-C exit 130, a closed pipe no error.
    A full disk, and whatever else cannot be written to its end, is one line and STOPPED.

    retried: whether a bus or a file that is not there has a status of its own. own_signals: whether the command has a
    handler of SIGINT of its own.
    """
    try:
        with _system_interrupt() if own_signals else contextlib.nullcontext():
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


@contextlib.contextmanager
def _system_interrupt() -> Iterator[None]:
    """Ctrl-C ends the process as the system does, until the command has its own handler. About one in a hundred
    exceptions that Python makes of it during a start is lost in an import: the program would run on."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # ignored, as in the background of a script
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _silence() -> None:
    """Keep the interpreter from complaining at exit of what standard output does not take any more."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
