"""Lint of what looks like an input, against what the configuration and the estimator need of one."""

import math
from collections.abc import Collection, Iterator

from wrcd.bus.dbc import TIMEOUT
from wrcd.bus.units import Quantity, factor
from wrcd.bus.words import unusable, usable
from wrcd.config.input_mapping import MEASURED
from wrcd.core.coarse_sensors import cost_of_step
from wrcd.core.design import Design
from wrcd.dbc.dbc_lines import DbcText, Signal
from wrcd.dbc.lint.codes import Flaw
from wrcd.dbc.lint.message_checks import limits
from wrcd.dbc.recognition import (
    LOOKS,
    MIN_BITS,
    NOT_MEASURED,
    SignalCandidate,
    contains,
    converts,
    is_adhesion,
    is_enumeration,
    is_force,
    is_status,
    is_truth,
    senders_of_adhesion,
    words,
)

CHANNELS = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)  # as the design orders the noise of its sensors
TWO_SIGNS = (*CHANNELS, Quantity.TORQUE)
# What the rig's packaged scenarios reach: 0.046 rad/s over all curves on a track of roughness 1, of which the design is
# trained up to four times as much; 9.8 m/s2 at an axle box with its joints and resonances.
REACHED = {Quantity.YAW_RATE: 0.2, Quantity.LAT_ACCEL: 10.0}


def check_inputs(dbc: DbcText, inputs: Collection[SignalCandidate], design: Design) -> Iterator[Flaw]:
    """Yield what is wrong with inputs."""
    yield from _units(dbc)
    yield from _statuses(inputs)
    for m in {c.message.line: c.message for c in inputs}.values():
        if (dbc.attribute(m, "VFrameFormat") or "").upper() == "J1939PG":
            yield Flaw(m.line, "j1939-id", m.name, f"id 0x{m.can_id:08X}")
    yield from _cycles(dbc, inputs, design.tick_s)
    for c in inputs:
        s = c.signal
        if not s.unit.strip() and c.quantity is not Quantity.DIRECTION:
            yield Flaw(s.line, "unit-missing", c.name, f"it looks like {_called(c.quantity)}")
        if s.low is None and c.quantity is not Quantity.DIRECTION:
            yield Flaw(s.line, "no-range", c.name, "[0|0]")
        if c.quantity in TWO_SIGNS and not s.is_float and (limits(s)[0] if s.low is None else s.low) >= 0:
            yield Flaw(s.line, "one-sided", c.name, f"from {limits(s)[0] if s.low is None else s.low:g} on")
        if not _can_fail(c):
            yield Flaw(s.line, "no-way-to-fail", c.name, f"it looks like {_called(c.quantity)}")
        if dbc.is_fd(c.message):
            yield Flaw(s.line, "fd-input", c.name, f"{c.message.name} is CAN FD")
        if s.mux not in ("", "M"):
            yield Flaw(s.line, "multiplexed-input", c.name, f"multiplexed as {s.mux}")
        yield from _sensor(c, design)


def _statuses(inputs: Collection[SignalCandidate]) -> Iterator[Flaw]:
    """Statuses beside inputs: each with the words that are in its table."""
    for m in {c.message.line: c.message for c in inputs}.values():
        for s in (s for s in m.signals if is_status(s)):
            if not any(map(usable, s.labels)) and any(map(unusable, s.labels)):
                yield Flaw(s.words_line, "status-words-unknown", s.path, ", ".join(map(repr, s.labels)))


def _cycles(dbc: DbcText, inputs: Collection[SignalCandidate], tick_s: float) -> Iterator[Flaw]:
    slow: set[int] = set()
    for c in inputs:
        cycle = dbc.number(c.message, "GenMsgCycleTime") or 0.0
        # of gyro and accelerometer the time-out is three ticks, whatever the DBC says
        if cycle and c.quantity not in MEASURED and not dbc.number(c.signal, TIMEOUT):
            what = f"no {TIMEOUT}: {3 * cycle:g} ms are taken"
            yield Flaw(c.signal.line, "no-timeout", c.name, what)
        if c.quantity in MEASURED and cycle > 1000 * tick_s and c.message.line not in slow:
            slow.add(c.message.line)
            line = dbc.attribute_line(c.message, "GenMsgCycleTime")
            what = f"every {cycle:g} ms; the design's tick is {1000 * tick_s:g} ms"
            yield Flaw(line, "cycle-above-tick", c.message.name, what)


def _called(quantity: Quantity) -> str:
    return quantity.key.replace("_", " ")


def _units(dbc: DbcText) -> Iterator[Flaw]:
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
                yield Flaw(s.line, "unit-unknown", s.path, what)


def _can_fail(c: SignalCandidate) -> bool:
    """Whether its message has a status, or it a word for 'no measurement'; a float can be NaN."""
    return c.signal.is_float or any(map(unusable, c.signal.labels)) or any(map(is_status, c.message.signals))


def _sensor(c: SignalCandidate, design: Design) -> Iterator[Flaw]:
    """Step and range of gyro and accelerometer. A step of the noise's rms adds a twelfth to its power, and a sound
    sensor is known from a frozen one; of more it is not always."""
    if c.quantity not in CHANNELS or not converts(c.signal.unit, c.quantity) or c.signal.is_float:
        return
    s, si = c.signal, factor(c.signal.unit, c.quantity)
    unit = c.quantity.unit
    noise = float(design.noise_rms[CHANNELS.index(c.quantity)])
    step = abs(s.scale * si)
    if step > noise:
        what = (
            f"step {s.scale:g} {s.unit} is {step:.2g} {unit}; the sensor of design {design.name!r} has noise of "
            f"{noise:.2g} {unit} rms: {cost_of_step(step / noise)}"
        )
        yield Flaw(s.line, "resolution-too-coarse", c.name, what)
    reach = _reach(s) * si
    if reach < REACHED[c.quantity]:
        what = f"up to {reach:.2g} {unit}; the rig's runs reach {REACHED[c.quantity]:g} {unit}"
        yield Flaw(s.line, "range-too-small", c.name, what)


def _reach(s: Signal) -> float:
    """How far a value can go to both sides of zero: by the bits and by [min|max]."""
    low, high = limits(s)
    if s.low is not None and s.high is not None:
        low, high = max(low, s.low), min(high, s.high)
    reach = min(-low, high) if low < 0 else high
    return reach if math.isfinite(reach) else 0.0
