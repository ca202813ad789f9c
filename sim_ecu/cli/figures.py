"""`sim-ecu figures`."""

import argparse
from pathlib import Path

from wrcd.cli.arguments import add_design
from wrcd.cli.program import Subcommand
from wrcd.resources import LONE


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="the folder to draw into")
    add_design(p, LONE)
    p.add_argument(
        "--paper", type=Path, metavar="DESIGN.json",
        help="a design in the paper's own form, drawn beside it (default: the packaged one, for its wheelset)",
    )  # fmt: skip


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.score.figures import run
    from wrcd.config.packaged_designs import design_path

    return run(args.output, design_path(args.design or LONE), args.paper)


COMMAND = Subcommand(
    "figures",
    "the paper's figures, from our data",
    (
        ("sim-ecu figures -o figures", "draw them into a folder, with a page of captions"),
        ("sim-ecu figures -o figures --design my.design.json", "those of a design of your own"),
    ),
    _add,
    _run,
)
