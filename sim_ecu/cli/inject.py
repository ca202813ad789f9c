"""`sim-ecu inject`."""

import argparse

from sim_ecu.cli.play import add_player, played
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    add_player(p)
    p.add_argument("scenario", metavar="SCENARIO", nargs="?", help="name of a packaged scenario, or a .toml file")
    p.add_argument(
        "--fault", action="append", default=[], metavar="SPEC",
        help="KIND:at=S,for=S,of=SIGNAL,axle=N,amount=X, e.g. crc:at=3,for=0.5,of=yaw_rate,axle=1; may be repeated",
    )  # fmt: skip
    p.add_argument("--list", action="store_true", help="the kinds of fault")


def _run(args: argparse.Namespace) -> int:
    from dataclasses import replace

    from sim_ecu.play.faults import listing, parse_fault
    from sim_ecu.play.scenario import load_scenario
    from wrcd.errors import InputError

    if args.list:
        print(listing())
        return 0
    if args.scenario is None:
        raise InputError("is missing", key="SCENARIO", hint="see sim-ecu list; --list names the faults")
    scenario = load_scenario(args.scenario)
    numbers = [a.number for a in scenario.axles]
    faults = (*scenario.faults, *(parse_fault(spec, numbers, scenario.duration_s) for spec in args.fault))
    if not faults:
        raise InputError("is missing", key="--fault", hint="--list names the kinds")
    return played(replace(scenario, faults=faults), args)


COMMAND = Subcommand(
    "inject",
    "play a scenario with faults",
    (
        (
            "sim-ecu inject dry --fault crc:at=3,for=0.5,of=yaw_rate,axle=1 -c vcan0",
            "wrong check sums of one sensor for half a second",
        ),
        ("sim-ecu inject --list", "the kinds of fault, and what each takes"),
    ),
    _add,
    _run,
    own_signals=lambda args: not args.fast,
)
