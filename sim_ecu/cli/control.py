"""`sim-ecu control`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import DEFAULT_BUS, add_bus
from wrcd.cli.program import Subcommand

NAMES = ("none", "thresholds", "creep")
SANDING = ("at-slide", "below-speed", "when-low", "at-place")


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("controller", choices=NAMES, help="none: the driver gets what the driver asks for")
    add_bus(p)
    p.add_argument("--with-adhesion", action="store_true", help="limit what is demanded by what the daemon says")
    p.add_argument(
        "--share-effort", action="store_true",
        help="brake less where an axle's adhesion does not carry the demand, and more where another's does; with "
        "--with-adhesion",
    )  # fmt: skip
    p.add_argument(
        "--sand", choices=SANDING, metavar="POLICY",
        help="ask the scenario's sanders for sand. at-slide: while any axle slides; below-speed: the same, but none "
        "below 15 m/s; when-low: before it slides, where the daemon's adhesion is less than the brake needs; at-place: "
        "where the leading axle has found it so",
    )  # fmt: skip
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
    from sim_ecu.loop.control.sanding_policies import POLICIES, make_sanding
    from sim_ecu.loop.control.slip_controller import SlipController, make_controller
    from sim_ecu.loop.drive_scenario import load_drive_scenario
    from sim_ecu.loop.rig_messages import rig_message
    from wrcd.config.config import DEFAULT_AXLES, load_config, load_packaged
    from wrcd.errors import InputError
    from wrcd.logs.bus_of import pick_bus

    if args.seconds is not None and not args.seconds > 0.0:
        raise InputError(f"takes seconds above 0, not {args.seconds:g}", key="--for")
    sands_by_adhesion = args.sand is not None and POLICIES[args.sand].needs_adhesion
    if args.config is not None and not (args.with_adhesion or sands_by_adhesion):
        raise InputError("is for --with-adhesion, and for sanding by adhesion", key="--config")
    if args.with_adhesion and args.controller == "none":
        raise InputError("is nothing for a controller that gives the driver all", key="--with-adhesion")
    if args.share_effort and not args.with_adhesion:
        raise InputError("needs --with-adhesion: axles share by what the daemon says", key="--share-effort")
    if args.sand is not None and args.controller == "none":
        raise InputError("is nothing for a controller that gives the driver all", key="--sand")
    facts = Facts.of(load_drive_scenario(args.scenario))
    watches: list[Watch] = [InputWatch(facts.axles)]
    config = None
    if args.with_adhesion or sands_by_adhesion:
        from sim_ecu.loop.control.control_on_bus import AdhesionWatch

        packaged = args.config is None
        config = load_packaged(max(DEFAULT_AXLES, *facts.axles)) if packaged else load_config(args.config)
        watches.append(AdhesionWatch(config, facts.axles))
    bus = pick_bus(args.interface, args.channel, None, DEFAULT_BUS)
    paced_by = rig_message(f"WheelSpeed_A{facts.axles[-1]}").frame_id
    sanding = None if args.sand is None else make_sanding(args.sand, facts, config)
    controller = make_controller(
        args.controller, facts, config if args.with_adhesion else None, sanding, args.share_effort
    )
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
            "sim-ecu control creep --with-adhesion -c vcan0 --scenario four-axle-stop",
            "creep control of four axles, limited by what the daemon says",
        ),
    ),
    _add,
    _run,
    own_signals=lambda _: True,
)
