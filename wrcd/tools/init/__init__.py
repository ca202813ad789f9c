"""`wrcd init`: a configuration proposed for a train's DBC, with what a person must settle."""

import sys
from pathlib import Path

from wrcd.bus.dbc import load_dbc
from wrcd.errors import InputError, create
from wrcd.tools.dbc.text import read
from wrcd.tools.init.propose import propose


def init(dbc: Path, output: Path | None, force: bool) -> int:
    """Write the proposal to a file or to stdout, and to stderr what is open and unsure. Raises InputError."""
    if output is not None and output.exists() and not force:
        raise InputError("is there already", file=output, hint="name another file, or overwrite it by --force")
    text = read(dbc)
    load_dbc(dbc)
    draft = propose(text, Path() if output is None else output.parent)
    if output is None:
        print(draft.text(), end="")
    else:
        with create(output) as file:
            file.write(draft.text())
    for line in draft.summary(output):
        print(line, file=sys.stderr)
    return 0
