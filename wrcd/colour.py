"""Whether output may be coloured: decided here, for both programs."""

import os
from typing import TextIO


def coloured(stream: TextIO) -> bool:
    """Whether a stream takes colours: a terminal does that is not dumb.

    NO_COLOR with any value forbids them, FORCE_COLOR or CLICOLOR_FORCE with any value but 0 wants them in a pipe too:
    the first of these that is set decides. An empty variable is none.
    """
    if os.environ.get("NO_COLOR"):
        return False
    if any(os.environ.get(name, "0") not in ("", "0") for name in ("FORCE_COLOR", "CLICOLOR_FORCE")):
        return True
    return moves(stream)


def moves(stream: TextIO | None) -> bool:
    """Whether a stream is a terminal on which a line can be written anew. None: it was closed as the process began."""
    return stream is not None and stream.isatty() and os.environ.get("TERM") != "dumb"
