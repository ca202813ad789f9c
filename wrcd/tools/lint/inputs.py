"""Lint: what looks like an input, against what the configuration and the estimator need of one."""

import math
from collections.abc import Collection, Iterator

from wrcd.bus.units import Quantity, factor
from wrcd.bus.words import unusable
from wrcd.estimator.design import Design
from wrcd.tools.dbc.candidates import MIN_BITS, Candidate, senders_of_adhesion
from wrcd.tools.dbc.records import DbcText, Signal
from wrcd.tools.dbc.vocabulary import (
    LOOKS,
    NOT_MEASURED,
    contains,
    converts,
    is_adhesion,
    is_enumeration,
    is_force,
    is_status,
    is_truth,
    words,
)
from wrcd.tools.lint.codes import Finding
from wrcd.tools.lint.values import limits

CHANNELS = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)  # as the design orders the noise of its sensors
TWO_SIGNS = (*CHANNELS, Quantity.TORQUE)
# What the rig's packaged scenarios reach: 0.046 rad/s over all curves on a track of roughness 1, of which the design is
# trained up to four times as much; 9.8 m/s2 at an axle box with its joints and resonances.
REACHED = {Quantity.YAW_RATE: 0.2, Quantity.LAT_ACCEL: 10.0}


def check(dbc: DbcText, inputs: Collection[Candidate], design: Design) -> Iterator[Finding]:
    """Every finding. inputs: what looks like one."""
    yield from _units(dbc)
    for c in inputs:
        s = c.signal
        if not s.unit.strip() and c.quantity is not Quantity.DIRECTION:
            yield Finding(s.line, "unit-missing", c.name, f"it looks like {_called(c.quantity)}")
        if s.low is None and c.quantity is not Quantity.DIRECTION:
            yield Finding(s.line, "no-range", c.name, "[0|0]")
        if c.quantity in TWO_SIGNS and not s.is_float and (limits(s)[0] if s.low is None else s.low) >= 0:
            yield Finding(s.line, "one-sided", c.name, f"from {limits(s)[0] if s.low is None else s.low:g} on")
        if not _can_fail(c):
            yield Finding(s.line, "no-way-to-fail", c.name, f"it looks like {_called(c.quantity)}")
        if dbc.is_fd(c.message):
            yield Finding(s.line, "fd-input", c.name, f"{c.message.name} is CAN FD")
        if s.mux not in ("", "M"):
            yield Finding(s.line, "multiplexed-input", c.name, f"multiplexed as {s.mux}")
        yield from _sensor(c, design)


def _called(quantity: Quantity) -> str:
    return quantity.key.replace("_", " ")


def _units(dbc: DbcText) -> Iterator[Finding]:
    """Signals that are named like an input in full, in a unit that nobody can convert."""
    ours = senders_of_adhesion(dbc)
    for m in dbc.on_the_bus:
        if m.sender in ours or is_adhesion(m) or is_truth(m):
            continue
        for s in m.signals:
            if not s.unit.strip() or is_enumeration(s) or s.length < MIN_BITS or NOT_MEASURED & set(words(s.name)):
                continue
            named = [q for q in (*TWO_SIGNS, Quantity.SPEED) if contains(s.name, LOOKS[q].parts)]
            named = [q for q in named if not LOOKS[q].contrary & set(words(s.name))]
            rim = is_force(s.unit) and Quantity.TORQUE in named
            if named and not rim and not any(converts(s.unit, q) for q in Quantity):
                what = f"{s.unit!r}; it looks like {_called(named[0])}"
                yield Finding(s.line, "unit-unknown", f"{m.name}.{s.name}", what)


def _can_fail(c: Candidate) -> bool:
    """Whether its message has a status, or it a word for 'no measurement'; a float can be NaN."""
    own = c.signal.words.pairs if c.signal.words else []
    return c.signal.is_float or any(unusable(w) for _, w in own) or any(is_status(s) for s in c.message.signals)


def _sensor(c: Candidate, design: Design) -> Iterator[Finding]:
    """Step and range of gyro and accelerometer. A step of the noise's rms adds a twelfth to its power, and the values
    still look random; of more they stand still or jump."""
    if c.quantity not in CHANNELS or not converts(c.signal.unit, c.quantity) or c.signal.is_float:
        return
    s, si = c.signal, factor(c.signal.unit, c.quantity)
    unit = c.quantity.unit
    noise = float(design.noise_rms[CHANNELS.index(c.quantity)])
    step = abs(s.scale * si)
    if step > noise:
        what = (
            f"step {s.scale:g} {s.unit} is {step:.2g} {unit}; the sensor of design {design.name!r} has noise of "
            f"{noise:.2g} {unit} rms"
        )
        yield Finding(s.line, "resolution-too-coarse", c.name, what)
    reach = _reach(s) * si
    if reach < REACHED[c.quantity]:
        what = f"up to {reach:.2g} {unit}; the rig's runs reach {REACHED[c.quantity]:g} {unit}"
        yield Finding(s.line, "range-too-small", c.name, what)


def _reach(s: Signal) -> float:
    """How far a value can go to both sides of zero: by the bits and by [min|max]."""
    low, high = limits(s)
    if s.low is not None and s.high is not None:
        low, high = max(low, s.low), min(high, s.high)
    reach = min(-low, high) if low < 0 else high
    return reach if math.isfinite(reach) else 0.0
