"""`sim-ecu tune`."""

import argparse
import os
from pathlib import Path

from wrcd.tools.command import Command

BUDGET, PLAYED, SEED = 120, 8, 1
MAX_SEED = 39  # lots of training seeds there are: see sim_ecu/score/suites/run.py


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "--config", type=Path, metavar="RIG.toml",
        help="where the search starts, and what it is for: a file as `sim-ecu design --config` takes it, or metro or "
        "locomotive (default: the packaged design's own)",
    )  # fmt: skip
    p.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="folder of all that is found; made")
    p.add_argument("--form", choices=("wrcd", "paper"), help="as of `sim-ecu design` (default: as --config says)")
    p.add_argument(
        "--over", metavar="NAME,…",
        help="what is searched: noise, weights, points (creep), band, window, rules (default: all that the form has)",
    )  # fmt: skip
    p.add_argument(
        "--budget", type=int, default=BUDGET, metavar="N",
        help="candidates that are judged by recorded conditions, the start among them; each takes some ten seconds of "
        f"a core (default: {BUDGET}: 20 minutes of a core)",
    )  # fmt: skip
    p.add_argument(
        "--played", type=int, default=PLAYED, metavar="N",
        help="designs that are played on whole runs, the start among them, each a minute of a core; 0: make none, "
        f"write the best candidate (default: {PLAYED})",
    )  # fmt: skip
    p.add_argument("--seed", type=int, default=SEED, metavar="N", help=f"of the search and its runs (default: {SEED})")
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)")
    p.add_argument(
        "--against", type=Path, metavar="DESIGN.json",
        help="the design to reach (default: the packaged one; for another wheelset the start's)",
    )  # fmt: skip


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.commands.run_tune import run
    from wrcd.errors import InputError

    for key, least in (("budget", 1), ("jobs", 1), ("played", 0), ("seed", 0)):
        if getattr(args, key) < least:
            raise InputError(f"takes a whole number from {least} on, not {getattr(args, key)}", key=f"--{key}")
    if args.seed > MAX_SEED:
        raise InputError(f"takes a whole number from 0 to {MAX_SEED}, not {args.seed}", key="--seed")
    return run(
        args.config, args.output, args.form, args.over, args.budget, args.played, args.seed, args.jobs, args.against
    )


COMMAND = Command(
    "tune",
    "search a design on training seeds, and compare it with the shipped one on test seeds (takes an hour)",
    (
        ("sim-ecu tune --config my-rig.toml -o tuned", "from a brief on; again with the same folder: goes on"),
        ("sim-ecu tune --over noise,weights --played 0 -o noise", "only the process noise and weights, as a brief"),
    ),
    _add,
    _run,
)
