"""`sim-ecu mark`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from sim_ecu.score import MISSED
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("--world", metavar="NAME", help="only this one")
    p.add_argument(
        "--quick", action="store_true", help="one line of every world, too few to judge: about three minutes"
    )
    p.add_argument("--lines", type=int, metavar="N", help="lines of ten stations of every world (default: 4 to 20)")
    p.add_argument(
        "--training", action="store_true", help="the seeds that rules are tuned on, not those of the figures"
    )
    add_jobs(p)
    p.add_argument("--fail-on", choices=(MISSED,), help="exit 1 where a goal is missed, beyond chance")
    p.add_argument("--json", type=Path, metavar="OUT", help="all figures, and those of every stop")
    p.add_argument("--html", type=Path, metavar="OUT", help="a page with tables and pictures")
    p.add_argument("--png", type=Path, metavar="OUT", help="its first picture")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.mark.run_mark import run
    from wrcd.errors import InputError

    check_least(args, jobs=1, lines=1)
    if args.quick and args.lines is not None:
        raise InputError("says how many lines there are", key="--quick", hint="give one of --quick and --lines")
    return run(
        args.world, args.quick, args.lines, args.training, args.jobs, args.json, args.html, args.png, args.fail_on
    )


COMMAND = Subcommand(
    "mark",
    "what wrcd is worth to who stops at a mark: every policy on lines of ten stations",
    (
        ("sim-ecu mark --html mark.html", "all worlds, as a page"),
        ("sim-ecu mark --lines 2 --jobs 1", "two lines of every world, in one process"),
    ),
    _add,
    _run,
)
