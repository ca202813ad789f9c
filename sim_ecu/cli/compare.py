"""`sim-ecu compare`."""

import argparse
from dataclasses import asdict
from pathlib import Path

from wrcd.cli.program import Subcommand
from wrcd.errors import InputError, Status

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
    """Compare and print; write all of it as JSON and a page where requested."""
    from sim_ecu.campaign.campaign_folder import read_results
    from sim_ecu.campaign.comparison.compare import WORSE, compare, document
    from sim_ecu.campaign.comparison.shown import page, tables
    from sim_ecu.campaign.comparison.worst import worst
    from sim_ecu.reporting.result_files import check_output, write_results
    from wrcd.progress import Progress

    if not 0 < args.alpha < 1:
        raise InputError(f"takes a number between 0 and 1, not {args.alpha:g}", key="--alpha")
    names = None if args.figures is None else [n for n in args.figures.split(",") if n]
    if names == []:
        raise InputError("names no figure", key="--figures", hint="leave it out for all")
    check_output("--json", args.json)
    check_output("--html", args.html)
    progress = Progress()
    result = compare(read_results(args.first), read_results(args.second), names, args.alpha, progress.at)
    progress.end()
    ways = worst(result)
    print("\n".join(tables(result, ways)))
    jobs = {"worst_of_second": [asdict(w) for w in ways[0]], "worst_of_first": [asdict(w) for w in ways[1]]}
    write_results(document(result) | jobs, args.json, args.html, lambda: page(result, ways))
    if args.fail_on and not result.judged and result.unjudged:
        raise InputError(
            "no comparison could be judged, for too few worlds",
            key="--fail-on",
            hint="run both campaigns with more seeds or lots, or choose fewer --figures",
        )
    found = [c for c in result.claims if args.fail_on == "any" or c.verdict == WORSE]
    return Status.STOPPED if args.fail_on and found else Status.DONE


COMMAND = Subcommand(
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
