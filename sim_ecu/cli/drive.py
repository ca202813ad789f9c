"""`sim-ecu drive`."""

import argparse
import json
from pathlib import Path

from sim_ecu.cli.arguments import DEFAULT_BUS, add_bus
from sim_ecu.cli.driver import HELP, POLICIES
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    add_bus(p)
    p.add_argument(
        "--log", type=Path, metavar="OUT.log",
        help="write what the rig sends and the demands that it receives to a log (the suffix is its format)",
    )  # fmt: skip
    p.add_argument(
        "--driver", choices=(*POLICIES, "bus"),
        help=f"who decides when to brake for the scenario's mark_m. {HELP}; bus: `sim-ecu driver` as a process",
    )  # fmt: skip
    p.add_argument("--config", type=Path, metavar="FILE", help="the daemon's configuration, for --driver wrcd")
    p.add_argument("--no-truth", action="store_true", help="leave the SimTruth frames out")
    p.add_argument("--json", type=Path, metavar="OUT", help="figures and counts as a document")
    p.add_argument("scenario", metavar="SCENARIO", help="name of a packaged scenario to drive, or a .toml file")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.control.adhesion_consumer import Facts
    from sim_ecu.loop.drive_scenario import load_drive_scenario
    from sim_ecu.loop.drive_session import document, drive_on_bus, summary
    from sim_ecu.loop.driver import Driver, make_driver
    from sim_ecu.loop.driver_on_bus import LeverOnBus
    from sim_ecu.reporting.result_files import check_output
    from wrcd.config.config import load_config
    from wrcd.errors import InputError, create
    from wrcd.logs.bus_of import pick_bus

    scenario = load_drive_scenario(args.scenario)
    if args.config is not None and args.driver != "wrcd":
        raise InputError("is for --driver wrcd", key="--config")
    driver: Driver | None = None
    if args.driver is not None:
        if scenario.mark_m is None:
            raise InputError(f"{args.scenario} has no mark_m to stop at", key="--driver", hint="write mark_m = 600.0")
        facts = Facts.of(scenario)
        config = None if args.config is None else load_config(args.config)
        on_bus = args.driver == "bus"
        driver = LeverOnBus(facts.full_brake_m_s2) if on_bus else make_driver(args.driver, facts, config)
    check_output("--json", args.json)
    bus = pick_bus(args.interface, args.channel, None, DEFAULT_BUS)
    ride = drive_on_bus(scenario, *bus, args.log, not args.no_truth, driver)
    print("\n".join(summary(scenario, ride)))
    if args.json is not None:
        with create(args.json) as file:
            file.write(json.dumps(document(scenario, ride), indent=1, allow_nan=False) + "\n")
    return ride.status


COMMAND = Subcommand(
    "drive",
    "the rig with its loop open: torque and valves are what a controller on the bus demands",
    (
        ("sim-ecu drive emergency-greasy -c vcan0", "a stop on greasy rail; see `sim-ecu control`"),
        ("sim-ecu drive stop.toml -c can0 --json stop.json", "a scenario of your own, and its figures as a document"),
    ),
    _add,
    _run,
    own_signals=lambda _: True,
)
