"""Arguments that several commands share, everywhere the same."""

import argparse
import math
from pathlib import Path

from wrcd.errors import InputError

MIN_BIT_RATE, MAX_BIT_RATE = 10_000, 1_000_000


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
