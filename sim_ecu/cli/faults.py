"""`sim-ecu faults`."""

import argparse

from wrcd.cli.program import Subcommand, no_arguments


def _run(_args: argparse.Namespace) -> int:
    from sim_ecu.play.matrix import run

    return run()


COMMAND = Subcommand(
    "faults",
    "the daemon's core under every kind of fault: what it must do, and what it did",
    (
        ("sim-ecu faults", "a Markdown table, a row a fault; minutes"),
        ("sim-ecu faults > faults.md", "the same into a file; how far it is stands on standard error"),
    ),
    no_arguments,
    _run,
)
