"""`sim-ecu loop`."""

import argparse
import os
from pathlib import Path

from sim_ecu.loop.names import SUITES
from sim_ecu.score.names import MISSED
from wrcd.tools.command import Command


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("--suite", choices=SUITES, help="only this one")
    p.add_argument("--only", default="", metavar="TEXT", help="only the rows whose name holds this text")
    p.add_argument("--quick", action="store_true", help="one seed, too few to judge any goal: about two minutes")
    p.add_argument(
        "--seeds", type=int, metavar="N", help="runs of every row (default: 20; 8 of faults, worlds and actuators)"
    )
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)")
    p.add_argument("--fail-on", choices=(MISSED,), help="exit 1 where a goal is missed, beyond chance")
    p.add_argument("--json", type=Path, metavar="OUT", help="all figures, and those of every run")
    p.add_argument("--html", type=Path, metavar="OUT", help="a page with tables and pictures")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.commands.run_loop import run
    from wrcd.errors import InputError

    for key, value in (("--jobs", args.jobs), ("--seeds", args.seeds)):
        if value is not None and value < 1:
            raise InputError(f"takes a whole number from 1 on, not {value}", key=key)
    if args.quick and args.seeds is not None:
        raise InputError("says how many seeds there are", key="--quick", hint="give one of --quick and --seeds")
    return run(args.suite, args.only, args.quick, args.seeds, args.jobs, args.json, args.html, args.fail_on)


COMMAND = Command(
    "loop",
    "what controllers make of wrcd: stops and starts in lockstep, with it and without",
    (
        ("sim-ecu loop --quick --html loop.html", "one seed of everything, as a page"),
        ("sim-ecu loop --suite faults --only freeze --seeds 5", "some of its rows, five seeds of each"),
    ),
    _add,
    _run,
)
