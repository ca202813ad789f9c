"""`wrcd init`."""

import argparse
from pathlib import Path

from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("dbc", type=Path, metavar="DBC", help="the train's DBC")
    p.add_argument("-o", "--output", type=Path, metavar="MY.toml", help="write it there (default: to the screen)")
    p.add_argument("--force", action="store_true", help="overwrite a file that is there")


def _run(args: argparse.Namespace) -> int:
    from wrcd.dbc.init.propose import init

    return init(args.dbc, args.output, args.force)


COMMAND = Subcommand(
    "init",
    "propose a configuration for a train's DBC, with what a person must settle",
    (
        ("wrcd init train.dbc -o train.toml", "write the proposal; what is open or unsure is marked"),
        ("wrcd init train.dbc", "the same on the screen"),
    ),
    _add,
    _run,
)
