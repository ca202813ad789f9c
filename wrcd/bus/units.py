"""Unit texts of a DBC to SI units."""

import math
from enum import Enum

G = 9.80665


class Quantity(Enum):
    """What a signal can carry: the key of the configuration, the SI unit, and what no railway vehicle exceeds."""

    YAW_RATE = ("yaw_rate", "rad/s", 20.0)
    LAT_ACCEL = ("lateral_acceleration", "m/s2", 200.0)
    TORQUE = ("torque", "N m", 1e6)
    SPEED = ("speed", "m/s", 200.0)
    BRAKE_TORQUE = ("brake_torque", "N m", 1e6)
    AXLE_LOAD = ("axle_load", "N", 1e6)
    DIRECTION = ("direction", "1", 1e9)
    WHEEL_RADIUS = ("wheel_radius", "m", 2.0)

    def __init__(self, key: str, unit: str, limit: float) -> None:
        self.key, self.unit, self.limit = key, unit, limit

    @property
    def words(self) -> str:
        """The key as a person reads it: yaw rate."""
        return self.key.replace("_", " ")


_FACTORS: dict[str, dict[str, float]] = {
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180, "mrad/s": 1e-3, "rpm": math.pi / 30, "1/min": math.pi / 30},
    "m/s2": {"m/s2": 1.0, "g": G, "mg": G * 1e-3, "mm/s2": 1e-3, "cm/s2": 1e-2},
    "N m": {"nm": 1.0, "knm": 1e3},
    "m/s": {"m/s": 1.0, "km/h": 1 / 3.6, "cm/s": 1e-2, "mm/s": 1e-3, "mph": 0.44704},
    "N": {"n": 1.0, "kn": 1e3, "kg": G, "t": 1e3 * G},
    "1": {"": 1.0, "1": 1.0},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
}
_SPELLINGS = {
    **dict.fromkeys(("°/s", "º/s", "˚/s", "dps", "degps", "degree/s", "degrees/s", "grad/s", "°ps"), "deg/s"),
    **dict.fromkeys(("rps", "radps", "radian/s", "radians/s"), "rad/s"),
    **dict.fromkeys(("kph", "kmh", "kmph", "km/hr", "kmperh"), "km/h"),
    **dict.fromkeys(("mi/h", "miles/h"), "mph"),
    **dict.fromkeys(("g0", "gee", "gn"), "g"),
    **dict.fromkeys(("m/ss", "mps2"), "m/s2"),
    "mps": "m/s",
}


def factor(unit: str | None, quantity: Quantity) -> float:
    """Factor from a DBC's unit text to the quantity's SI unit. Raises ValueError where the text can't be converted."""
    known = _FACTORS[quantity.unit]
    text = plain_unit(unit or "")
    if text in known:
        return known[text]
    readable = ", ".join(k or "no unit" for k in known)
    raise ValueError(f"unit {unit or ''!r} cannot be converted to {quantity.unit} (known: {readable})")


def plain_unit(unit: str) -> str:
    """One spelling: no blanks, dots or brackets, lower case, 2 for a square."""
    text = unit.strip().lower().replace("²", "2").replace("^2", "2").replace("**2", "2").replace("/s/s", "/s2")
    for mark in (" ", ".", "·", "*", "⋅", "[", "]", "(", ")"):
        text = text.replace(mark, "")
    text = text.replace("/second", "/s").replace("/sec", "/s").replace("/sek", "/s")
    return _SPELLINGS.get(text, text)
