"""`sim-ecu list`."""

import argparse

from wrcd.tools.command import Command, no_arguments


def _run(_args: argparse.Namespace) -> int:
    from sim_ecu.play.scenario import load_scenario, packaged

    for name in packaged():
        s = load_scenario(name)
        print(f"{name:14} {s.duration_s:4.0f} s, {len(s.axles)} axle{'s' * (len(s.axles) > 1)}: {s.title}")
    return 0


COMMAND = Command(
    "list",
    "the packaged scenarios",
    (
        ("sim-ecu list", "name, length, axles and title of each"),
        ("sim-ecu list | grep axle-box", "one of them"),
    ),
    no_arguments,
    _run,
)
