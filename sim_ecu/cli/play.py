"""`sim-ecu play`."""

import argparse
import sys
import time
from pathlib import Path

from sim_ecu.cli.arguments import DEFAULT_BUS, add_bus
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError


def _add(p: argparse.ArgumentParser) -> None:
    add_bus(p)
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
    p.add_argument(
        "--fault", action="append", default=[], metavar="SPEC",
        help="KIND:at=S,for=S,of=SIGNAL,axle=N,amount=X, e.g. crc:at=3,for=0.5,of=yaw_rate,axle=1; may be repeated; "
        "`sim-ecu list` has the kinds",
    )  # fmt: skip
    p.add_argument("scenario", metavar="SCENARIO", help="name of a packaged scenario, or a .toml file")


def _run(args: argparse.Namespace) -> int:
    from dataclasses import replace

    from sim_ecu.play.faults import parse_fault
    from sim_ecu.play.mapped import Train
    from sim_ecu.play.play import play_on_bus, play_to_log
    from sim_ecu.play.scenario import load_scenario
    from sim_ecu.play.train import PACKAGED

    scenario = load_scenario(args.scenario)
    numbers = [a.number for a in scenario.axles]
    given = [parse_fault(spec, numbers, scenario.duration_s) for spec in args.fault]
    scenario = replace(scenario, faults=(*scenario.faults, *given))
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


COMMAND = Subcommand(
    "play",
    "play a scenario onto a bus, or into a log",
    (
        ("sim-ecu play leaf-patch -c vcan0", "in real time onto vcan0"),
        (
            "sim-ecu play dry --fault crc:at=3,for=0.5,axle=1 --fast --log ride.log",
            "into a log, in about a second, with wrong check sums for half a second",
        ),
    ),
    _add,
    _run,
    own_signals=lambda args: not args.fast,
)
