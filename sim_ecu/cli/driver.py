"""`sim-ecu driver`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import DEFAULT_BUS, add_bus
from wrcd.cli.program import Subcommand

POLICIES = ("wrcd", "tests", "dry", "slippery")
HELP = (
    "wrcd: the lower end of AdhesionAdvice, after a brake test where that is not enough; tests: a test every time, "
    "without wrcd; dry, slippery: one rate"
)


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("policy", choices=POLICIES, help=HELP)
    add_bus(p)
    p.add_argument("--config", type=Path, metavar="FILE", help="the daemon's configuration, with [advice] (for wrcd)")
    p.add_argument(
        "--scenario", default="mark-wet", metavar="SCENARIO",
        help="a scenario to drive, for the facts of its train (default: mark-wet)",
    )  # fmt: skip
    p.add_argument("--for", dest="seconds", type=float, metavar="S", help="end after so many seconds")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.control.adhesion_consumer import Facts
    from sim_ecu.loop.control.control_on_bus import control_on_bus
    from sim_ecu.loop.drive_scenario import load_drive_scenario
    from sim_ecu.loop.driver import make_driver
    from sim_ecu.loop.driver_on_bus import DriverOnBus
    from wrcd.config.config import load_config
    from wrcd.errors import InputError
    from wrcd.logs.bus_of import pick_bus

    if args.seconds is not None and not args.seconds > 0.0:
        raise InputError(f"takes seconds above 0, not {args.seconds:g}", key="--for")
    if args.config is not None and args.policy != "wrcd":
        raise InputError("is for the policy wrcd", key="--config")
    facts = Facts.of(load_drive_scenario(args.scenario))
    config = None if args.config is None else load_config(args.config)
    end = DriverOnBus(make_driver(args.policy, facts, config), facts.full_brake_m_s2)
    bus = pick_bus(args.interface, args.channel, None, DEFAULT_BUS)
    print("\n".join(control_on_bus(end, [end], *bus, args.seconds, end.paced_by)))
    return 0


COMMAND = Subcommand(
    "driver",
    "a driver on a bus, who stops the train of `sim-ecu drive --driver bus` at its mark",
    (
        ("sim-ecu driver wrcd -c vcan0", "by what the daemon advises, until SIGTERM or Ctrl-C"),
        ("sim-ecu driver dry -c vcan0", "as on dry rail"),
    ),
    _add,
    _run,
    own_signals=lambda _: True,
)
