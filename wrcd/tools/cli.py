"""The wrcd command."""

import argparse
import os
import sys
from collections.abc import Sequence

from wrcd.tools.command import Command
from wrcd.tools.commands import (
    check_command,
    dump_command,
    init_command,
    lint_command,
    reload_command,
    replay_command,
    run_command,
)
from wrcd.tools.completion import completion_of
from wrcd.tools.guard import guarded
from wrcd.tools.install import command as install_command
from wrcd.tools.monitor import command as monitor_command
from wrcd.tools.parser import asked, make_parser
from wrcd.tools.report import command as report_command
from wrcd.tools.story import plot_command, why_command

# in the order of the help
COMMANDS: tuple[Command, ...] = (
    run_command.COMMAND,
    reload_command.COMMAND,
    check_command.COMMAND,
    dump_command.COMMAND,
    monitor_command.COMMAND,
    replay_command.COMMAND,
    report_command.COMMAND,
    plot_command.COMMAND,
    why_command.COMMAND,
    init_command.COMMAND,
    lint_command.COMMAND,
    *install_command.COMMANDS,
    completion_of("wrcd"),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit status: see Status."""
    argv = sys.argv[1:] if argv is None else argv
    args = _parser(asked(COMMANDS, argv)).parse_args(argv)
    command = next(c for c in COMMANDS if c.name == args.command)
    _one_thread()
    return guarded("wrcd", lambda: command.run(args), retried=command.retried)


def _parser(commands: Sequence[Command] = COMMANDS) -> argparse.ArgumentParser:
    return make_parser(
        "wrcd",
        "The wheel-rail condition daemon: adhesion from yaw rate, lateral acceleration, torque.",
        commands,
    )


def _one_thread() -> None:
    """Keep the arithmetic to one thread: the bank's products are a few hundred numbers. Call before numpy's import."""
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
