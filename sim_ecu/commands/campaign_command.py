"""`sim-ecu campaign`."""

import argparse
import os
from pathlib import Path

from wrcd.tools.command import Command


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml", help="what is asked: see docs/reference/campaign.md")
    p.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="the campaign's folder: a new one, or one to go on with"
    )
    who = p.add_mutually_exclusive_group()
    who.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )
    who.add_argument(
        "--scheduler", metavar="ADDRESS", help="workers of a Dask scheduler, tcp://HOST:PORT. Extra `cluster`"
    )
    p.add_argument("--again", action="store_true", help="run what failed, took too long or died once more")
    p.add_argument("--dry-run", action="store_true", help="check everything, say what would run, and end")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.commands.run_campaign import plan, run
    from wrcd.errors import InputError

    if args.dry_run:
        return plan(args.campaign)
    if args.out is None:
        raise InputError("is missing", key="-o", hint="name the folder for the results; --dry-run needs none")
    if args.jobs < 1:
        raise InputError(f"takes a whole number from 1 on, not {args.jobs}", key="--jobs")
    return run(args.campaign, args.out, args.jobs, args.scheduler, args.again)


COMMAND = Command(
    "campaign",
    "thousands of runs: every combination of some factors, or a sample of them, as Parquet",
    (
        ("sim-ecu campaign stops.toml -o stops", "on all cores; the same command goes on after a break"),
        ("sim-ecu campaign stops.toml -o stops --scheduler tcp://10.0.0.1:8786", "on the workers of a Dask scheduler"),
    ),
    _add,
    _run,
    retried=False,
)
