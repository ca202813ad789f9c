"""The wrcd command."""

import argparse
import os
import sys
from collections.abc import Sequence

from wrcd.tools.command import Command
from wrcd.tools.commands import run_command
from wrcd.tools.guard import guarded
from wrcd.tools.parser import make_parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit status: see Status."""
    argv = sys.argv[1:] if argv is None else list(argv)
    # the daemon's bus is not open yet: it starts without the records of the other commands
    commands = (run_command.COMMAND,) if argv[:1] == [run_command.COMMAND.name] else _every()
    args = _parser(commands).parse_args(argv)
    command = next(c for c in commands if c.name == args.command)
    _one_thread()
    own_signals = command.own_signals(args)
    return guarded("wrcd", lambda: command.run(args), retried=command.retried, own_signals=own_signals)


def _every() -> tuple[Command, ...]:
    from wrcd.tools.commands.listed import COMMANDS

    return COMMANDS


def _parser(commands: Sequence[Command] | None = None) -> argparse.ArgumentParser:
    return make_parser(
        "wrcd",
        "The wheel-rail condition daemon: adhesion from yaw rate, lateral acceleration, torque.",
        _every() if commands is None else commands,
    )


def _one_thread() -> None:
    """Keep the arithmetic to one thread: the bank's products are a few hundred numbers. Call before numpy's import."""
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
