import math

import pytest

from wrcd.bus.units import Quantity, factor


@pytest.mark.parametrize(
    ("unit", "quantity", "expected"),
    [
        ("rad/s", Quantity.YAW_RATE, 1.0),
        ("deg/s", Quantity.YAW_RATE, math.pi / 180),
        ("°/s", Quantity.YAW_RATE, math.pi / 180),
        ("m/s²", Quantity.LAT_ACCEL, 1.0),
        ("m/s^2", Quantity.LAT_ACCEL, 1.0),
        ("m/s/s", Quantity.LAT_ACCEL, 1.0),
        ("g", Quantity.LAT_ACCEL, 9.80665),
        ("m/sec^2", Quantity.LAT_ACCEL, 1.0),
        ("mg", Quantity.LAT_ACCEL, 9.80665e-3),
        *(
            (unit, Quantity.YAW_RATE, math.pi / 180)
            for unit in ("dps", "Grad/s", "deg/sec", "º/s", "degrees/s", "DEG/S")
        ),
        *((unit, Quantity.SPEED, 1 / 3.6) for unit in ("kph", "kmh", "km/hr", "kmph", "[km/h]")),
        *((unit, Quantity.TORQUE, 1000.0) for unit in ("kN·m", "kNm", "kN m", "kN*m")),
        ("mi/h", Quantity.SPEED, 0.44704),
        ("N·m", Quantity.TORQUE, 1.0),
        ("Nm", Quantity.TORQUE, 1.0),
        ("kN.m", Quantity.TORQUE, 1000.0),
        ("km/h", Quantity.SPEED, 1 / 3.6),
        ("mph", Quantity.SPEED, 0.44704),
        ("kN", Quantity.AXLE_LOAD, 1000.0),
        ("t", Quantity.AXLE_LOAD, 9806.65),
        ("mm", Quantity.WHEEL_RADIUS, 1e-3),
        (None, Quantity.DIRECTION, 1.0),
    ],
)
def test_unit_text_has_its_si_factor(unit: str | None, quantity: Quantity, expected: float) -> None:
    assert factor(unit, quantity) == pytest.approx(expected)


@pytest.mark.parametrize("unit", ["m/s", "parsec", None, "V"])
def test_unit_of_another_quantity_is_an_error(unit: str | None) -> None:
    with pytest.raises(ValueError, match="cannot be converted to N m"):
        factor(unit, Quantity.TORQUE)
