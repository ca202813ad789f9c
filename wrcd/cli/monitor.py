"""`wrcd monitor` as a command."""

import argparse
from pathlib import Path

from wrcd.cli.arguments import add_bit_rate, add_bus, add_dbc, check_bit_rate
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("log", nargs="?", type=Path, metavar="LOG", help="a log instead of a bus")
    add_bus(p)
    p.add_argument("--config", type=Path, metavar="FILE", help="configuration whose messages are shown")
    add_dbc(p, "; the rig's, dbc/sim_ecu.dbc, gives the truth")
    add_bit_rate(p)


def _run(args: argparse.Namespace) -> int:
    check_bit_rate(args.bit_rate)
    if args.log is not None and args.interface is not None:
        raise InputError("a log or a bus, not both", key="--interface", hint="leave out LOG or -i")
    from wrcd.monitor.launch import monitor

    return monitor(args.log, args.config, args.interface, args.channel, args.dbc, args.bit_rate)


COMMAND = Subcommand(
    "monitor",
    "show on a terminal what a daemon says, live or of a log; it sends nothing",
    (
        ("wrcd monitor -i socketcan -c vcan0 --dbc dbc/sim_ecu.dbc", "a bus, with the rig's truth beside the estimate"),
        ("wrcd monitor ride.log", "a log, with the cursor where the adhesion first fell; w tells why"),
    ),
    _add,
    _run,
)
