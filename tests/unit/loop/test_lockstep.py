"""Lockstep: what a controller's timing does to a stop, and what the daemon says of a sound train in it."""

import pytest

from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.make import make_controller
from sim_ecu.loop.judge import Figures, judge
from sim_ecu.loop.lockstep import ON_TIME, Lockstep, Timing, ride
from sim_ecu.loop.scenario import load_drive_scenario
from sim_ecu.loop.suites import cases
from wrcd.config import load_packaged
from wrcd.estimator.doubts import Doubt


def stop(timing: Timing = ON_TIME) -> Figures:
    scenario, daemon = load_drive_scenario("brake-greasy"), load_packaged(1)
    controller = make_controller("thresholds", Facts.of(scenario), daemon)
    return judge(ride(scenario, controller, daemon, timing=timing), scenario)


def test_demands_that_come_later_wear_more_and_stop_as_short() -> None:
    at_once, late = stop(), stop(Timing(phase_us=5000, delay_us=5000))
    assert late.slip_energy_kJ > 1.2 * at_once.slip_energy_kJ
    assert late.max_slip_m_s > at_once.max_slip_m_s
    assert late.stop_m == pytest.approx(at_once.stop_m, rel=0.05)


def test_sound_pair_of_a_slow_stop_on_low_rail_is_not_called_reversed() -> None:
    """Below 10 m/s it goes together no more than it goes against each other."""
    (case,) = cases("braking", "low, known before")
    scenario, daemon = case.scenario(0), load_packaged(1)
    run = Lockstep(scenario, make_controller("thresholds", Facts.of(scenario), daemon), daemon)
    assert run.core is not None
    doubts = set()
    while not run.over:
        run.step()
        doubts.add(Doubt(run.core.estimator.identity.doubt[0]))
    assert Doubt.REVERSED not in doubts
