"""`sim-ecu fmu`."""

import argparse
from pathlib import Path

from wrcd.cli.program import Subcommand

DEFAULT = "emergency-greasy"


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "scenario", nargs="?", default=DEFAULT, metavar="SCENARIO",
        help=f"name of a packaged scenario to drive, or a .toml file (default: {DEFAULT})",
    )  # fmt: skip
    p.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.fmu", help="the file to make")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.fmu.pack import pack
    from sim_ecu.reporting.result_files import check_output
    from wrcd import __version__
    from wrcd.errors import InputError

    output: Path = args.output
    if output.suffix != ".fmu":
        raise InputError("does not end in .fmu", file=output, key="-o", hint=f"write {output.stem or 'rig'}.fmu")
    check_output("-o", output)
    packed, variables = pack(args.scenario, output)
    axles = len(packed.axles)
    print(
        f"{output}: {packed.train.name}, {axles} axle{'s' * (axles > 1)}, {len(variables)} variables; "
        f"needs Linux on x86-64 and Python 3.11 or newer with wrcd[bench] {__version__}"
    )
    return 0


COMMAND = Subcommand(
    "fmu",
    "make an FMU of the rig: FMI 2.0 co-simulation, torque in, sensors and truth out",
    (
        ("sim-ecu fmu emergency-greasy -o greasy.fmu", "a stop on greasy rail, for FMPy and other masters"),
        ("sim-ecu fmu my-train.toml -o my-train.fmu", "a scenario to drive of your own"),
    ),
    _add,
    _run,
)
