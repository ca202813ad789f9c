"""`sim-ecu sand`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("--quick", action="store_true", help="two seeds, too few to judge: about two minutes")
    p.add_argument("--seeds", type=int, metavar="N", help="stops on each rail (default: 5, about six minutes)")
    add_jobs(p)
    p.add_argument("--json", type=Path, metavar="OUT", help="all figures, and those of every stop")
    p.add_argument("--html", type=Path, metavar="OUT", help="a page with tables and a picture")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.sand.run_sand import run
    from wrcd.errors import InputError

    check_least(args, jobs=1, seeds=1)
    if args.quick and args.seeds is not None:
        raise InputError("says how many seeds there are", key="--quick", hint="give one of --quick and --seeds")
    return run(args.quick, args.seeds, args.jobs, args.json, args.html)


COMMAND = Subcommand(
    "sand",
    "what sand is worth: one stop on every rail by every sanding policy",
    (("sim-ecu sand --html sand.html", "all stops, as a page"), ("sim-ecu sand --quick", "some of them")),
    _add,
    _run,
)
