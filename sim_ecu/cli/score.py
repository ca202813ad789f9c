"""`sim-ecu score`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from sim_ecu.score import MISSED, SUITES
from wrcd.cli.arguments import add_design
from wrcd.cli.program import Subcommand
from wrcd.resources import DEFAULT_DESIGN


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("--suite", choices=SUITES, help="only this one")
    p.add_argument(
        "--quick", action="store_true", help="a twelfth of the runs, too few to judge most goals: one to two minutes"
    )
    add_jobs(p)
    add_design(p)
    p.add_argument(
        "--beside", action="append", default=[], metavar="NAME=DESIGN",
        help="another design, a packaged one or a file, for the same wheelset, run on the same frames; may be repeated",
    )  # fmt: skip
    p.add_argument("--fail-on", choices=(MISSED,), help="exit 1 where a goal is missed, beyond chance")
    p.add_argument("--plot", type=Path, metavar="PNG", help="how far each goal is met; of the suite map its picture")
    p.add_argument("--json", type=Path, metavar="OUT", help="all figures")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.score.run_score import run
    from wrcd.config.packaged_designs import design_path

    check_least(args, jobs=1)
    design = design_path(args.design or DEFAULT_DESIGN)
    return run(args.suite, args.quick, args.jobs, design, args.beside, args.json, args.fail_on, args.plot)


COMMAND = Subcommand(
    "score",
    "how good a design is, with baselines beside it",
    (
        ("sim-ecu score --quick --json score.json", "a twelfth of the runs: tables, and all figures in a file"),
        (
            "sim-ecu score --suite transitions --fail-on missed",
            "one suite, with all its runs; exit 1 where a goal is missed",
        ),
    ),
    _add,
    _run,
)
