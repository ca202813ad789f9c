"""When a vehicle begins to hunt: equations (1)-(12) and its bogie's, linear about rolling straight on without creep."""

import math

import numpy as np

from sim_ecu.physics.contact import CreepCurve
from sim_ecu.physics.wheelset import (
    AXLE_STATES,
    BLOCK,
    BOGIE,
    BOGIE_STATES,
    CONSTANTS,
    LANES,
    W_L,
    W_R,
    D,
    FloatArray,
    P,
    R,
    Wheelset,
    X,
    constants,
    derivatives,
)

SCAN_M_S = 1.0  # between the speeds that are looked at
SETTLED_1_S = 1e-6  # a growth below this is what the differences leave of none
SMALL = 1e-7  # what each state is moved by: so little creep that its force is linear to one in a million


def system_matrix(w: Wheelset, curve: CreepCurve, speed_m_s: float) -> FloatArray:
    """The matrix of the linear system at a held speed: with a bogie that of both wheelsets (7 states each), frame and
    half body (6); without one that of the wheelset."""
    axles = 1 if w.bogie is None else 2
    b = np.zeros(BLOCK)
    rows = b.reshape(-1, LANES)
    for j in range(axles):
        rows[P // LANES : P // LANES + CONSTANTS, j] = *constants(w, j == 0), *w.contact
        rows[R // LANES : R // LANES + 5, j] = curve.row()
        rows[X // LANES + AXLE_STATES, j] = speed_m_s
        rows[X // LANES + np.array([W_R, W_L]), j] = speed_m_s / w.r_0
    leader = np.full(LANES, -1 if w.bogie is None else 0)
    head, size = np.zeros(LANES, np.int64), np.full(LANES, axles)
    states = [(q, j) for j in range(axles) for q in range(AXLE_STATES)]
    if w.bogie is not None:
        states += [(BOGIE + q, 0) for q in range(BOGIE_STATES)]
    at = [X + q * LANES + j for q, j in states]
    out = [place - X + D for place in at]
    matrix = np.empty((len(at), len(at)))
    for column, place in enumerate(at):
        straight = b[place]
        b[place] = straight + SMALL
        derivatives(b, axles, leader, head, size)
        matrix[:, column] = b[out]
        b[place] = straight - SMALL
        derivatives(b, axles, leader, head, size)
        matrix[:, column] -= b[out]
        b[place] = straight
    return matrix / (2 * SMALL)


def hunting_speed_m_s(w: Wheelset, curve: CreepCurve, up_to_m_s: float = 200.0, scan_m_s: float = SCAN_M_S) -> float:
    """The lowest speed, to a centimetre per second, from which on a disturbance grows; infinite if none up to there.

    scan_m_s: a range of speeds narrower than this may be missed."""

    def grows(speed_m_s: float) -> bool:
        return bool(np.linalg.eigvals(system_matrix(w, curve, speed_m_s)).real.max() > SETTLED_1_S)

    for fast in np.arange(5.0, up_to_m_s + scan_m_s, scan_m_s).tolist():
        if grows(fast):
            slow = fast - scan_m_s
            while fast - slow > 0.01:
                middle = 0.5 * (slow + fast)
                slow, fast = (slow, middle) if grows(middle) else (middle, fast)
            return float(fast)
    return math.inf
