"""`sim-ecu campaign`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError

OF_LOGS = ("train", "config", "channel", "limit", "from_km")


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("campaign", type=Path, nargs="?", metavar="CAMPAIGN.toml", help="see docs/reference/campaign.md")
    p.add_argument("-o", "--out", type=Path, metavar="DIR", help="the rows' folder: a new one, or one to go on with")
    who = p.add_mutually_exclusive_group()
    add_jobs(who)
    who.add_argument("--scheduler", metavar="ADDRESS", help="workers of a Dask scheduler, tcp://HOST:PORT")
    p.add_argument("--again", action="store_true", help="run what failed, took too long or died once more")
    p.add_argument("--dry-run", action="store_true", help="check everything, say what would run, and end")
    p.add_argument("--logs", metavar="DIR|GLOB", help="instead of a campaign: logs, each through the daemon's core")
    p.add_argument("--train", metavar="PATTERN", help="of --logs: expression of a path with a group `train`")
    p.add_argument("--config", type=Path, metavar="FILE", help="of --logs: where no wrcd.toml lies beside or above one")
    p.add_argument("--channel", metavar="NAME", help="of --logs: of those that have several")
    p.add_argument("--from-km", type=Path, metavar="CSV", help="of --logs: log,from_km,direction of each, for low rail")
    p.add_argument("--limit", type=float, metavar="S", help="of --logs: one that takes longer is ended (default: 3600)")


def _run(args: argparse.Namespace) -> int:
    if (args.campaign is None) == (args.logs is None):
        reason = "is missing" if args.campaign is None else "and --logs are two questions"
        raise InputError(reason, key="CAMPAIGN.toml", hint="name a campaign, or logs: --logs DIR")
    if args.logs is None and (other := next((name for name in OF_LOGS if getattr(args, name) is not None), None)):
        raise InputError(
            "is of --logs", key=f"--{other.replace('_', '-')}", hint="a campaign says all of it in its file"
        )
    if args.out is None and not args.dry_run:
        raise InputError("is missing", key="-o", hint="name the folder for the results; --dry-run needs none")
    check_least(args, jobs=1, limit=1)
    from sim_ecu.campaign import logs, run_campaign
    from sim_ecu.jobs.pool import LIMIT_S

    how = (args.out, args.jobs, args.scheduler, args.again)
    if args.logs is None:
        return run_campaign.plan(args.campaign) if args.dry_run else run_campaign.run(args.campaign, *how)
    asked = logs.Logs(args.logs, args.train, args.config, args.channel or "", args.limit or LIMIT_S, args.from_km)
    return logs.plan(asked) if args.dry_run else logs.run(asked, *how)


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
