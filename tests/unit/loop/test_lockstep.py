"""Lockstep: what a controller's timing does to a stop, and what the daemon says of a sound train in it."""

import re
from pathlib import Path

import pytest

from sim_ecu.bench import InputError, Timing
from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.suites import cases
from tests.support.loop_wire import TIMINGS, stop_in_lockstep
from wrcd.config.config import load_packaged
from wrcd.estimator.doubts import Doubt

PAGE = Path(__file__).parents[3] / "docs/how-to/close-the-loop.md"


@pytest.mark.night
def test_page_says_what_timing_makes_of_a_stop() -> None:
    said = re.findall(r"(\d+) kJ(?: slip energy)? and (\d+) m", PAGE.read_text())
    found = [stop_in_lockstep(timing) for timing in TIMINGS]
    assert said == [(f"{f.slip_energy_kJ:.0f}", f"{f.stop_m:.0f}") for f in found]


@pytest.mark.parametrize(("key", "us"), [("phase_us", 10_000), ("phase_us", 2_500), ("delay_us", -5_000)])
def test_timing_between_samples_or_beyond_the_cycle_is_refused(key: str, us: int) -> None:
    with pytest.raises(InputError, match=key):
        Timing(**{key: us})


def test_sound_pair_of_a_slow_stop_on_low_rail_is_not_called_reversed() -> None:
    """Below 10 m/s it goes together no more than it goes against each other."""
    (case,) = cases("braking", "low, known before")
    scenario, daemon = case.scenario(0), load_packaged(1)
    run = Lockstep(scenario, make_controller("thresholds", Facts.of(scenario), daemon), daemon)
    assert run.core is not None
    doubts = set()
    for _ in run:
        doubts.add(Doubt(run.core.estimator.identity.doubt[0]))
    assert Doubt.REVERSED not in doubts
