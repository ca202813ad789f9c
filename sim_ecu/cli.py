"""The sim-ecu command."""

import argparse
from collections.abc import Sequence

from sim_ecu.commands import (
    campaign_command,
    compare_command,
    contact_command,
    control_command,
    demo_command,
    design_command,
    drive_command,
    faults_command,
    figures_command,
    fmu_command,
    inject_command,
    list_command,
    loop_command,
    play_command,
    score_command,
    tune_command,
    verify_command,
)
from sim_ecu.commands.extra import explained
from wrcd.tools.command import Command
from wrcd.tools.completion import completion_of
from wrcd.tools.guard import guarded
from wrcd.tools.parser import make_parser

# in the order of the help
COMMANDS: tuple[Command, ...] = (
    list_command.COMMAND,
    play_command.COMMAND,
    inject_command.COMMAND,
    drive_command.COMMAND,
    control_command.COMMAND,
    faults_command.COMMAND,
    design_command.COMMAND,
    contact_command.COMMAND,
    tune_command.COMMAND,
    score_command.COMMAND,
    figures_command.COMMAND,
    loop_command.COMMAND,
    campaign_command.COMMAND,
    compare_command.COMMAND,
    fmu_command.COMMAND,
    verify_command.COMMAND,
    demo_command.COMMAND,
    completion_of("sim-ecu"),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit status: see Status."""
    args = _parser().parse_args(argv)
    command = next(c for c in COMMANDS if c.name == args.command)
    own_signals = command.own_signals(args)
    return guarded(
        "sim-ecu", lambda: explained(lambda: command.run(args)), retried=command.retried, own_signals=own_signals
    )


def _parser(commands: Sequence[Command] = COMMANDS) -> argparse.ArgumentParser:
    return make_parser("sim-ecu", "The rig: nonlinear wheelsets on a CAN bus.", commands)
