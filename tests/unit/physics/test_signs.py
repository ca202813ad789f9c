"""The signs of docs/reference/dbc.md and of its picture are those of the rig's physics."""

import re
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES as RAILS
from sim_ecu.physics.rail import RailSection, rail_at, rail_table
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import Track
from sim_ecu.physics.wheelset import (
    AXLE_STATES,
    LAT_ACCEL,
    TORQUE,
    W_L,
    W_R,
    YAW_RATE,
    FloatArray,
    Wheelset,
    axle_derivatives,
    constants,
)
from tests.support.signs_picture import CURVES, PICTURE, TORQUES, draw

W, TICK_S, V = Wheelset(), 0.005, 25.0
STRAIGHT = rail_table([RailSection(0.0, RAILS["A"])])
PAGE = Path(__file__).parents[3] / "docs" / "reference" / "dbc.md"
# curvature, as the scenarios say it: to the right
RIGHT = {"left-hand curve": -1.0, "right-hand curve": 1.0}


def ride(curvature: float = 0.0, cant: float = 0.0) -> FloatArray:
    """What the sensors read at the end of eight seconds without torque."""
    rail = rail_table([RailSection(0.0, RAILS["A"], curvature, cant)])
    sim = Simulation(W, [Axle(rail, Track(0.0, 1))], V, TICK_S)
    n = 1600
    out: FloatArray = sim.advance(command(n, torque=0.0, limit_of_peak=1.0), np.full(n, V)).outputs[-1, 0]
    return out


@pytest.mark.parametrize("name", CURVES)
def test_curve_has_the_signs_of_the_picture(name: str) -> None:
    out = ride(RIGHT[name] / 1000)
    assert (np.sign(out[YAW_RATE]), np.sign(out[LAT_ACCEL])) == CURVES[name]
    # the page's rule of thumb
    assert out[LAT_ACCEL] == pytest.approx(V * out[YAW_RATE], rel=0.02)


@pytest.mark.parametrize("name", TORQUES)
def test_torque_has_the_signs_of_the_picture(name: str) -> None:
    torque, force, faster = TORQUES[name]
    n = 800
    rail = rail_table([RailSection(0.0, RAILS["A"])])
    sim = Simulation(W, [Axle(rail, Track(0.0, 1))], V, TICK_S)
    drive = command(n, torque=3000.0 * torque, limit_of_peak=1.0)
    speed = sim.advance(drive, np.full(n, np.nan))
    assert np.sign(speed.outputs[-1, 0, TORQUE]) == torque
    assert np.sign(speed.speed_m_s[-1] - V) == faster
    # a wheel that turns faster than it rolls is pushed forward by the rail
    turned = np.zeros(AXLE_STATES)
    turned[W_R] = turned[W_L] = V * (1 + 0.001 * torque) / W.r_0
    along, _ = axle_derivatives(
        turned, V, 0.0, 0.0, rail_at(STRAIGHT, 1.0), constants(W), W.contact, np.zeros(AXLE_STATES)
    )
    assert np.sign(along) == force


def test_picture_is_drawn_and_shown_by_the_page(tmp_path: Path) -> None:
    draw(tmp_path / "signs.png")
    made, kept = (p.read_bytes() for p in (tmp_path / "signs.png", PICTURE))
    assert made[:24] == kept[:24]  # of the same size
    assert f"](../{PICTURE.name})" in PAGE.read_text(encoding="utf-8")


def test_page_states_the_signs_of_the_picture() -> None:
    rows = re.findall(
        r"^\| ([\w-]+ curve|traction|braking) \| (.+) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    found = {name: tuple({"> 0": 1, "< 0": -1}[cell.strip()] for cell in cells.split("|")) for name, cells in rows}
    assert found == {**CURVES, **{name: signs[:2] for name, signs in TORQUES.items()}}
