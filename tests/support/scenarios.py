"""Scenarios that several tests use, as TOML, and the type of the fixture that plays them."""

from collections.abc import Callable
from pathlib import Path

from sim_ecu.resources import SCENARIOS

LogOf = Callable[[str], Path]


def held(curve: str, seconds: float = 8.0, of_peak: float = 1.0) -> str:
    """A curve held from 1 s on at a share of its peak's creep. Half of it is never too still in a bogie."""
    return f"""
duration_s = {seconds}
rail = [{{ curve = "{curve}" }}]
drive = {{ creep_of_peak = [[0, 0], [1, {of_peak}]] }}
"""


CHANGING_SPEED = """
duration_s = 8
speed_m_s = [[0, 10], [8, 32]]
rail = [{ curve = "B" }]
drive = { utilisation = [[0, 0], [1, 0.5]] }
"""

FOUR_AXLES = """
duration_s = 6
axles = [1, 2, 3, 4]
rail = [{ curve = "A" }]
drive = { creep_of_peak = [[0, 0], [1, 1]] }
[axle.2]
rail = [{ curve = "C" }]
[axle.3]
rail = [{ curve = "E" }]
drive = { utilisation = [[0, 0], [1, 0.6]] }
[axle.4]
rail = [{ curve = "F" }]
"""

SIX_AXLES = (SCENARIOS / "six-axles.toml").read_text().replace("duration_s = 20.0", "duration_s = 6.0")

EIGHT_AXLES = """
duration_s = 12
axles = [1, 2, 3, 4, 5, 6, 7, 8]
rail = [{ curve = "B" }]
drive = { creep_of_peak = [[0, 0], [1, 1]] }
"""
