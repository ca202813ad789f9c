"""`sim-ecu demo`."""

import argparse
from pathlib import Path

from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "-i",
        "--interface",
        help="default: python-can's settings, else socketcan on vcan0 if there is one, else virtual",
    )
    p.add_argument("-c", "--channel", help="its channel")
    p.add_argument("--config", type=Path, metavar="FILE", help="configuration of both (default: the packaged DBC)")
    p.add_argument(
        "--scenario", default="leaf-patch", help="name of a packaged scenario, or a .toml file (default: leaf-patch)"
    )
    p.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("build/demo"),
        metavar="DIR",
        help="folder of log and picture (build/demo)",
    )


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.play.demo import default_bus, run
    from wrcd.logs.bus_of import pick_bus

    bus = pick_bus(args.interface, args.channel, None, default_bus())
    return run(*bus, args.scenario, args.output, args.config)


COMMAND = Subcommand(
    "demo",
    "rig and daemon on one bus, the estimate against the truth",
    (
        ("sim-ecu demo", "on vcan0 where there is one, else without a bus; pictures in build/demo"),
        ("sim-ecu demo --scenario half-wet -o half-wet", "another scenario, into another folder"),
    ),
    _add,
    _run,
)
