"""The bounds by which lint judges a sensor's range, against the rig's runs that they come from."""

import pytest

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import load_scenario
from wrcd.bus.units import Quantity
from wrcd.dbc.lint.input_checks import REACHED

# In the packaged DBC: bytes 2 to 4, signed, and the step.
CHANNELS = {Quantity.YAW_RATE: (0x100, 1e-6), Quantity.LAT_ACCEL: (0x110, 1e-5)}


@pytest.mark.parametrize(
    ("scenario", "quantity", "share"),
    [("all-curves", Quantity.YAW_RATE, (0.2, 0.25)), ("axle-box", Quantity.LAT_ACCEL, (0.9, 1.0))],
)
def test_range_that_lint_asks_for_is_what_the_rig_reaches(
    scenario: str, quantity: Quantity, share: tuple[float, float]
) -> None:
    base, step = CHANNELS[quantity]
    peak = 0.0
    for _, sent in Player(load_scenario(scenario), truth=False, chunk=400):
        values = [int.from_bytes(f.data[2:5], "little", signed=True) for f in sent if base < f.can_id <= base + 8]
        peak = max(peak, *(abs(v) * step for v in values), 0.0)
    low, high = share
    assert low <= peak / REACHED[quantity] <= high
