"""`sim-ecu contact`."""

import argparse
from pathlib import Path

from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("cases", type=Path, metavar="CASES.csv", help="a row for each case")
    p.add_argument("--k-a", type=float, default=1.0, metavar="K", help="reduction in the area of adhesion (1)")
    p.add_argument("--k-s", type=float, default=1.0, metavar="K", help="reduction in the area of slip (1)")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.score.contact_table import run

    return run(args.cases, args.k_a, args.k_s)


COMMAND = Subcommand(
    "contact",
    "creep forces of the rig's contact law for the cases of a CSV",
    (
        ("sim-ecu contact cases.csv", "a row of forces for each case"),
        ("sim-ecu contact cases.csv --k-a 0.6 --k-s 0.2", "the same with a contaminated rail's reductions"),
    ),
    _add,
    _run,
)
