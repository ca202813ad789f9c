"""Effort shared by axle: the shares themselves, what the rig's drives give of them, and stops on two rails."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.shared_effort import CARRIED_SHARE, carried_N_m, shared_effort
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.drive_scenario import NO_DRIVE, DriveScenario
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.mark.lines import actuators
from sim_ecu.loop.ride_figures import judge
from sim_ecu.loop.rig import Rig
from sim_ecu.loop.rig_messages import rig_message
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.contact import curve_between
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import SPECTRA
from sim_ecu.play.encoder import Channel
from sim_ecu.play.scenario import AxleScenario, Course, Scenario, positions_m
from sim_ecu.play.vehicles import DEFAULT_VEHICLE, load_vehicle
from wrcd.config.config import load_packaged

AMOUNT = st.floats(0.0, 30_000.0)


@given(AMOUNT, st.lists(st.tuples(st.none() | AMOUNT, AMOUNT), min_size=1, max_size=8))
def test_sum_and_limits_are_kept_and_unknown_axles_keep_the_demand(
    demand_N_m: float, axles: list[tuple[float | None, float]]
) -> None:
    asked = shared_effort(demand_N_m, [carried for carried, _ in axles], [most for _, most in axles])
    assert sum(asked) == pytest.approx(len(axles) * demand_N_m, abs=1e-6)
    for torque, (carried, most) in zip(asked, axles, strict=True):
        if carried is None:
            assert torque == demand_N_m
        elif torque > demand_N_m:
            assert torque <= min(carried, most) + 1e-6
        else:
            assert torque >= min(carried, demand_N_m) - 1e-6


def test_what_one_axle_lacks_goes_where_there_is_room() -> None:
    assert shared_effort(100.0, [40.0, 200.0], [150.0, 150.0]) == pytest.approx([50.0, 150.0])
    assert shared_effort(100.0, [40.0, 200.0], [900.0, 900.0]) == pytest.approx([40.0, 160.0])
    # in proportion: to what is lacking, and to the room
    assert shared_effort(100.0, [70.0, 40.0, 110.0, 120.0], [900.0] * 4) == pytest.approx([90.0, 80.0, 110.0, 120.0])


@pytest.mark.parametrize(
    "carried",
    [[40.0, 100.0], [40.0, None], [150.0, 120.0], [None, 150.0], [40.0, 30.0]],
    ids=["no room", "room not known", "each carries it", "lack not known", "none carries it"],
)
def test_with_nothing_to_share_each_has_the_demand(carried: list[float | None]) -> None:
    assert shared_effort(100.0, carried, [900.0, 900.0]) == [100.0, 100.0]


def test_an_axle_is_trusted_with_a_share_of_the_lower_end() -> None:
    assert carried_N_m(0.15, 0.05, 1000.0) == pytest.approx(CARRIED_SHARE * 100.0)
    assert carried_N_m(0.04, 0.05, 1000.0) == 0.0


def test_both_brakes_give_no_more_than_the_drive_and_the_drivers_pressure() -> None:
    a = Actuators(full_brake_N_m=30_000.0)
    assert a.most_brake_N_m(0.5, 20.0) == a.drive.max_brake_N_m  # no pressure: the drive has it all
    assert a.most_brake_N_m(1.0, 20.0) == pytest.approx(30_000.0)
    assert a.most_brake_N_m(0.5, 0.0) == pytest.approx(15_000.0)  # the cylinder alone


def scenario(frictions: tuple[float, float], seed: int) -> DriveScenario:
    """A bogie whose axles run on rails of their own. Little braking for 3.5 s at 20 m/s, then 0.9 m/s2 to a stop."""
    w = load_vehicle(DEFAULT_VEHICLE)
    axles = tuple(
        AxleScenario(k + 1, rail_table([RailSection(0.0, curve_between(mu_0))]), NO_DRIVE, SPECTRA["good"],
                     SENSOR_SETS["mems"], 16 * seed + k, at, 16 * seed)
        for k, (at, mu_0) in enumerate(zip(positions_m(w)[:2], frictions, strict=True))
    )  # fmt: skip
    train = Scenario("two rails", "", 60.0, Course((0.0,), (20.0,)), False, w, axles)
    return DriveScenario(train, Course((0.0, 3.5, 3.6), (-0.05, -0.05, -0.75)), actuators(w), stop_m_s=0.5)


@pytest.mark.parametrize(("shared", "brake", "gives"), [(1, 0.5, 2.0), (0, 0.5, 1.0), (1, 0.0, 0.0)])
def test_drive_gives_more_than_the_drivers_share_only_to_a_shared_demand(
    shared: int, brake: float, gives: float
) -> None:
    """gives: torque over what the driver demands at half the brake."""
    dry = replace(scenario((0.5, 0.5), 1), stop_m_s=0.0)
    rig, channel = Rig(dry, []), Channel(rig_message("Demand_A1"))
    rig.set_share(-brake)
    half_N_m = 0.5 * dry.actuators.full_brake_N_m
    for _ in range(200):
        if rig.time_us % channel.every_us == 0:
            f = channel.encode(rig.time_us, {"Torque": -2.0 * half_N_m, "Shared": shared})
            rig.hear(f.can_id, f.data, rig.time_us)
        step = rig.step()
    assert -step.torque_N_m[0] == pytest.approx(gives * half_N_m, rel=0.01, abs=1.0)


def stop_m(shares_effort: bool) -> float:
    """Way of a stop with the daemon's own core: axle 1 on a film, axle 2 on wet rail."""
    two_rails = scenario((0.05, 0.3), 1)
    config = load_packaged(2)
    controller = make_controller("thresholds", Facts.of(two_rails), config, shares_effort=shares_effort)
    return judge(Lockstep(two_rails, controller, config), two_rails).stop_m


def test_sharing_shortens_a_stop_where_one_rail_bears_more() -> None:
    """Four seeds differ by 2.5 % without sharing; sharing takes off 9 to 13 %."""
    assert stop_m(shares_effort=True) < 0.95 * stop_m(shares_effort=False)
