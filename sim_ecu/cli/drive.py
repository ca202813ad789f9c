"""`sim-ecu drive`."""

import argparse
import json
from pathlib import Path

from sim_ecu.cli.arguments import DEFAULT_BUS, add_bus
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    add_bus(p)
    p.add_argument(
        "--log", type=Path, metavar="OUT.log",
        help="write what the rig sends and the demands that it receives to a log (the suffix is its format)",
    )  # fmt: skip
    p.add_argument("--no-truth", action="store_true", help="leave the SimTruth frames out")
    p.add_argument("--json", type=Path, metavar="OUT", help="figures and counts as a document")
    p.add_argument("scenario", metavar="SCENARIO", help="name of a packaged scenario to drive, or a .toml file")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.drive_scenario import load_drive_scenario
    from sim_ecu.loop.drive_session import document, drive_on_bus, summary
    from sim_ecu.reporting.result_files import check_output
    from wrcd.errors import create
    from wrcd.logs.bus_of import pick_bus

    scenario = load_drive_scenario(args.scenario)
    check_output("--json", args.json)
    bus = pick_bus(args.interface, args.channel, None, DEFAULT_BUS)
    ride = drive_on_bus(scenario, *bus, args.log, not args.no_truth)
    print("\n".join(summary(scenario, ride)))
    if args.json is not None:
        with create(args.json) as file:
            file.write(json.dumps(document(scenario, ride), indent=1, allow_nan=False) + "\n")
    return ride.status


COMMAND = Subcommand(
    "drive",
    "the rig in a closed loop: torque and valves are what a controller on the bus demands",
    (
        ("sim-ecu drive emergency-greasy -c vcan0", "a stop on greasy rail; see `sim-ecu control`"),
        ("sim-ecu drive stop.toml -c can0 --json stop.json", "a scenario of your own, and its figures as a document"),
    ),
    _add,
    _run,
    own_signals=lambda _: True,
)
