"""`sim-ecu compare`."""

import argparse
from pathlib import Path

from wrcd.tools.command import Command

FAIL_ON = ("worse", "any")


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("first", type=Path, metavar="DIR", help="a campaign's folder: what is compared with")
    p.add_argument("second", type=Path, metavar="DIR", help="another one of the same kind: what the verdicts are of")
    p.add_argument("--figures", metavar="A,B", help="only these; fewer comparisons are corrected for less")
    p.add_argument(
        "--alpha", type=float, default=0.05, metavar="P",
        help="chance of any false claim where nothing differs (default: 0.05)",
    )  # fmt: skip
    p.add_argument("--fail-on", choices=FAIL_ON, help="exit 1 where a figure is worse, or differs in any way")
    p.add_argument("--json", type=Path, metavar="OUT", help="all figures, and the worst jobs as CAMPAIGN.toml")
    p.add_argument("--html", type=Path, metavar="OUT", help="a page with tables and pictures")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.commands.run_compare import run
    from wrcd.errors import InputError

    if not 0 < args.alpha < 1:
        raise InputError(f"takes a number between 0 and 1, not {args.alpha:g}", key="--alpha")
    names = None if args.figures is None else [n for n in args.figures.split(",") if n]
    if names == []:
        raise InputError("names no figure", key="--figures", hint="leave it out for all")
    return run(args.first, args.second, names, args.alpha, args.fail_on, args.json, args.html)


COMMAND = Command(
    "compare",
    "what differs between two campaigns, and is it more than chance",
    (
        ("sim-ecu compare before after --html compare.html", "every figure of every suite, as a page"),
        ("sim-ecu compare before after --figures slides,stop_m --fail-on worse", "two of them; exit 1 if one is worse"),
    ),
    _add,
    _run,
    retried=False,
)
