"""A command of a program: one record, which parser, help, manual page and completion are made from."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Command:
    """A command. add gives a parser its arguments; run gets what was parsed and returns the exit status.

    Modules that a command needs are imported by run, not with this record: the daemon starts without them.
    """

    name: str
    help: str  # one line, in lower case, without a full stop
    examples: tuple[tuple[str, str], ...]  # command lines, and what each does
    add: Callable[[ArgumentParser], None]
    run: Callable[[Namespace], int]
    # whether a bus or a file that is not there has a status of its own: the command is tried again by a unit
    retried: bool = True
    # whether it has a handler of SIGINT of its own, with these arguments
    own_signals: Callable[[Namespace], bool] = lambda _: False


def no_arguments(_p: ArgumentParser) -> None:
    """For a command that takes none."""
