"""`wrcd monitor` as a command."""

import argparse
from pathlib import Path

from wrcd.errors import InputError
from wrcd.tools.command import Command
from wrcd.tools.commands.arguments import add_bit_rate, add_bus, check_bit_rate


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("log", nargs="?", type=Path, metavar="LOG", help="a log instead of a bus")
    add_bus(p)
    p.add_argument("--config", type=Path, metavar="FILE", help="configuration whose messages are shown")
    p.add_argument(
        "--dbc", type=Path, action="append", default=[], metavar="FILE",
        help="another DBC; the rig's, dbc/sim_ecu.dbc, gives the truth; may be repeated",
    )  # fmt: skip
    add_bit_rate(p)


def _run(args: argparse.Namespace) -> int:
    check_bit_rate(args.bit_rate)
    if args.log is not None and args.interface is not None:
        raise InputError("a log or a bus, not both", key="--interface", hint="leave out LOG or -i")
    from wrcd.tools.monitor.run import monitor

    return monitor(args.log, args.config, args.interface, args.channel, args.dbc, args.bit_rate)


COMMAND = Command(
    "monitor",
    "show on a terminal what a daemon says, live or of a log; it sends nothing",
    (
        ("wrcd monitor -i socketcan -c vcan0 --dbc dbc/sim_ecu.dbc", "a bus, with the rig's truth beside the estimate"),
        ("wrcd monitor ride.log", "a log, with the cursor where the adhesion first fell; w tells why"),
    ),
    _add,
    _run,
)
