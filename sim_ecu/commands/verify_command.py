"""`sim-ecu verify`."""

import argparse
from pathlib import Path

from wrcd.tools.command import Command


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("log", type=Path, metavar="LOG", help="candump log, or any that python-can reads")
    p.add_argument("--config", type=Path, metavar="FILE", help="the daemon's configuration")
    p.add_argument(
        "--fuzzy-every", type=float, default=0.1, metavar="S", help="compare the fuzzy output so often (default 0.1 s)"
    )


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.design.verify import run

    return run(args.log, args.config, args.fuzzy_every)


COMMAND = Command(
    "verify",
    "run the fast and the reference engine over a log and compare them",
    (
        ("sim-ecu verify ride.log", "the largest difference of each figure, and whether it may be"),
        ("sim-ecu verify ride.log --config train.toml", "the same for a log of the train's own DBC"),
    ),
    _add,
    _run,
)
