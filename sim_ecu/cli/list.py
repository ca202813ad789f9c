"""`sim-ecu list`."""

import argparse
from typing import TYPE_CHECKING

from wrcd.cli.program import Subcommand, no_arguments

if TYPE_CHECKING:
    from sim_ecu.play.scenario import Scenario

FASTEST_M_S, SCAN_M_S = 200.0, 5.0  # hunting of each packaged vehicle, once begun, goes on at every higher speed


def _run(_args: argparse.Namespace) -> int:
    import math

    from sim_ecu.loop.drive_scenario import load_drive_scenario
    from sim_ecu.physics.contact import CURVES
    from sim_ecu.physics.stability import hunting_speed_m_s
    from sim_ecu.play.faults import described
    from sim_ecu.play.scenario import TO_DRIVE, load_scenario, packaged
    from sim_ecu.play.vehicles import load_vehicle, packaged_vehicles, vehicle_title

    def show(s: "Scenario", more: str = "") -> None:
        axles = f"{len(s.axles)} axle{'s' * (len(s.axles) > 1)}"
        print(f"{s.name:19} {s.duration_s:4.0f} s, {axles}{more}: {s.title}")

    for name in packaged():
        show(load_scenario(name))
    for name in packaged(TO_DRIVE):
        show(load_drive_scenario(name).train, ", to drive")
    for name in packaged_vehicles():
        hunts = hunting_speed_m_s(load_vehicle(name), CURVES["A"], FASTEST_M_S, SCAN_M_S)
        hunting = f"none below {FASTEST_M_S:g} m/s" if math.isinf(hunts) else f"from {hunts:.1f} m/s"
        print(f"{name:19} vehicle, hunting on dry rail {hunting}: {vehicle_title(name)}")
    for name, what in described():
        print(f"{name:19} fault: {what}")
    return 0


COMMAND = Subcommand(
    "list",
    "the packaged scenarios and vehicles, and the kinds of fault",
    (
        ("sim-ecu list", "each scenario, each vehicle with its speed of hunting, each kind of fault"),
        ("sim-ecu list | grep axle-box", "one of them"),
    ),
    no_arguments,
    _run,
)
