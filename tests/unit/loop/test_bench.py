"""The public Python interface of the rig."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.bench import Adhesion, Bench, InputError, Timing, Valve, scenario
from sim_ecu.loop.control.adhesion_consumer import Unprotected
from sim_ecu.loop.drive_scenario import load_drive_scenario
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.ride_figures import Figures
from tests.support.loop_wire import TIMINGS, stop_in_lockstep

PAGES = Path(__file__).parents[3] / "docs/how-to"
WET = scenario(rail="C", demand=-1.0, speed_m_s=10.0, duration_s=1.0)


def blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", (PAGES / "script-the-rig.md").read_text(), re.DOTALL)


def bench_of(script: str) -> Bench:
    """What a script of the page's own words has made."""
    names: dict[str, object] = {}
    exec(script, names)
    bench = names["bench"]
    assert isinstance(bench, Bench)
    return bench


def test_script_of_the_page_stops_the_train_before_a_locked_wheel_does(capsys: pytest.CaptureFixture[str]) -> None:
    bench = bench_of(blocks()[0])
    figures = bench.figures()
    assert figures.stopped
    assert figures.max_slip_m_s < 1.0
    before_m = bench.steps[-1].distance_m - figures.stop_m
    locked = Bench("emergency-greasy", controller="none")
    enough = (step for step in locked if step.distance_m > before_m + figures.stop_m / 0.9 + 1.0)
    assert next(enough).speed_m_s > locked.scenario.stop_m_s  # it is that far, and still rolls
    assert capsys.readouterr().out.startswith("Figures(slides=")


def test_other_scripts_of_the_page_make_what_they_say() -> None:
    bench = bench_of(blocks()[1])
    bench.run(0.1)
    assert [f.kind for f in bench.scenario.train.faults] == ["freeze"]


def test_bench_with_a_controller_gives_the_steps_of_the_lockstep_run() -> None:
    s = load_drive_scenario("traction-wet-start")
    theirs = [step for step, _ in zip(Lockstep(s, Unprotected(s.axles, s.actuators), None), range(60), strict=False)]
    bench = Bench("traction-wet-start", controller="none")
    bench.run(0.3)
    assert len(bench.steps) == 60
    assert [s.distance_m for s in bench.steps] == [s.distance_m for s in theirs]
    assert bench.column("torque_N_m").tolist() == [s.torque_N_m.tolist() for s in theirs]


def test_demand_is_held_until_it_is_set_again() -> None:
    bench = Bench(WET)
    bench.demand(1, torque_N_m=-5000.0, valve=Valve.VENT)
    bench.run(0.5)
    assert bench.truth(1).torque_N_m == pytest.approx(-5000.0, rel=0.01)
    assert bench.silences(1) == (0, 0.0)
    bench.demand(1, torque_N_m=0.0, valve=Valve.VENT)
    bench.run(0.4)
    assert abs(bench.truth(1).torque_N_m) < 20.0


@pytest.mark.parametrize(("number", "valve"), [(0, Valve.FILL), (1, Valve.HOLD), (2, Valve.VENT)])
def test_valve_as_a_number_is_the_valve(number: int, valve: Valve) -> None:
    pressures = []
    given: Any  # as a script in a hurry writes it
    for given in (number, valve):
        bench = Bench(scenario("emergency-wet", demand=-1.0, actuators={"drive": {"max_brake_N_m": 0.0}}))
        bench.demand(1, 0.0, Valve.FILL)
        bench.run(0.2)
        bench.demand(1, 0.0, given)
        bench.run(0.3)
        pressures.append(bench.truth(1).pressure_bar)
    assert pressures[0] == pressures[1]
    assert (pressures[0] > 2.5) is (valve is Valve.FILL)
    assert (pressures[0] < 0.5) is (valve is Valve.VENT)


def test_frame_may_be_used_for_three_cycles_of_its_configuration() -> None:
    told = Adhesion("Valid", 0.2, 0.1, 0.05, None, None, age_s=0.13, max_age_s=0.15)
    assert told.valid
    assert not replace(told, age_s=0.16).valid
    bench = Bench(WET, daemon=True)
    bench.run(0.1)
    said = bench.adhesion(1)
    assert said is not None
    assert said.max_age_s == pytest.approx(0.06)  # as packaged


def test_script_of_the_page_brakes_in_full_without_a_daemon_that_may_be_used() -> None:
    script = blocks()[0].replace('"emergency-greasy"', 'scenario("emergency-greasy", demand=-0.3, duration_s=0.5)')
    bench = bench_of(script.replace("import Bench", "import Bench, scenario"))  # the daemon has just begun
    assert bench.adhesion(1) is not None
    assert bench.truth(1).torque_N_m == pytest.approx(-0.3 * bench.full_brake_N_m, rel=0.05)


