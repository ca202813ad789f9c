"""`wrcd dump`."""

import argparse
from pathlib import Path

from wrcd.tools.command import Command
from wrcd.tools.commands.arguments import add_bus


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("log", nargs="?", type=Path, help="a log instead of a bus")
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
        ("wrcd dump -i socketcan -c vcan0", "what a bus carries, until Ctrl-C"),
        ("wrcd dump ride.log --dbc train.dbc -n 100", "the first hundred frames of a log, by the train's own DBC, too"),
    ),
    _add,
    _run,
)
