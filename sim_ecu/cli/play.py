"""`sim-ecu play`, and what `sim-ecu inject` has of it: the arguments, and the playing."""

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from sim_ecu.cli.arguments import DEFAULT_BUS, add_bus
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError

if TYPE_CHECKING:
    from sim_ecu.play.scenario import Scenario


def add_player(p: argparse.ArgumentParser) -> None:
    """Add the options of where the frames go, and what they are."""
    add_bus(p, ", or slcan: an interface of our own making (needs root)")
    p.add_argument("--log", type=Path, metavar="OUT.log", help="write the frames to a log (the suffix is its format)")
    p.add_argument("--fast", action="store_true", help="no bus: as fast as it computes, into --log")
    p.add_argument(
        "--config", type=Path, metavar="FILE",
        help="speak the train's own DBC: send what this configuration of the daemon maps (default: the packaged DBC)",
    )  # fmt: skip
    p.add_argument("--no-truth", action="store_true", help="leave the SimTruth frames out")
    p.add_argument(
        "--ahead", action="store_true", help="make all frames before the first is sent: a slow computer keeps time"
    )


def played(scenario: "Scenario", args: argparse.Namespace) -> int:
    """Play onto a bus or into a log. Returns the exit status."""
    from sim_ecu.play.mapped import Train
    from sim_ecu.play.play import play_on_bus, play_to_log
    from sim_ecu.play.train import PACKAGED

    train: Train = PACKAGED
    if args.config is not None:
        from sim_ecu.play.mapped import MappedTrain
        from wrcd.config.config import load_config

        train = MappedTrain(load_config(args.config), scenario.wheelset)
    if args.fast:
        if args.log is None:
            raise InputError("--fast needs --log OUT.log to write to")
        began = time.monotonic()
        tally = play_to_log(scenario, args.log, not args.no_truth, train)
        ratio = scenario.duration_s / (time.monotonic() - began)
        print(
            f"sim-ecu: {args.log}: {tally.frames} frames, {scenario.duration_s:g} s at {ratio:.0f} x real time",
            file=sys.stderr,
        )
    else:
        from wrcd.logs.bus_of import pick_bus

        bus = pick_bus(args.interface, args.channel, None, DEFAULT_BUS)
        tally = play_on_bus(scenario, *bus, args.log, not args.no_truth, args.ahead, train)
        print(f"sim-ecu: {tally.text()}", file=sys.stderr)
        if tally.too_slow:
            print(f"sim-ecu: {tally.too_slow}; --ahead makes all frames before the first is sent", file=sys.stderr)
    return 0


def _add(p: argparse.ArgumentParser) -> None:
    add_player(p)
    p.add_argument("scenario", metavar="SCENARIO", help="name of a packaged scenario, or a .toml file")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.play.scenario import load_scenario

    return played(load_scenario(args.scenario), args)


COMMAND = Subcommand(
    "play",
    "play a scenario onto a bus, or into a log",
    (
        ("sim-ecu play leaf-patch -c vcan0", "in real time onto vcan0"),
        ("sim-ecu play leaf-patch --fast --log ride.log", "the same into a log, in about a second"),
    ),
    _add,
    _run,
    own_signals=lambda args: not args.fast,
)
