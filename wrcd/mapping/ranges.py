"""The range of an input: the configuration's or the DBC's, and whether a train fits into it."""

import math

from wrcd import declared
from wrcd.bus.dbc import Message, Signal
from wrcd.bus.units import Quantity
from wrcd.core.validity import LOAD_SHARES, RADIUS_SHARES
from wrcd.estimator.design import Design
from wrcd.mapping.statements import Statement
from wrcd.mapping.values import span
from wrcd.section import TO_FILL_IN

YAW_RAD_S, LAT_M_S2 = 0.35, 20.0  # what a wheelset that hunts reaches: 20 deg/s, 2 g
EPSILON = 1e-6  # of a step: what is lost in the division
MU = 0.5  # adhesion that a torque may use


def physical_range(
    s: Statement, message: Message, signal: Signal, to_si: float, design: Design
) -> tuple[float | None, float | None]:
    """Return the physical range where it is not the DBC's, else (None, None).

    Raises InputError for one of the DBC's that shuts out most raw values, and values that a train reaches.
    """
    scale = float(signal.scale if s.scale is None else s.scale)
    offset = float(signal.offset if s.offset is None else s.offset)
    own_scale = s.scale is not None or s.offset is not None
    low, high = s.range or (signal.minimum, signal.maximum)
    if s.range is None and own_scale:
        # the DBC's range is in its own unit: of the same raw values
        ends = [None if x is None else float((x - signal.offset) / signal.scale * scale + offset) for x in (low, high)]
        low, high = ends if scale * signal.scale > 0 else ends[::-1]
    given = (low, high) if s.range or own_scale else (None, None)
    if signal.is_float or s.quantity is Quantity.DIRECTION:
        return given
    if low is not None and high is not None and low > high:
        raise s.table.error(
            f"the DBC's range of {s.message}.{s.signal} is empty, [{signal.minimum}|{signal.maximum}]",
            declared.SIGNAL.name,
            f"mend the DBC, or say what it measures: {s.table.line(range=[TO_FILL_IN, TO_FILL_IN])}",
        )
    lowest, highest = span(signal)
    share = _inside(signal, scale, offset, low, high) / (highest - lowest + 1)
    if s.range is not None:
        if not share:
            raise s.table.error(
                f"no raw value of {s.message}.{s.signal} lies within {low:g} … {high:g}", declared.RANGE.name
            )
        return given
    if share < 0.5:
        needed = _needed(s, signal, design)
        if not _reaches(low, high, to_si, needed):
            reached = [float(f"{x / abs(to_si):.3g}") for x in needed]
            raise s.table.error(
                f"the DBC's range of {s.message}.{s.signal}, [{signal.minimum}|{signal.maximum}], shuts out "
                f"{math.floor(100 * (1 - share))} % of its raw values, and values that a train reaches",
                declared.SIGNAL.name,
                f"mend the DBC, or say what it measures, at least this: {s.table.line(range=reached)}",
            )
    return given


def _needed(s: Statement, signal: Signal, d: Design) -> tuple[float, float]:
    """What a train reaches of a quantity, in SI units. A torque that is never negative drives or brakes only."""
    torque = MU * 2 * d.normal_N * d.r_0 * s.share
    load, radius = 2 * d.normal_N, d.r_0
    return {
        Quantity.YAW_RATE: (-YAW_RAD_S, YAW_RAD_S),
        Quantity.LAT_ACCEL: (-LAT_M_S2, LAT_M_S2),
        Quantity.TORQUE: (-torque if signal.is_signed else 0.0, torque),
        Quantity.BRAKE_TORQUE: (0.0, torque),
        Quantity.SPEED: (0.0, float(d.speeds_m_s[-1])),
        Quantity.AXLE_LOAD: (load * LOAD_SHARES[0], load * LOAD_SHARES[1]),
        Quantity.WHEEL_RADIUS: (radius * RADIUS_SHARES[0], radius * RADIUS_SHARES[1]),
    }[s.quantity]


def _reaches(low: float | None, high: float | None, to_si: float, needed: tuple[float, float]) -> bool:
    """Whether a range holds what is needed, either way round: a brake's sign is not known here."""
    if low is None or high is None:
        return False
    first, last = sorted((low * to_si, high * to_si))
    return any(first <= a and b <= last for a, b in (needed, (-needed[1], -needed[0])))


def _inside(signal: Signal, scale: float, offset: float, low: float | None, high: float | None) -> int:
    """How many raw values of a field are within a physical range, or half a step beyond."""
    lowest, highest = span(signal)
    ends = []
    for x, end in ((low, lowest if scale > 0 else highest), (high, highest if scale > 0 else lowest)):
        raw = float(end) if x is None else (x - offset) / scale
        ends.append(
            min(max(raw, lowest - 1.0), highest + 1.0)
        )  # a raw value beyond the field may be beyond all numbers
    first, last = math.ceil(min(ends) - 0.5 - EPSILON), math.floor(max(ends) + 0.5 + EPSILON)
    return max(min(last, highest) - max(first, lowest) + 1, 0)
