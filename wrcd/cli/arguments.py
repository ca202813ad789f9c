"""Arguments that several commands share, everywhere the same, and what they stand for."""

import argparse
import math
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from wrcd.errors import InputError
from wrcd.resources import DEFAULT_DESIGN

if TYPE_CHECKING:
    from wrcd.bus.dbc import Database
    from wrcd.core.configuration import Config
    from wrcd.logs.story_records import Story

MIN_BIT_RATE, MAX_BIT_RATE = 10_000, 1_000_000


def add_config(p: argparse.ArgumentParser) -> None:
    """--config, which every command that needs a configuration takes."""
    p.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration (TOML); default: the packaged DBC, four axles"
    )


def add_design(p: argparse.ArgumentParser, default: str = DEFAULT_DESIGN) -> None:
    """--design; default: in words, what holds without it. design_path() gives the file."""
    p.add_argument("--design", metavar="DESIGN", help=f"a packaged design by its name, or a file (default: {default})")


def add_bus(p: argparse.ArgumentParser) -> None:
    """-i and -c of a tool, python-can's own words: what they leave out, bus_of finds."""
    settings = "the configuration's, python-can's settings"
    p.add_argument("-i", "--interface", help=f"python-can interface (default: {settings}, socketcan)")
    p.add_argument("-c", "--channel", help=f"its channel (default: {settings}, can0)")


def add_bus_of_the_daemon(p: argparse.ArgumentParser) -> None:
    """-i and -c of the daemon, which takes nothing from python-can's settings."""
    p.add_argument("-i", "--interface", help="python-can interface (default: the configuration's, socketcan)")
    p.add_argument("-c", "--channel", help="its channel (default: the configuration's, can0)")


def add_bit_rate(p: argparse.ArgumentParser) -> None:
    """--bit-rate of a tool that tells the bus load."""
    p.add_argument("--bit-rate", type=int, metavar="BIT/S", help="of the bus, for its load (default: 500000)")


def check_bit_rate(rate: int | None) -> None:
    """Raises InputError for one that no bus has."""
    if rate is not None and not MIN_BIT_RATE <= rate <= MAX_BIT_RATE:
        raise InputError(f"takes {MIN_BIT_RATE} to {MAX_BIT_RATE} bit/s, not {rate}", key="--bit-rate")


def seconds(text: str) -> float:
    """A finite number, for argparse."""
    number = float(text)
    if not math.isfinite(number):
        raise ValueError
    return number


def add_dbc(p: argparse.ArgumentParser, what: str) -> None:
    """--dbc, which may be repeated."""
    p.add_argument(
        "--dbc", type=Path, action="append", default=[], metavar="FILE", help=f"another DBC{what}; may be repeated"
    )


def databases_of(args: argparse.Namespace, config: "Config") -> "list[Database]":
    """The DBCs of --dbc, and behind them the rig's, where it is installed and the messages are the packaged ones."""
    from importlib.util import find_spec

    from wrcd.bus.dbc import load_dbc
    from wrcd.resources import DBC

    found = find_spec("sim_ecu") if config.dbc_file == DBC else None
    rig = [Path(folder, "data", "sim_ecu.dbc") for folder in (found and found.submodule_search_locations) or ()]
    return [load_dbc(file) for file in (*args.dbc, *(file for file in rig if file.exists()))]


def add_axle(p: argparse.ArgumentParser, verb: str = "") -> None:
    """--axle, which may be repeated."""
    p.add_argument(
        "--axle", type=int, action="append", default=[], metavar="N", help=f"{verb}this axle only; may be repeated"
    )


def add_log(p: argparse.ArgumentParser, *, replay: bool = True) -> None:
    """LOG, --config, --dbc, --channel and --replay."""
    p.add_argument("log", type=Path, metavar="LOG", help="candump log, or any that python-can reads")
    add_config(p)
    add_dbc(p, ", for names and for another rig's truth (SimTruth_A1 …)")
    p.add_argument("--channel", metavar="CH", help="read this channel only; of a log of several one must be named")
    if replay:
        p.add_argument(
            "--replay", action="store_true",
            help="estimate over the log, though it has wrcd's own frames (without them it always is)",
        )  # fmt: skip
        add_state(p)


def add_state(p: argparse.ArgumentParser) -> None:
    """--state of whatever estimates over a log."""
    p.add_argument(
        "--state",
        type=Path,
        metavar="FILE",
        help="estimate, and begin with what slides had revealed: NAME.state.json of a dump",
    )


def read_story(args: Namespace, config: "Config | None" = None) -> "Story":
    """The story of a command's log. Says on standard error what is odd in it."""
    import sys

    from wrcd.config.config import load_config
    from wrcd.logs.statistics import BIT_RATE
    from wrcd.logs.story import gather

    config = config or load_config(args.config)
    story = gather(
        args.log, config, databases_of(args, config), replay=args.replay, channel=args.channel,
        bit_rate=getattr(args, "bit_rate", None) or BIT_RATE, state=getattr(args, "state", None),
    )  # fmt: skip
    for warning in story.warnings:
        print(f"wrcd: warning: {warning}", file=sys.stderr)
    return story
