"""The bogie's transfer functions are those of the rig's own equations."""

from dataclasses import asdict

import numpy as np
import pytest

from sim_ecu.physics import wheelset as rig
from sim_ecu.physics.contact import CURVES, CreepCurve
from sim_ecu.physics.wheelset import LANES, Wheelset
from sim_ecu.play.vehicles import load_vehicle
from wrcd.fit.bogie import PRIOR_SIGMA, BogieConstants, response

STEP = 1e-7
FREQUENCIES_HZ = np.linspace(0.3, 30.0, 60)


def rolling(w: Wheelset, curve: CreepCurve, speed_m_s: float) -> rig.FloatArray:
    """Return the rig's block of a bogie that rolls straight on."""
    block = np.zeros(rig.BLOCK)
    rows = block.reshape(-1, LANES)
    for lane in range(2):
        rows[rig.P // LANES : rig.P // LANES + rig.CONSTANTS, lane] = *rig.constants(w, lane == 0), *w.contact
        rows[rig.R // LANES : rig.R // LANES + 5, lane] = curve.row()
        rows[rig.X // LANES + rig.AXLE_STATES, lane] = speed_m_s
        rows[rig.X // LANES + np.array([rig.W_R, rig.W_L]), lane] = speed_m_s / w.r_0
    return block


def linearised(w: Wheelset, curve: CreepCurve, speed_m_s: float) -> tuple[rig.FloatArray, int]:
    """Return what each state (20) and input (4: alignment, cross-level of both) adds to derivatives and signals (4)."""
    block = rolling(w, curve, speed_m_s)
    states = [(q, lane) for q in range(rig.AXLE_STATES) for lane in range(2)]
    states += [(rig.BOGIE + q, 0) for q in range(rig.BOGIE_STATES)]
    at = [rig.X + q * LANES + lane for q, lane in states]
    seen = [place - rig.X + rig.D for place in at] + [rig.YAW, rig.ACCEL, rig.YAW + 1, rig.ACCEL + 1]
    inputs = [rig.TRACK, rig.TRACK + 1, rig.LEVEL, rig.LEVEL + 1]
    rules = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.full(LANES, 2)
    out = np.empty((len(seen), len(at) + len(inputs)))
    for column, place in enumerate([*at, *inputs]):
        straight, both = block[place], []
        for moved in (STEP, -STEP):
            block[place] = straight + moved
            rig.derivatives(block, 2, *rules)
            both.append(block[seen])
        block[place] = straight
        out[:, column] = (both[0] - both[1]) / (2 * STEP)
    return out, len(at)


def of_rig(w: Wheelset, curve: CreepCurve, speed_m_s: float) -> rig.FloatArray:
    """Return its transfer functions (F, 4 signals, 2 sources)."""
    assert w.bogie is not None
    matrix, n = linearised(w, curve, speed_m_s)
    out = np.empty((len(FREQUENCIES_HZ), 4, 2), complex)
    for k, s in enumerate(2j * np.pi * FREQUENCIES_HZ):
        each = matrix[n:, :n] @ np.linalg.solve(s * np.eye(n) - matrix[:n, :n], matrix[:n, n:]) + matrix[n:, n:]
        late = np.exp(-s * w.bogie.wheelbase_m / speed_m_s)
        out[k] = np.stack((each[:, 0] + late * each[:, 1], each[:, 2] + late * each[:, 3]), 1)
    return out


@pytest.mark.parametrize("vehicle", ["multiple-unit", "high-speed-coach", "manchester-1"])
@pytest.mark.parametrize(("curve", "speed_m_s"), [("A", 10.0), ("B", 25.0), ("D", 40.0)])
def test_response_is_that_of_the_rigs_equations(vehicle: str, curve: str, speed_m_s: float) -> None:
    w, of_curve = load_vehicle(vehicle), CURVES[curve]
    slope = w.contact.stiffness_N * 2 / np.pi * (of_curve.k_A + of_curve.k_S)
    ours = response(BogieConstants.of(asdict(w)), speed_m_s, slope, slope, FREQUENCIES_HZ)[:, :, :2]
    theirs = of_rig(w, of_curve, speed_m_s)
    apart = np.abs(ours.reshape(-1, 4, 2) - theirs).max(axis=0) / np.abs(theirs).max(axis=0)
    assert apart.max() < 3e-8, apart  # what the rig's differences leave of a stiff one


def test_signals_of_the_trailing_wheelset_taken_a_wheelbase_later_meet_the_track_at_once() -> None:
    c = BogieConstants.of(asdict(load_vehicle("multiple-unit")))
    plain, later = (response(c, 20.0, 1e7, 1e7, [2.0, 5.0], later_s) for later_s in (0.0, c.wheelbase_m / 20.0))
    assert np.array_equal(plain[:, 0], later[:, 0])
    np.testing.assert_allclose(np.abs(plain[:, 1]), np.abs(later[:, 1]))
    # far above what the suspension passes on both wheelsets do alike
    high = response(c, 20.0, 1e7, 1e7, [200.0], c.wheelbase_m / 20.0)
    np.testing.assert_allclose(high[:, 0], high[:, 1], rtol=0.05)


@pytest.mark.parametrize("name", PRIOR_SIGMA)
def test_factor_of_a_constant_moves_the_signals(name: str) -> None:
    c = BogieConstants.of(asdict(load_vehicle("multiple-unit")))
    before, after = (response(each, 20.0, 1e7, 1e7, [3.0]) for each in (c, c.changed({name: 0.1})))
    assert not np.allclose(before, after, rtol=1e-6)


def test_slope_is_that_of_the_contact_within_its_kind_of_ellipse() -> None:
    w = load_vehicle("multiple-unit")
    assert BogieConstants.of(asdict(w)).slope_N == pytest.approx(w.contact.stiffness_N * 2 / np.pi, rel=0.05)


def test_lone_wheelset_has_no_bogies_constants() -> None:
    with pytest.raises(ValueError, match="lone"):
        BogieConstants.of(asdict(load_vehicle("metro")))
