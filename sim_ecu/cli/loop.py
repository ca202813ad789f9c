"""`sim-ecu loop`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from sim_ecu.loop import SUITES
from sim_ecu.score import MISSED
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("--suite", choices=SUITES, help="only this one")
    p.add_argument("--only", default="", metavar="TEXT", help="only the rows whose name holds this text")
    p.add_argument("--quick", action="store_true", help="one seed, too few to judge any goal: about two minutes")
    p.add_argument(
        "--seeds", type=int, metavar="N", help="runs of every row (default: 20; 8 of faults, worlds and actuators)"
    )
    add_jobs(p)
    p.add_argument("--fail-on", choices=(MISSED,), help="exit 1 where a goal is missed, beyond chance")
    p.add_argument("--json", type=Path, metavar="OUT", help="all figures, and those of every run")
    p.add_argument("--html", type=Path, metavar="OUT", help="a page with tables and pictures")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.run_loop import run
    from wrcd.errors import InputError

    check_least(args, jobs=1, seeds=1)
    if args.quick and args.seeds is not None:
        raise InputError("says how many seeds there are", key="--quick", hint="give one of --quick and --seeds")
    return run(args.suite, args.only, args.quick, args.seeds, args.jobs, args.json, args.html, args.fail_on)


COMMAND = Subcommand(
    "loop",
    "what controllers make of wrcd: stops and starts in lockstep, with it and without",
    (
        ("sim-ecu loop --quick --html loop.html", "one seed of everything, as a page"),
        ("sim-ecu loop --suite faults --only freeze --seeds 5", "some of its rows, five seeds of each"),
    ),
    _add,
    _run,
)
