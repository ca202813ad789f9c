"""`sim-ecu list`."""

import argparse
import tomllib

from sim_ecu.resources import SCENARIOS, TO_DRIVE
from wrcd.cli.program import Subcommand, no_arguments

FASTEST_M_S, SCAN_M_S = 200.0, 5.0  # hunting of each packaged vehicle, once begun, goes on at every higher speed


def _run(_args: argparse.Namespace) -> int:
    import math

    # what they state is enough here, and to read them whole takes the simulation's second
    for folder, more in ((SCENARIOS, ""), (TO_DRIVE, ", to drive")):
        for file in sorted(folder.glob("*.toml")):
            stated = tomllib.loads(file.read_text())
            axles = len(stated.get("axles", [1]))
            size = f"{stated['duration_s']:4.0f} s, {axles} axle{'s' * (axles > 1)}{more}"
            print(f"{file.stem:19} {size}: {stated['title']}", flush=True)

    from sim_ecu.physics.contact import CURVES
    from sim_ecu.physics.stability import hunting_speed_m_s
    from sim_ecu.play.faults import described
    from sim_ecu.play.vehicles import load_vehicle, packaged_vehicles, vehicle_title

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
