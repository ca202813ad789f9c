"""`wrcd replay`."""

import argparse
from pathlib import Path

from wrcd.tools.command import Command
from wrcd.tools.commands.arguments import add_config, seconds


def _add(p: argparse.ArgumentParser) -> None:
    add_config(p)
    p.add_argument(
        "logs", type=Path, metavar="LOG", nargs="+", help="candump log, or any that python-can reads; one or several"
    )
    p.add_argument(
        "-o", "--output", type=Path, metavar="OUT.log",
        help="write the frames sent as a candump log; of several logs a folder of them",
    )  # fmt: skip
    p.add_argument(
        "--csv",
        type=Path,
        metavar="OUT.csv",
        help="write one row per Adhesion frame (default, without -o and --events: to the screen); of several logs a "
        "folder of them",
    )
    p.add_argument(
        "--from", dest="begin", type=seconds, metavar="S",
        help="write what comes from then on: seconds since 1970, or of the log with --relative",
    )  # fmt: skip
    p.add_argument("--to", dest="end", type=seconds, metavar="S", help="… and what comes before then")
    p.add_argument("--relative", action="store_true", help="times, in rows too, are seconds from the log's first frame")
    p.add_argument(
        "--axle", type=int, action="append", default=[], metavar="N", help="write this axle only; may be repeated"
    )
    p.add_argument("--channel", metavar="CH", help="read this channel only; of a log of several one must be named")
    p.add_argument(
        "--events", type=Path, metavar="OUT.csv",
        help="write one row per change of an axle's Validity, with its cause, input and figures (-: to the screen); of "
        "several logs a folder of them",
    )  # fmt: skip
    p.add_argument(
        "--mf4", type=Path, metavar="OUT.mf4",
        help="write signals as ASAM MDF 4: what is sent, the inputs, the changes of Validity; needs the extra mf4; of "
        "several logs a folder of them",
    )  # fmt: skip
    p.add_argument(
        "--mcap", type=Path, metavar="OUT.mcap", help="write the same as MCAP, JSON inside; needs the extra mcap"
    )
    p.add_argument(
        "--explain", action="store_true", help="rows also name the winning model and the dominant rule of the moment"
    )
    p.add_argument("--jobs", type=int, default=1, metavar="N", help="of several logs, so many at once (default: 1)")


def _run(args: argparse.Namespace) -> int:
    from wrcd.tools.replay import replay
    from wrcd.tools.replays import replays
    from wrcd.tools.selection import Selection

    selection = Selection(args.begin, args.end, args.relative, tuple(args.axle), args.channel)
    if len(args.logs) == 1:
        return replay(
            args.logs[0], args.config, args.output, args.csv, args.explain, args.events, selection=selection,
            mf4=args.mf4, mcap=args.mcap,
        )  # fmt: skip
    return replays(
        args.logs, args.config, args.output, args.csv, args.explain, args.jobs, args.events, selection=selection,
        mf4=args.mf4, mcap=args.mcap,
    )  # fmt: skip


COMMAND = Command(
    "replay",
    "estimate over a log, byte for byte as on the bus",
    (
        (
            "wrcd replay ride.log --csv adhesion.csv --relative",
            "a row per Adhesion frame, seconds from the log's begin",
        ),
        ("wrcd replay ride.log --events -", "every change of Validity with its cause, on the screen"),
    ),
    _add,
    _run,
    retried=False,
)
