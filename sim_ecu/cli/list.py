"""`sim-ecu list`."""

import argparse
from typing import TYPE_CHECKING

from wrcd.cli.program import Subcommand, no_arguments

if TYPE_CHECKING:
    from sim_ecu.play.scenario import Scenario


def _run(_args: argparse.Namespace) -> int:
    from sim_ecu.loop.drive_scenario import load_drive_scenario
    from sim_ecu.play.scenario import TO_DRIVE, load_scenario, packaged
    from sim_ecu.play.vehicles import packaged_vehicles

    def show(s: "Scenario", more: str = "") -> None:
        axles = f"{len(s.axles)} axle{'s' * (len(s.axles) > 1)}"
        print(f"{s.name:19} {s.duration_s:4.0f} s, {axles}{more}: {s.title}")

    for name in packaged():
        show(load_scenario(name))
    for name in packaged(TO_DRIVE):
        show(load_drive_scenario(name).train, ", to drive")
    print(f"vehicles: {', '.join(packaged_vehicles())}")
    return 0


COMMAND = Subcommand(
    "list",
    "the packaged scenarios and vehicles",
    (
        ("sim-ecu list", "name, length, axles and title of each"),
        ("sim-ecu list | grep axle-box", "one of them"),
    ),
    no_arguments,
    _run,
)
