"""`sim-ecu calibrate`."""

import argparse
from pathlib import Path

from wrcd.cli.arguments import add_config
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="logs of one train, in any format that wrcd reads")
    add_config(p)
    p.add_argument(
        "--known", type=Path, required=True, metavar="KNOWN.toml",
        help="a vehicle's file with what is known: wheelbase, wheel radius, load; masses help most",
    )  # fmt: skip
    p.add_argument("-o", "--output", type=Path, required=True, metavar="MINE.toml", help="the vehicle's file to write")
    p.add_argument(
        "--axles", metavar="A,B", default="",
        help="both axles of one bogie, the leading one first (default: the configuration's first two)",
    )  # fmt: skip
    p.add_argument("-c", "--channel", help="of a log with several")
    p.add_argument(
        "--html", type=Path, metavar="PAGE.html", help="measured and fitted spectra, to see whether they fit"
    )


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.design.calibrate.run_calibrate import run

    try:
        axles = [int(number) for number in args.axles.split(",") if args.axles]
    except ValueError:
        raise InputError(f"takes two numbers, not {args.axles!r}", key="--axles", hint="e.g. 1,2") from None
    return run(
        args.logs, args.known, args.output, config_file=args.config, axles=axles, channel=args.channel, page=args.html
    )


COMMAND = Subcommand(
    "calibrate",
    "find a vehicle's constants from its own logs (a minute)",
    (
        ("sim-ecu calibrate ride.log --known known.toml -o mine.toml --html fit.html", "a vehicle's file, and a page"),
        (
            "sim-ecu calibrate a.blf b.blf --axles 3,4 --known known.toml -o mine.toml",
            "of two logs, the second bogie",
        ),
    ),
    _add,
    _run,
)
