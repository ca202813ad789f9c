"""`sim-ecu fronts`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from sim_ecu.loop.fronts import RAILS
from wrcd.cli.program import Subcommand

SEEDS = 5  # the fewest that give an interval; eight minutes on two cores


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("--rail", choices=RAILS, help="only this one")
    p.add_argument(
        "--seeds", type=int, default=SEEDS, metavar="N",
        help=f"runs of every point (default: {SEEDS}, eight minutes on two cores; fewer give no interval)",
    )  # fmt: skip
    add_jobs(p)
    p.add_argument("--json", type=Path, metavar="OUT", help="all figures, and those of every run")
    p.add_argument("--html", type=Path, metavar="OUT", help="a page with tables and pictures")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.fronts.run_fronts import run

    check_least(args, jobs=1, seeds=1)
    return run(args.rail, args.seeds, args.jobs, args.json, args.html)


COMMAND = Subcommand(
    "fronts",
    "whether wrcd or another set point saves slip energy: each controller over its set points, with wrcd and without",
    (
        ("sim-ecu fronts --html fronts.html", "all rails, as a page: eight minutes on two cores"),
        ("sim-ecu fronts --rail greasy --seeds 10", "ten runs of every point of one rail"),
    ),
    _add,
    _run,
)
