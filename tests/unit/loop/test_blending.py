"""A torque carried out by drive and cylinder, against the rig's own actuators."""

import pytest

from sim_ecu.loop.control.blending import Blending
from sim_ecu.loop.control.facts import Facts
from sim_ecu.physics.actuators import Actuators, AxleActuators, Drive, Valve
from sim_ecu.physics.wheelset import Wheelset

SPEED = 20.0
ELECTRIC, PNEUMATIC = Actuators(), Actuators(Drive(max_brake_N_m=0.0))
BLENDED = Actuators(Drive(max_brake_N_m=10_000.0))


def settled(actuators: Actuators, torque_N_m: float, share: float, braking: bool = True) -> tuple[float, float, float]:
    """(what the rig gives, what the blending thinks, share of the drive in it), after two seconds."""
    blending = Blending(Facts.of_wheelset((1,), Wheelset(), actuators), 0.01)
    rig, given = AxleActuators(actuators, 0.005), 0.0
    for _ in range(200):
        drive, valve = blending.step(torque_N_m, share, braking, SPEED)
        brake = share if braking else 0.0
        for _ in range(2):
            given = rig.step(drive, valve, actuators.asked_bar(brake, SPEED), actuators.electric_N_m(brake, SPEED))
        blending.hear(rig.pressure_bar)
    return abs(given), blending.actual_N_m, abs(rig.drive_N_m)


@pytest.mark.parametrize("actuators", [ELECTRIC, PNEUMATIC, BLENDED])
@pytest.mark.parametrize("torque", [22_000.0, 15_000.0, 6000.0, 0.0])
def test_brake_gives_the_wanted_torque(actuators: Actuators, torque: float) -> None:
    given, thought, _ = settled(actuators, torque, 1.0)
    assert given == pytest.approx(torque, abs=700.0)
    assert thought == pytest.approx(given, abs=50.0)


def test_traction_is_the_drives() -> None:
    assert settled(BLENDED, 18_000.0, 0.9, braking=False)[0] == pytest.approx(18_000.0, rel=0.01)


def test_drive_takes_the_reduced_torque_before_the_cylinder() -> None:
    given, _, drive = settled(BLENDED, 9000.0, 1.0)
    assert drive == pytest.approx(given, abs=700.0)


def test_unlimited_brake_leaves_the_valve_to_the_brake_control() -> None:
    blending = Blending(Facts.of_wheelset((1,), Wheelset(), PNEUMATIC), 0.01)
    assert blending.step(22_000.0, 1.0, True, SPEED) == (0.0, Valve.FILL)


def test_cylinder_too_full_is_vented_and_held_where_it_is_right() -> None:
    blending = Blending(Facts.of_wheelset((1,), Wheelset(), PNEUMATIC), 0.01)
    blending.hear(3.0)
    assert blending.step(6000.0, 1.0, True, SPEED)[1] is Valve.VENT
    blending = Blending(Facts.of_wheelset((1,), Wheelset(), PNEUMATIC), 0.01)
    for _ in range(5):
        blending.hear(3.0)
        valve = blending.step(18_000.0, 1.0, True, SPEED)[1]
    assert valve is Valve.HOLD
