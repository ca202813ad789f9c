"""Every key of the configuration, by table. The parser reads by these; the docs' tables are made from them.

A new key of an input begins here: among the keys below "one input", and under the same name in Given. A field of that
name in Source (wrcd/bus/signals.py) has its value; one that the DBC or the design has a say in is resolved in
wrcd/config/input_mapping.py. A member of that name in WRCD_INPUT (wrcd/core/c/wrcd.h) has it, too, and frames.c does
with each value what it says; or wrcd/bus/mapping.py, once for all. sim_ecu/play/mapped_message.py does its inverse.
A new quantity begins in wrcd/core/c/inputs.c.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from wrcd.bus.units import Quantity
from wrcd.config.keys import (
    Choice,
    DesignFile,
    Flag,
    Interval,
    Key,
    Number,
    RawNames,
    RawValue,
    RawValues,
    Sign,
    SignalName,
    Sub,
    Text,
    Whole,
)
from wrcd.config.section import Section
from wrcd.core.terms import MAX_AXLES
from wrcd.core.vocabulary import MESSAGES, Numeric, Words, snake
from wrcd.resources import DEFAULT_DESIGN

# The names under which python-can opens a bus; a test compares them with its own list.
INTERFACES = (
    "canalystii", "cantact", "etas", "gs_usb", "iscan", "ixxat", "kvaser", "neousys", "neovi", "nican", "nixnet",
    "pcan", "robotell", "seeedstudio", "serial", "slcan", "socketcan", "socketcand", "systec", "udp_multicast",
    "usb2can", "vector", "virtual",
)  # fmt: skip
MAX_MS = 65_535  # of cycles and time-outs
P11, UNPROTECTED = "P11", "none"

INTERFACE = Choice(
    "interface",
    "python-can's name of the interface; socketcan goes through the daemon's own socket",
    INTERFACES,
    "socketcan",
)
CHANNEL = Text("channel", "its channel", "can0")
TIMESTAMPS = Choice(
    "timestamps",
    "hardware: the CAN controller's own time stamps, laid on the kernel's clock",
    ("kernel", "hardware"),
    "kernel",
)
DBC_FILE = Text("file", "a train's own DBC; default: the packaged one")
ENCODING = Choice(
    "encoding", "of the DBC; default: UTF-8 where the file is valid UTF-8, else cp1252", ("utf-8", "cp1252")
)
DESIGN = DesignFile("design", f"the design, a packaged one or a file; default: {DEFAULT_DESIGN}")
MIN_SPEED = Number("min_speed_m_s", "below it there is no estimate", 0.1, 60.0, 3.0)
NOT_AVAILABLE_AFTER = Number(
    "not_available_after_ms",
    "an input silent for longer ends the estimate; not less than any time-out of a measurement",
    5.0,
    10_000.0,
    100.0,
)
CONSTANT_SPEED = Number("constant_speed_m_s", "the speed of a rig without a speed message", 0.0, Quantity.SPEED.limit)
TORQUE_IS_TOTAL = Flag("torque_is_total", "false: friction brakes act beside the torque on the bus", True)
NUMBER = Whole("number", "each once", 1, MAX_AXLES, needed=True)
POSITION = Number("position_m", "where it stands along the train, forward positive", -1000.0, 1000.0)
ONE_WAY = Flag("one_way", "true: the train never runs in reverse", False)
FOLDER = Text("folder", "where dumps and what slides revealed go; default: systemd's `$STATE_DIRECTORY`, else none")
SECONDS = Number("seconds", "how much is kept in memory; 0 is off", 0.0, 600.0, 90.0)
MAX_FILES = Whole("max_files", "dumps in the folder", 1, 10_000, 20)
MAX_MB = Number("max_mb", "megabytes in the folder", 1.0, 1e6, 200.0)

# --- one input
SIGNAL = SignalName("signal", "the signal that carries it", needed=True)
SIGN = Sign("sign", "-1: the other way round than the picture of signs and axes", 1)
UNIT = Text("unit", "the signal's unit, instead of the DBC's")
SCALE = Number("scale", "a raw value's weight in that unit, instead of the DBC's", -math.inf, math.inf, nonzero=True)
OFFSET = Number("offset", "what is added to it, instead of the DBC's", -math.inf, math.inf)
RANGE = Interval(
    "range",
    "values in that unit beyond which a frame is refused, instead of the DBC's; gyro and accelerometer clip there",
)
TIMEOUT = Whole(
    "timeout_ms",
    "after how long it is stale, instead of the DBC's; of gyro and accelerometer at most three ticks",
    1,
    MAX_MS,
)
INVALID = RawValues("invalid", "raw values that are no measurement, besides the DBC's own words")
STATUS = SignalName(
    "status", "the signal that says whether the sender is well; false: the message has one that is not to count"
)
OK = RawValues("ok", "its values that are good; every other one but the degraded refuses the frame")
DEGRADED = RawValues("degraded", "its values that make the axle Degraded")
STATUS_TIMEOUT = Whole(
    "status_timeout_ms",
    "how long a status that comes in other frames is believed, instead of the DBC's time-out; default: 100",
    1,
    MAX_MS,
)
E2E = Choice("e2e", "P11: the message is protected; none: it is not, whatever the DBC says", (P11, UNPROTECTED))
DATA_ID = Whole("data_id", "its E2E data id", 0, 0xFFFF)
PGN = Flag("pgn", "true: J1939; any frame of its group counts, whatever priority, source and destination", False)
AT = Choice(
    "at",
    "where the torque acts: at the motor's shaft it is times the gear ratio; at the rim it is a force, "
    "times the design's wheel radius",
    ("axle", "motor", "rim"),
    "axle",
)
GEAR_RATIO = Number("gear_ratio", "turns of the motor per turn of the axle", 0.1, 100.0)
SHARE = Number("share", "the part of it that acts at this axle", 0.01, 1.0, 1.0)
REVERSE = RawValues("reverse", "its values that mean reverse, where the DBC's words do not say")

PLAIN_INPUT: tuple[Key, ...] = (
    SIGNAL, UNIT, SCALE, OFFSET, RANGE, TIMEOUT, INVALID, STATUS, OK, DEGRADED, STATUS_TIMEOUT, E2E, DATA_ID, PGN,
)  # fmt: skip
SIGNED_INPUT: tuple[Key, ...] = (SIGNAL, SIGN, *PLAIN_INPUT[1:])
TORQUE_INPUT: tuple[Key, ...] = (*SIGNED_INPUT, AT, GEAR_RATIO, SHARE)
DIRECTION_INPUT: tuple[Key, ...] = (*SIGNED_INPUT, REVERSE)


class Given(NamedTuple):
    """What a configuration says of one input by the keys of these names. None: as the DBC says."""

    sign: int
    unit: str | None
    scale: float | None
    offset: float | None
    range: tuple[float, float] | None
    timeout_ms: int | None
    invalid: RawNames | None
    pgn: bool
    at: str
    gear_ratio: float | None
    share: float
    reverse: RawNames | None


def given_by(table: Section) -> tuple[Given, frozenset[str]]:
    """Read these keys of an input's table. Returns the names of those with a mistake, too, which is collected."""
    keys, found, wrong = {key.name: key for key in (*TORQUE_INPUT, *DIRECTION_INPUT)}, list[Any](), list[str]()
    for name in Given._fields:
        before = table.mistakes
        found.append(keys[name].read(table))
        wrong += [name] * (table.mistakes > before)
    return Given(*found), frozenset(wrong)


