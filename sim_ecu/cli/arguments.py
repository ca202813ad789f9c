"""Arguments that several commands of the rig share, everywhere the same."""

import argparse
import os

from wrcd.errors import InputError

DEFAULT_BUS = ("socketcan", "vcan0")  # where no --config names another


def add_bus(p: argparse.ArgumentParser, more: str = "") -> None:
    """-i and -c. more: interfaces that python-can does not have."""
    p.add_argument("-i", "--interface", help=f"python-can interface (default: python-can's settings, socketcan){more}")
    p.add_argument("-c", "--channel", help="its channel (default: python-can's settings, vcan0)")


def add_jobs(p: argparse._ActionsContainer) -> None:
    """--jobs."""
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)")


def check_least(args: argparse.Namespace, **least: int) -> None:
    """Raise InputError for an option, by its name, that is below what it takes at least; None is left out."""
    for name, bound in least.items():
        value = getattr(args, name)
        if value is not None and value < bound:
            raise InputError(f"takes a whole number from {bound} on, not {value}", key=f"--{name}")
