"""Stops and starts of the lone wheelset for the loop's tests: rails that ask for more than they carry."""

from typing import Any

from sim_ecu.bench import scenario
from sim_ecu.loop.drive_scenario import DriveScenario


def lone(rail: list[dict[str, float]], speed_m_s: float, demand: list[list[float]], **keys: Any) -> DriveScenario:
    """A scenario to drive of the wheelset that the packaged lone design is of."""
    return scenario(
        vehicle="lone-wheelset", rail=rail, speed_m_s=speed_m_s, demand=demand, track="erri-low", sensors="mems", **keys
    )


def greasy_stop(axles: int = 1, seed: int = 3) -> DriveScenario:
    """From 16 m/s, the rail known for 3.5 s of a little brake."""
    numbers = list(range(1, axles + 1))
    demand = [[0.0, -0.05], [3.5, -0.05], [3.6, -0.95]]
    return lone([{"mu_0": 0.14}], 16.0, demand, axles=numbers, seed=seed, duration_s=40.0)


def low_stop(seed: int = 3) -> DriveScenario:
    """The same from 12 m/s on a low rail."""
    return lone([{"mu_0": 0.06}], 12.0, [[0.0, -0.05], [3.5, -0.05], [3.6, -0.95]], seed=seed, duration_s=70.0)


def leaf_stop(seed: int = 3) -> DriveScenario:
    """From 20 m/s on dry rail, into a patch of leaf film."""
    rail = [{"mu_0": 0.5}, {"from_m": 57.0, "mu_0": 0.045}, {"from_m": 102.0, "mu_0": 0.5}]
    return lone(rail, 20.0, [[0.0, 0.0], [1.5, 0.0], [1.6, -0.95]], seed=seed, duration_s=45.0)


def low_start(seed: int = 3) -> DriveScenario:
    """From 8 m/s with full traction on a low rail."""
    return lone([{"mu_0": 0.06}], 8.0, [[0.0, 0.05], [3.5, 0.05], [3.6, 0.95]], seed=seed, duration_s=10.0)