# --- one message that is sent, and its signals
MESSAGE = Text("message", "its name in the DBC")
CYCLE = Whole("cycle_ms", "every how many ms it is sent, instead of the DBC's; not less than the tick", 1, MAX_MS)
FIELD = Text("signal", "the signal that carries it", needed=True)
FIELD_UNIT = Text("unit", "the signal's unit, instead of the DBC's")
FIELD_RANGE = Interval("range", "values in that unit that it can say, instead of the DBC's")
NO_VALUE = RawValue("not_available", "its value where there is none")


def field_keys(carried: Numeric | Words) -> tuple[Key, ...]:
    """The keys of one signal that is sent."""
    if isinstance(carried, Numeric):
        return (FIELD, FIELD_UNIT, FIELD_RANGE, *((NO_VALUE,) if carried.absent else ()))
    return (FIELD, *(RawValue(snake(word), f"its value for {word}") for word in (*carried.words, *carried.extra)))


def output_keys(kind: str) -> tuple[Key, ...]:
    """The keys of one message that is sent."""
    fields = (Sub(snake(name), f"the signal that carries {name}") for name in MESSAGES[kind])
    return (MESSAGE, CYCLE, E2E, DATA_ID, *fields)


VEHICLE: tuple[Key, ...] = (
    Sub("speed", "the speed; needed unless `limits.constant_speed_m_s` is given"),
    Sub("direction", "the direction of travel; it turns the signs"),
    TORQUE_IS_TOTAL,
    ONE_WAY,
    Sub("status_message", "the message to send as WrcdStatus; default: that name, where the DBC has it"),
    Sub("rejects_message", "the same of WrcdRejects"),
    Sub("link_message", "the same of WrcdLink"),
)
AXLE: tuple[Key, ...] = (
    NUMBER,
    POSITION,
    Sub("yaw_rate", "the gyro", needed=True),
    Sub("lateral_acceleration", "the accelerometer at the axle box", needed=True),
    Sub("torque", "the torque at the axle; several signals add up", needed=True),
    Sub("brake_torque", "the friction brakes' torque; several signals add up"),
    Sub("axle_load", "the axle load"),
    Sub("wheel_radius", "the wheel radius"),
    Sub("adhesion", "the message to send, here of axle 1; it needs Validity and MuAvailable", default="Adhesion_A1"),
    Sub("detail", "the message to send as AdhesionDetail; default: AdhesionDetail_A*a*, where the DBC has it"),
    Sub("inputs", "the same of InputHealth_A*a*"),
    Sub("own", "the same of AdhesionOwn_A*a*, which is sent where `position_m` is given"),
)
# By the path of a table's keys; those of inputs and of fields that are sent are named by what they carry.
TABLES: Mapping[str, tuple[Key, ...]] = {
    "bus": (INTERFACE, CHANNEL, TIMESTAMPS),
    "dbc": (DBC_FILE, ENCODING),
    "estimator": (DESIGN,),
    "vehicle": VEHICLE,
    "limits": (MIN_SPEED, NOT_AVAILABLE_AFTER, CONSTANT_SPEED),
    "axle": AXLE,
    "recorder": (FOLDER, SECONDS, MAX_FILES, MAX_MB),
}
