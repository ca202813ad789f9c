"""`wrcd dump`."""

import argparse
from pathlib import Path

from wrcd.tools.command import Command
from wrcd.tools.commands.arguments import add_bus


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "log",
        nargs="?",
        metavar="LOG",
        type=Path,
        help="a log instead of a bus; -: standard input, lines of candump -L as they come",
    )
    add_bus(p)
    p.add_argument("-n", "--count", type=int, default=0, help="stop after so many frames")
    p.add_argument(
        "--dbc",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="another DBC, which wins over the configuration's; may be repeated",
    )
    p.add_argument("--config", type=Path, metavar="FILE", help="configuration whose DBC decodes")


def _run(args: argparse.Namespace) -> int:
    from wrcd.tools.dump import dump

    return dump(args)


COMMAND = Command(
    "dump",
    "candump lines with the decoded values behind them",
    (
        ("candump -L vcan0 | wrcd dump -", "what a bus carries, through candump's filters, until Ctrl-C"),
        ("wrcd dump ride.log --dbc train.dbc -n 100", "the first hundred frames of a log, by the train's own DBC, too"),
    ),
    _add,
    _run,
)
