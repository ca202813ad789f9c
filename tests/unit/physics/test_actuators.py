"""Drive and pneumatic brake against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.physics.actuators import Actuators, AxleActuators, Drive, Pneumatics, Valve

STEP_S = 0.005
ANY = 1e9  # no rate limit
SLOW = Drive(rise_N_m_s=ANY, fall_N_m_s=ANY, lag_s=0.1)
MOST = 25_000.0


def drive(actuators: Actuators, wanted: list[float], electric: float = MOST, step_s: float = STEP_S) -> list[float]:
    axle, out = AxleActuators(actuators, step_s), []
    for torque in wanted:
        axle.step(torque, Valve.FILL, 0.0, electric)
        out.append(axle.drive_N_m)
    return out


def pressures(actuators: Actuators, valves: list[Valve], asked: float, start: float = 0.0) -> list[float]:
    axle, out = AxleActuators(actuators, STEP_S), []
    axle.pressure_bar = start
    for valve in valves:
        axle.step(0.0, valve, asked, 0.0)
        out.append(axle.pressure_bar)
    return out


@pytest.mark.parametrize("step_s", [0.001, 0.005, 0.02])
@pytest.mark.parametrize("wanted", [10_000.0, -10_000.0])
def test_drive_follows_a_step_as_a_lag_of_first_order(wanted: float, step_s: float) -> None:
    n = round(0.3 / step_s)
    t = np.arange(1, n + 1) * step_s
    assert drive(Actuators(SLOW), [wanted] * n, step_s=step_s) == pytest.approx(wanted * (1 - np.exp(-t / 0.1)))


def test_torque_grows_and_falls_at_its_rates_and_changes_its_sign_at_both() -> None:
    """60 kN m/s up, 180 down: from 9 kN m to -9 in 50 ms and 150."""
    a = Actuators(Drive(lag_s=0.0, rise_N_m_s=60e3, fall_N_m_s=180e3))
    up = drive(a, [9000.0] * 40)
    assert up[:31] == pytest.approx([min(300.0 * k, 9000.0) for k in range(1, 32)])
    through = np.array(drive(a, [9000.0] * 40 + [-9000.0] * 45))[40:]
    t = np.arange(1, 46) * STEP_S
    expected = np.where(t < 0.05, 9000.0 - 180e3 * t, np.maximum(-60e3 * (t - 0.05), -9000.0))
    assert through == pytest.approx(expected, abs=1e-6)
    back = np.array(drive(a, [-9000.0] * 40 + [9000.0] * 45))[40:]
    assert back == pytest.approx(-expected, abs=1e-6)


def test_step_that_ends_beyond_zero_uses_both_rates() -> None:
    """From 450 N m: half of a step of 5 ms to zero at 180 kN m/s, the other half at 60."""
    a = Actuators(Drive(lag_s=0.0, rise_N_m_s=60e3, fall_N_m_s=180e3))
    axle = AxleActuators(a, STEP_S)
    axle.drive_N_m = 450.0
    axle.step(-9000.0, Valve.FILL, 0.0, MOST)
    assert axle.drive_N_m == pytest.approx(-150.0)


@pytest.mark.parametrize(
    ("wanted", "electric", "held"), [(9e9, 0.0, 25_000.0), (-9e9, 12_000.0, -12_000.0), (-5.0, 0.0, 0.0)]
)
def test_drive_gives_no_more_than_it_has_or_may(wanted: float, electric: float, held: float) -> None:
    assert drive(Actuators(), [wanted] * 400, electric)[-1] == pytest.approx(held, rel=1e-3, abs=1e-6)


def test_traction_is_full_up_to_its_power_then_falls_and_ends_at_the_cut_out() -> None:
    d = Drive(max_traction_N_m=20e3, max_power_kW=500.0, cut_out_m_s=40.0)
    told = [d.traction_N_m(v, 0.5) for v in (-3.0, 0.0, 12.5, 25.0, 40.0, 40.1)]
    assert told == pytest.approx([20e3, 20e3, 20e3, 10e3, 6250.0, 0.0])
    axle = AxleActuators(Actuators(replace(d, lag_s=0.0, rise_N_m_s=ANY)), STEP_S)
    axle.step(9e9, Valve.FILL, 0.0, MOST, 10e3)
    assert axle.drive_N_m == 10e3


def test_cylinder_fills_and_vents_with_its_time_constants_after_the_delay() -> None:
    p = Pneumatics(valve_delay_s=0.03, fill_s=0.25, vent_s=0.15)
    a = Actuators(pneumatics=p)
    t = np.arange(1, 101) * STEP_S
    assert pressures(a, [Valve.FILL] * 100, 3.0) == pytest.approx(3.0 * (1 - np.exp(-t / 0.25)))
    late = np.maximum(t - 0.03, 0.0)
    assert pressures(a, [Valve.VENT] * 100, 3.0, 3.0) == pytest.approx(3.0 * np.exp(-late / 0.15))


def test_hold_keeps_the_pressure_and_less_asked_is_vented() -> None:
    a = Actuators(pneumatics=Pneumatics(valve_delay_s=0.01, fill_s=0.25, vent_s=0.15))
    held = pressures(a, [Valve.FILL] * 20 + [Valve.HOLD] * 30, 3.0)
    assert len(set(held[22:])) == 1
    assert 0.5 < held[-1] < 2.0
    t = np.arange(1, 51) * STEP_S
    released = pressures(a, [Valve.FILL] * 50, 1.0, 3.0)
    assert released == pytest.approx(1.0 + 2.0 * np.exp(-t / 0.15))


def test_friction_torque_is_that_of_the_pressure_and_an_empty_cylinder_has_none() -> None:
    a = Actuators(pneumatics=Pneumatics(torque_per_bar_N_m=5000.0, valve_delay_s=0.0))
    axle = AxleActuators(a, STEP_S)
    for _ in range(10):
        torque = axle.step(0.0, Valve.FILL, 2.0, 0.0)
    assert -torque == axle.friction_N_m == pytest.approx(5000.0 * axle.pressure_bar)
    for _ in range(1000):
        torque = axle.step(0.0, Valve.VENT, 2.0, 0.0)
    assert torque == axle.friction_N_m == 0.0


@pytest.mark.parametrize("share", [0.3, 1.0])
@pytest.mark.parametrize("max_brake", [0.0, 8000.0, 25_000.0])
def test_electric_and_pneumatic_brake_make_the_asked_torque_together(share: float, max_brake: float) -> None:
    a = Actuators(Drive(max_brake_N_m=max_brake, fades_m_s=4.0))
    for speed in np.linspace(0.0, 20.0, 41):
        electric = a.electric_N_m(share, float(speed))
        friction = a.demand_bar(share, float(speed)) * a.pneumatics.torque_per_bar_N_m
        assert electric + friction == pytest.approx(share * a.full_brake_N_m)
        assert 0.0 <= electric <= max_brake
    whole = min(share * a.full_brake_N_m, max_brake)
    told = [a.electric_N_m(share, v) for v in (20.0, 4.0, 3.0, 2.0, 0.0)]
    assert told == pytest.approx([whole, whole, 0.5 * whole, 0.0, 0.0])
    assert a.demand_bar(share, 20.0, electric=False) == pytest.approx(share * a.full_brake_N_m / 6000.0)


def test_pressure_asked_ends_at_the_highest() -> None:
    a = Actuators(Drive(max_brake_N_m=0.0), Pneumatics(max_bar=3.0))
    assert a.demand_bar(1.0, 20.0) == 3.0
    assert math.isclose(a.demand_bar(0.5, 20.0), 11_000.0 / 6000.0)


def test_brake_that_never_fades_is_whole_at_standstill() -> None:
    assert Actuators(Drive(fades_m_s=0.0)).electric_N_m(0.5, 0.0) == 11_000.0
