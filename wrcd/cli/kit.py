"""`wrcd kit`."""

import argparse
from pathlib import Path

from wrcd.cli.arguments import add_config
from wrcd.cli.program import Subcommand


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="the folder to write it to")
    add_config(p)
    p.add_argument(
        "--core",
        action="store_true",
        help="write the core in C instead, with the configuration's tables, to run on an ECU",
    )
    p.add_argument("--force", action="store_true", help="overwrite files that are no kit's, or were edited")


def _run(args: argparse.Namespace) -> int:
    from wrcd.kit.write_kit import core_kit, kit

    return (core_kit if args.core else kit)(args.output, args.config, args.force)


COMMAND = Subcommand(
    "kit",
    "a receiver in C of the Adhesion frames, or wrcd's core in C, with their tests",
    (
        ("wrcd kit --config train.toml -o receiver", "of a train's own DBC; make -C receiver tests it"),
        ("wrcd kit --core -o core", "CAN frames in, adhesion frames out: to run on an ECU"),
    ),
    _add,
    _run,
)
