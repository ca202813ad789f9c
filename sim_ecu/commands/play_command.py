"""`sim-ecu play`."""

import argparse

from sim_ecu.commands.playing import add_player, played
from wrcd.tools.command import Command


def _add(p: argparse.ArgumentParser) -> None:
    add_player(p)
    p.add_argument("scenario", metavar="SCENARIO", help="name of a packaged scenario, or a .toml file")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.play.scenario import load_scenario

    return played(load_scenario(args.scenario), args)


COMMAND = Command(
    "play",
    "play a scenario onto a bus, or into a log",
    (
        ("sim-ecu play leaf-patch -c vcan0", "in real time onto vcan0"),
        ("sim-ecu play leaf-patch --fast --log ride.log", "the same into a log, in about a second"),
    ),
    _add,
    _run,
    own_signals=lambda args: not args.fast,
)
