"""`wrcd monitor`: from its arguments to the screen."""

import argparse
import os
import sys
from pathlib import Path

from wrcd.cli.arguments import add_bit_rate, add_bus, add_dbc, check_bit_rate, databases_of
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError, need


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("log", nargs="?", type=Path, metavar="LOG", help="a log instead of a bus")
    add_bus(p)
    p.add_argument("--config", type=Path, metavar="FILE", help="configuration whose messages are shown")
    add_dbc(p, ", for another rig's truth (SimTruth_A1 …)")
    add_bit_rate(p)


def _run(args: argparse.Namespace) -> int:
    check_bit_rate(args.bit_rate)
    if args.log is not None and args.interface is not None:
        raise InputError("a log or a bus, not both", key="--interface", hint="leave out LOG or -i")
    need(("textual",), "monitor", "monitor")
    # Textual draws on standard error: in a file the screen would be empty
    if not all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr)):
        raise InputError(
            "needs a terminal to draw on, for standard error too",
            key="monitor",
            hint="over SSH ssh -t; for a pipe there is wrcd dump",
        )
    from wrcd.config.config import load_config
    from wrcd.logs.bus_of import bus_of
    from wrcd.logs.statistics import BIT_RATE
    from wrcd.monitor.bus_model import BusModel
    from wrcd.monitor.sources import FrameSource, NoMore, ReaderProcess, model_of_log, open_source

    config = load_config(args.config)
    databases = databases_of(args, config)
    rate = args.bit_rate or BIT_RATE
    note = ""
    if args.log is not None:
        model, warnings = model_of_log(args.log, config, databases, args.channel, rate)
        source: FrameSource = NoMore(args.log.name)
        note = "; ".join(warnings)
    else:
        # the bus opens while the screen's packages are imported
        source = open_source(config, *bus_of(args, config))
        model = BusModel(config, databases, bit_rate=rate)
    try:
        from wrcd.monitor.screen import Monitor

        if isinstance(source, ReaderProcess):
            source.wait_open()
        for size in ("COLUMNS", "LINES"):  # what a shell exports is how it was; Textual would ask no terminal
            os.environ.pop(size, None)
        app = Monitor(model, source, note=note)
        app.run()
    finally:
        source.close()
    return app.return_code or 0


COMMAND = Subcommand(
    "monitor",
    "show on a terminal what a daemon says, live or of a log; it sends nothing",
    (
        ("wrcd monitor -i socketcan -c vcan0", "a bus; the rig's truth, if it is there, beside the estimate"),
        ("wrcd monitor ride.log", "a log, with the cursor where the adhesion first fell; w tells why"),
    ),
    _add,
    _run,
)
