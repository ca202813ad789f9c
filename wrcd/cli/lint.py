"""`wrcd lint`."""

import argparse
from pathlib import Path

from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("dbc", type=Path, metavar="DBC", help="the train's DBC")
    p.add_argument("--json", action="store_true", help="for a program: a record for each finding")


def _run(args: argparse.Namespace) -> int:
    from wrcd.dbc.lint.lint_file import lint

    return lint(args.dbc, args.json)


COMMAND = Subcommand(
    "lint",
    "what a DBC says that loading lets pass and that costs frames or values",
    (
        ("wrcd lint train.dbc", "a line for each finding, and how to mend it"),
        ("wrcd lint --json train.dbc", "the same as records, for a program"),
    ),
    _add,
    _run,
)
