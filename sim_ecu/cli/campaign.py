"""`sim-ecu campaign`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError

OF_LOGS = ("train", "config", "channel", "limit", "reports")


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "campaign", type=Path, nargs="?", metavar="CAMPAIGN.toml", help="what is asked: see docs/reference/campaign.md"
    )
    p.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="the campaign's folder: a new one, or one to go on with"
    )
    who = p.add_mutually_exclusive_group()
    add_jobs(who)
    who.add_argument(
        "--scheduler", metavar="ADDRESS", help="workers of a Dask scheduler, tcp://HOST:PORT. Extra `cluster`"
    )
    p.add_argument("--again", action="store_true", help="run what failed, took too long or died once more")
    p.add_argument("--dry-run", action="store_true", help="check everything, say what would run, and end")
    p.add_argument(
        "--logs", metavar="DIR|GLOB", help="instead of a campaign: the logs of a fleet, each through the daemon's core"
    )
    p.add_argument(
        "--train", metavar="PATTERN",
        help="of --logs: a regular expression whose group `train` is found in a log's path (default: the first folder)",
    )  # fmt: skip
    p.add_argument(
        "--config", type=Path, metavar="FILE",
        help="of --logs: the daemon's configuration of logs without a wrcd.toml in their folder or above it",
    )  # fmt: skip
    p.add_argument("--channel", metavar="NAME", help="of --logs: of those that have several")
    p.add_argument("--limit", type=float, metavar="S", help="of --logs: a log that takes longer is ended and reported")
    p.add_argument("--reports", action="store_true", help="of --logs: a page of each log, too. Extra `report`")


def _run(args: argparse.Namespace) -> int:
    _check_what(args)
    if args.out is None and not args.dry_run:
        raise InputError("is missing", key="-o", hint="name the folder for the results; --dry-run needs none")
    check_least(args, jobs=1)
    if args.logs is not None:
        from sim_ecu.campaign.fleet import run_fleet

        logs = run_fleet.Logs(args.logs, args.train, args.config, args.channel or "", args.limit, args.reports)
        if args.dry_run:
            return run_fleet.plan(logs)
        return run_fleet.run(logs, args.out, args.jobs, args.scheduler, args.again)
    from sim_ecu.campaign.run_campaign import plan, run

    return plan(args.campaign) if args.dry_run else run(args.campaign, args.out, args.jobs, args.scheduler, args.again)


def _check_what(args: argparse.Namespace) -> None:
    """Raise InputError where it is neither a campaign nor logs, or both."""
    if (args.campaign is None) == (args.logs is None):
        reason = "is missing" if args.campaign is None else "and --logs are two questions"
        raise InputError(reason, key="CAMPAIGN.toml", hint="name a campaign, or logs: --logs DIR")
    if args.logs is None:
        for name in OF_LOGS:
            if getattr(args, name):
                raise InputError("is of --logs", key=f"--{name}", hint="a campaign says all of it in its file")
    elif args.limit is not None and args.limit <= 0:
        raise InputError(f"takes more than 0 s, not {args.limit:g}", key="--limit")


COMMAND = Subcommand(
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
