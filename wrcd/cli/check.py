"""`wrcd check`: of a configuration, of a log, of a bus."""

import argparse
from pathlib import Path

from wrcd.cli.arguments import add_bus, add_config
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError


def _add(p: argparse.ArgumentParser) -> None:
    add_config(p)
    p.add_argument(
        "--log", type=Path, metavar="LOG",
        help="what a log says of each mapped signal, and what would stop Valid: exit 1 if anything, 3 if no frame fits",
    )  # fmt: skip
    p.add_argument("--live", type=float, metavar="S", help="the same of a bus, listened to for so many seconds")
    p.add_argument(
        "--installation", action="store_true",
        help="what this computer has for wrcd, and what mends what it lacks: exit 1 if a line says NO",
    )  # fmt: skip
    add_bus(p)


def _run(args: argparse.Namespace) -> int:
    if args.installation and (args.config or args.log or args.live is not None or args.interface or args.channel):
        raise InputError("is of the computer alone", key="--installation", hint="leave out the other options")
    if args.installation:
        from wrcd.errors import Status
        from wrcd.service.installation import report

        return Status.DONE if report() else Status.STOPPED
    if args.log is not None and args.live is not None:
        raise InputError("a log or a bus, not both", key="--live", hint="leave out --log or --live")
    if args.log is not None or args.live is not None:
        from wrcd.dbc.bus_check.check import check_live, check_log

        if args.log is not None:
            return check_log(args.log, args.config, args.channel)
        return check_live(args.live, args.config, args.interface, args.channel)
    from wrcd.config.config import load_config
    from wrcd.config.describe import describe

    print("\n".join(describe(load_config(args.config))))
    return 0


COMMAND = Subcommand(
    "check",
    "say what a configuration would run, or what a log or a bus gives it",
    (
        ("wrcd check --config train.toml", "what would be read and sent, or every mistake of the file"),
        ("wrcd check --config train.toml --log ride.log", "what would stop Valid in a log of that train"),
    ),
    _add,
    _run,
)
