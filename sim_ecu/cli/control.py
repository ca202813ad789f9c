"""`sim-ecu control`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import DEFAULT_BUS, add_bus
from wrcd.cli.program import Subcommand

NAMES = ("none", "thresholds")


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("controller", choices=NAMES, help="none: the driver gets what the driver asks for")
    add_bus(p)
    p.add_argument("--with-adhesion", action="store_true", help="limit what is demanded by what the daemon says")
    p.add_argument(
        "--config", type=Path, metavar="FILE", help="the daemon's configuration, which names its adhesion messages"
    )
    p.add_argument(
        "--scenario", default="emergency-greasy", metavar="SCENARIO",
        help="a scenario to drive, for the facts of its train: axles, masses, actuators (default: emergency-greasy)",
    )  # fmt: skip
    p.add_argument("--for", dest="seconds", type=float, metavar="S", help="end after so many seconds")


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.loop.control.adhesion_consumer import Facts
    from sim_ecu.loop.control.control_on_bus import InputWatch, ProtectionWatch, Watch, control_on_bus
    from sim_ecu.loop.control.slip_controller import SlipController, make_controller
    from sim_ecu.loop.drive_scenario import load_drive_scenario
    from sim_ecu.loop.rig_messages import rig_message
    from wrcd.config.config import DEFAULT_AXLES, load_config, load_packaged
    from wrcd.errors import InputError
    from wrcd.logs.bus_of import pick_bus

    if args.seconds is not None and not args.seconds > 0.0:
        raise InputError(f"takes seconds above 0, not {args.seconds:g}", key="--for")
    if args.config is not None and not args.with_adhesion:
        raise InputError("is for --with-adhesion", key="--config")
    if args.with_adhesion and args.controller == "none":
        raise InputError("is nothing for a controller that gives the driver all", key="--with-adhesion")
    facts = Facts.of(load_drive_scenario(args.scenario))
    watches: list[Watch] = [InputWatch(facts.axles)]
    config = None
    if args.with_adhesion:
        from sim_ecu.loop.control.control_on_bus import AdhesionWatch

        packaged = args.config is None
        config = load_packaged(max(DEFAULT_AXLES, *facts.axles)) if packaged else load_config(args.config)
        watches.append(AdhesionWatch(config, facts.axles))
    bus = pick_bus(args.interface, args.channel, None, DEFAULT_BUS)
    paced_by = rig_message(f"WheelSpeed_A{facts.axles[-1]}").frame_id
    controller = make_controller(args.controller, facts, config)
    if isinstance(controller, SlipController):
        watches.append(ProtectionWatch(controller))
    print("\n".join(control_on_bus(controller, watches, *bus, args.seconds, paced_by)))
    return 0


COMMAND = Subcommand(
    "control",
    "a reference controller of wheel slide and traction on a bus",
    (
        ("sim-ecu control thresholds -c vcan0", "slip thresholds, until SIGTERM or Ctrl-C"),
        (
            "sim-ecu control thresholds --with-adhesion -c vcan0 --scenario four-axle-stop",
            "four axles, limited by what the daemon says",
        ),
    ),
    _add,
    _run,
    own_signals=lambda _: True,
)
