"""What both programs do with errors: one line and an exit status, no traceback."""

import os
import sys
from collections.abc import Callable

from wrcd.errors import InputError, Status


def guarded(name: str, command: Callable[[], int], *, retried: bool = True) -> int:
    """Run a command: an InputError is one line and its exit status, Ctrl-C exit 130, a closed pipe no error.

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
    except BrokenPipeError:
        # whoever reads us has enough; keep the interpreter from complaining at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
