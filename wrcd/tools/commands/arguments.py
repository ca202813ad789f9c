"""Arguments that several commands share, everywhere the same."""

import argparse
import math
from pathlib import Path


def add_config(p: argparse.ArgumentParser) -> None:
    """--config, which every command that needs a configuration takes."""
    p.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration (TOML); default: the packaged DBC, four axles"
    )


def add_bus(p: argparse.ArgumentParser) -> None:
    """-i and -c of a tool, python-can's own words: what they leave out, bus_of finds."""
    settings = "the configuration's, python-can's settings"
    p.add_argument("-i", "--interface", help=f"python-can interface (default: {settings}, socketcan)")
    p.add_argument("-c", "--channel", help=f"its channel (default: {settings}, can0)")


def add_bus_of_the_daemon(p: argparse.ArgumentParser) -> None:
    """-i and -c of the daemon, which takes nothing from python-can's settings."""
    p.add_argument("-i", "--interface", help="python-can interface (default: the configuration's, socketcan)")
    p.add_argument("-c", "--channel", help="its channel (default: the configuration's, can0)")


def seconds(text: str) -> float:
    """A finite number, for argparse."""
    number = float(text)
    if not math.isfinite(number):
        raise ValueError
    return number
