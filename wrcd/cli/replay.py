"""`wrcd replay`."""

import argparse
from pathlib import Path

from wrcd.cli.arguments import add_axle, add_config, add_design, add_state, seconds
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    add_config(p)
    add_design(p, "the configuration's")
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
        "folder of them; the word None is a Confidence, which pandas keeps with keep_default_na=False",
    )
    p.add_argument(
        "--from", dest="begin", type=seconds, metavar="S",
        help="write what comes from then on: seconds since 1970, or of the log with --relative",
    )  # fmt: skip
    p.add_argument("--to", dest="end", type=seconds, metavar="S", help="… and what comes before then")
    p.add_argument("--relative", action="store_true", help="times, in rows too, are seconds from the log's first frame")
    add_axle(p, "write ")
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
    add_state(p)
    p.add_argument("--jobs", type=int, default=1, metavar="N", help="of several logs, so many at once (default: 1)")


def _run(args: argparse.Namespace) -> int:
    from wrcd.config.packaged_designs import design_path
    from wrcd.logs.feed import Selection
    from wrcd.logs.replay import ReplayInputs, replay, replays
    from wrcd.logs.replay_outputs import Outputs

    selection = Selection(args.begin, args.end, args.relative, tuple(args.axle), args.channel)
    outputs = Outputs(args.output, args.csv, args.events, args.mf4, args.mcap)
    inputs = ReplayInputs(args.config, None if args.design is None else design_path(args.design), args.state)
    if len(args.logs) == 1:
        status = replay(args.logs[0], inputs, outputs, explained=args.explain, selection=selection)
    else:
        status = replays(args.logs, inputs, outputs, explained=args.explain, jobs=args.jobs, selection=selection)
    return status


COMMAND = Subcommand(
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
