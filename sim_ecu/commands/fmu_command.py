"""`sim-ecu fmu`."""

import argparse
from pathlib import Path

from wrcd.tools.command import Command

DEFAULT = "brake-greasy"


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "scenario", nargs="?", default=DEFAULT, metavar="SCENARIO",
        help=f"name of a packaged scenario to drive, or a .toml file (default: {DEFAULT})",
    )  # fmt: skip
    p.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.fmu", help="the file to make")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.commands.run_fmu import run

    return run(args.scenario, args.output)


COMMAND = Command(
    "fmu",
    "make an FMU of the rig: FMI 2.0 co-simulation, torque in, sensors and truth out",
    (
        ("sim-ecu fmu brake-greasy -o greasy.fmu", "a stop on greasy rail, for FMPy and other masters"),
        ("sim-ecu fmu my-train.toml -o my-train.fmu", "a scenario to drive of your own"),
    ),
    _add,
    _run,
)