def test_axle_without_a_demand_brakes_as_the_driver_asks_and_is_counted() -> None:
    bench = Bench(scenario(rail="A", demand=-0.5, speed_m_s=20.0, duration_s=2.0))
    bench.run()
    asked = 0.5 * bench.full_brake_N_m
    assert bench.truth(1).torque_N_m == pytest.approx(-asked, rel=0.01)
    times, seconds = bench.silences(1)
    assert (times, round(seconds, 2)) == (1, 1.97)
    assert bench.truth(1).pressure_bar * 6000.0 == pytest.approx(asked, rel=0.01)


def test_sensors_read_what_is_true_with_their_noise() -> None:
    bench = Bench(WET)
    assert bench.sensors(1).vehicle_speed_m_s is None
    bench.run(0.5)
    said, true = bench.sensors(1), bench.truth(1)
    assert said.vehicle_speed_m_s == pytest.approx(true.speed_m_s, abs=0.05)
    assert said.wheel_speed_m_s == pytest.approx(true.wheel_m_s, abs=0.1)
    assert said.pressure_bar == pytest.approx(true.pressure_bar, abs=0.05)
    assert said.torque_N_m == pytest.approx(true.torque_N_m, abs=300.0)
    assert abs(said.yaw_rate_rad_s or 9.0) < 0.5
    assert abs(said.lateral_acceleration_m_s2 or 99.0) < 10.0


def test_adhesion_is_a_ratio_with_its_validity_and_age() -> None:
    bench = Bench(scenario(rail="C", demand=-0.5, speed_m_s=20.0, duration_s=5.0), daemon=True)
    assert bench.adhesion(1) is None
    bench.demand(1, torque_N_m=-9000.0)
    bench.run(0.2)
    early = bench.adhesion(1)
    assert early is not None
    assert (early.validity, early.valid, early.mu_available) == ("NotAvailable", False, None)
    bench.run()
    late = bench.adhesion(1)
    assert late is not None
    assert late.valid
    assert late.mu_available == pytest.approx(bench.truth(1).mu_available, abs=0.15)
    assert late.mu_used == pytest.approx(9000.0 / bench.unit_adhesion_N_m, abs=0.005)


def test_daemon_with_a_configuration_of_its_own_names_is_heard() -> None:
    config = Path(__file__).parents[3] / "examples/own-dbc/train.toml"
    bench = Bench(scenario(rail="A", demand=0.1, speed_m_s=20.0, duration_s=1.0), daemon=config)
    bench.run()
    assert bench.adhesion(1) is not None


def test_frames_are_told_with_times_that_do_not_fall() -> None:
    frames: list[tuple[int, int, bytes]] = []
    bench = Bench(WET, daemon=True, controller="none", on_frame=lambda *f: frames.append(f))
    bench.run(0.2)
    ids = {can_id for _, can_id, _ in frames}
    assert {0x101, 0x111, 0x121, 0x130, 0x131, 0x141, 0x151, 0x161, 0x091} <= ids
    assert max(0x7A0, *ids) == 0x7A0  # the truth is nobody's


def test_same_calls_give_the_same_numbers() -> None:
    def once() -> tuple[Figures, list[float]]:
        bench = Bench(WET, daemon=True, controller="thresholds")
        return bench.run(), np.ravel(bench.column("slip_m_s")).tolist()

    assert once() == once()


def test_packaged_scenario_with_keys_keeps_the_rest() -> None:
    s = scenario("brake-wet", seed=9, duration_s=3.0)
    theirs = load_drive_scenario("brake-wet")
    assert (s.train.duration_s, s.driver) == (3.0, theirs.driver)
    assert s.train.axles[0].seed != theirs.train.axles[0].seed


@pytest.mark.night
def test_page_says_what_timing_makes_of_a_stop() -> None:
    page = (PAGES / "close-the-loop.md").read_text()
    said = re.findall(r"(\d+) kJ(?: slip energy)? and (\d+) m", page)
    found = [stop_in_lockstep(timing) for timing in TIMINGS]
    assert said == [(f"{f.slip_energy_kJ:.0f}", f"{f.stop_m:.0f}") for f in found]


@pytest.mark.parametrize(("key", "us"), [("phase_us", 10_000), ("phase_us", 2_500), ("delay_us", -5_000)])
def test_timing_between_samples_or_beyond_the_cycle_is_refused(key: str, us: int) -> None:
    with pytest.raises(InputError, match=key):
        Timing(**{key: us})
