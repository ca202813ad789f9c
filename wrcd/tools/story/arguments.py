"""What the commands on a log have in common: which log, and how it is read."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from wrcd.tools.commands.arguments import add_config

if TYPE_CHECKING:
    from wrcd.core.configuration import Config
    from wrcd.tools.story.records import Story


def add_log(p: ArgumentParser, *, replay: bool = True) -> None:
    """LOG, --config, --dbc, --channel and --replay."""
    p.add_argument("log", type=Path, metavar="LOG", help="candump log, or any that python-can reads")
    add_config(p)
    p.add_argument(
        "--dbc", type=Path, action="append", default=[], metavar="FILE",
        help="another DBC, for names and for a rig's truth (SimTruth_A1 …); may be repeated",
    )  # fmt: skip
    p.add_argument("--channel", metavar="CH", help="read this channel only; of a log of several one must be named")
    if replay:
        p.add_argument(
            "--replay", action="store_true",
            help="estimate over the log, though it has wrcd's own frames (without them it always is)",
        )  # fmt: skip


def read_story(args: Namespace, config: "Config | None" = None) -> "Story":
    """The story of a command's log. Says on standard error what is odd in it."""
    import sys

    from wrcd.config import load_config
    from wrcd.tools.bus_load import BIT_RATE
    from wrcd.tools.story.gather import gather
    from wrcd.tools.story.truth import load

    config = config or load_config(args.config)
    story = gather(
        args.log, config, load(args.dbc), replay=args.replay, channel=args.channel,
        bit_rate=getattr(args, "bit_rate", None) or BIT_RATE,
    )  # fmt: skip
    for warning in story.warnings:
        print(f"wrcd: warning: {warning}", file=sys.stderr)
    return story
