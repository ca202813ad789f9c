"""`wrcd completion`, `sim-ecu completion`: the packaged script for a shell."""

import argparse
import sys
from functools import partial

from wrcd.cli.program import Subcommand

FILES = {"bash": "{}.bash", "zsh": "_{}"}


def completion_of(program: str) -> Subcommand:
    """The command of a program."""
    return Subcommand(
        "completion",
        "print the completion of the command line for a shell",
        (
            (f"source <({program} completion bash)", "complete with Tab in this shell"),
            (f"{program} completion zsh > ~/.zfunc/_{program}", "in every zsh that has ~/.zfunc in its fpath"),
        ),
        _add,
        partial(_run, program),
    )


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("shell", choices=tuple(FILES), help="the shell that is to read it")


def _run(program: str, args: argparse.Namespace) -> int:
    from wrcd import resources

    sys.stdout.write((resources.COMPLETION / FILES[args.shell].format(program)).read_text(encoding="utf-8"))
    return 0


COMMAND = completion_of("wrcd")
