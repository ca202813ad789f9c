"""`wrcd check`: of a configuration, of a log, of a bus, of this computer."""

import argparse
from pathlib import Path

from wrcd.errors import InputError
from wrcd.tools.command import Command
from wrcd.tools.commands.arguments import add_bus, add_config


def _add(p: argparse.ArgumentParser) -> None:
    add_config(p)
    p.add_argument(
        "--speed", action="store_true", help="measure what the core costs on this computer: ten seconds, no bus"
    )
    p.add_argument(
        "--log", type=Path, metavar="LOG",
        help="what a log says of each mapped signal, and what would stop Valid: exit 1 if anything, 3 if no frame fits",
    )  # fmt: skip
    p.add_argument("--live", type=float, metavar="S", help="the same of a bus, listened to for so many seconds")
    add_bus(p)


def _run(args: argparse.Namespace) -> int:
    if args.speed:
        return _speed(args)
    if args.log is not None or args.live is not None:
        return _check_bus(args)
    from wrcd.config import load_config
    from wrcd.tools.check import describe

    print("\n".join(describe(load_config(args.config))))
    return 0


def _check_bus(args: argparse.Namespace) -> int:
    from wrcd.tools.bus_check.run import check_live, check_log

    if args.log is not None and args.live is not None:
        raise InputError("a log or a bus, not both", key="--live", hint="leave out --log or --live")
    if args.log is not None:
        return check_log(args.log, args.config, args.channel)
    return check_live(args.live, args.config, args.interface, args.channel)


def _speed(args: argparse.Namespace) -> int:
    from wrcd.config import load_config
    from wrcd.tools.speed import speed

    return speed(load_config(args.config))


COMMAND = Command(
    "check",
    "say what a configuration would run, or what a log or a bus gives it",
    (
        ("wrcd check --config train.toml", "what would be read and sent, or every mistake of the file"),
        ("wrcd check --config train.toml --log ride.log", "what would stop Valid in a log of that train"),
    ),
    _add,
    _run,
)
