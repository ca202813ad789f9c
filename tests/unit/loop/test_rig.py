"""The rig's plant on the bus: demands, their silence, faults on the way; sensors one by one."""

from collections.abc import Callable

import numpy as np
import pytest

from sim_ecu.bench import scenario
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.rig import ALL, LOOP, TRUTH, WRCD, Rig, Step
from sim_ecu.loop.rig_messages import rig_message
from sim_ecu.physics.actuators import Valve
from sim_ecu.physics.sensors import Sensor
from sim_ecu.physics.simulation import Simulation
from sim_ecu.play.encoder import Channel, Sent, databases
from sim_ecu.play.player import Sensing, on_tracks

DRY = scenario(rail="A", demand=-0.5, speed_m_s=20.0, duration_s=3.0)


def driven(
    s: DriveScenario, steps: int, torque: float = 0.0, valve: Valve = Valve.VENT,
    sent: Callable[[int], bool] = lambda _: True,
) -> tuple[Rig, list[Step]]:  # fmt: skip
    """A rig whose axles hear a demand every 10 ms, where `sent` says so of the time (us)."""
    rig = Rig(s, ALL)
    channels = [Channel(rig_message(f"Demand_A{n}")) for n in s.axles]
    out = []
    for _ in range(steps):
        out.append(rig.step())
        if rig.time_us % 10_000 == 0 and sent(rig.time_us):
            for c in channels:
                rig.hear(c.can_id, c.encode(rig.time_us, {"Torque": torque, "Valve": valve}).data, rig.time_us)
    return rig, out


def test_silent_demand_ends_the_drive_and_fills_the_brake_after_30_ms() -> None:
    rig, steps = driven(DRY, 400, -6000.0, sent=lambda t: not 1_000_000 < t < 1_500_000)
    torque = np.array([s.torque_N_m[0] for s in steps])
    pressure = np.array([s.pressure_bar[0] for s in steps])
    assert torque[205] == pytest.approx(-6000.0, rel=0.01)  # 1.030 s: the last demand still holds
    asked = 0.5 * DRY.actuators.full_brake_N_m
    assert pressure[205] < 0.01
    # the drive's has ended by then, the cylinder fills: 0.44 s less the valve's delay
    assert torque[299] == pytest.approx(-asked * (1 - np.exp(-0.44 / 0.25)), rel=0.03)
    assert pressure[299] * 6000.0 == pytest.approx(-torque[299], rel=0.02)
    assert pressure[-1] < 0.2  # and given back
    assert torque[-1] == pytest.approx(-6000.0, rel=0.1)
    assert [s.silences for s in rig.silences] == [1]
    assert rig.silences[0].silent_us == pytest.approx(470_000, abs=5000)


def test_silent_demand_ends_traction_and_does_not_brake_a_driver_who_does_not() -> None:
    s = scenario(rail="A", demand=0.5, speed_m_s=20.0, duration_s=3.0)
    _, steps = driven(s, 400, 9000.0, Valve.FILL, lambda t: t < 1_000_000)
    torque = [float(x.torque_N_m[0]) for x in steps]
    assert torque[190] == pytest.approx(9000.0, rel=0.01)
    assert torque[-1] == pytest.approx(0.0, abs=20.0)
    assert max(float(x.pressure_bar[0]) for x in steps) == 0.0


def test_traction_that_is_demanded_while_the_driver_brakes_is_none() -> None:
    _, steps = driven(DRY, 100, 80_000.0)
    assert max(float(x.torque_N_m[0]) for x in steps) <= 0.0


def test_spinning_wheel_has_no_more_than_the_drives_power_and_stays_below_the_cut_out() -> None:
    limits = {"max_power_kW": 400.0, "cut_out_m_s": 30.0}
    s = scenario(rail="F", demand=1.0, speed_m_s=10.0, duration_s=4.0, actuators={"drive": limits})
    _, steps = driven(s, 600, 25_000.0)
    wheel, torque = (np.array([getattr(x, f)[0] for x in steps]) for f in ("wheel_m_s", "torque_N_m"))
    assert 29.0 < wheel.max() < 31.5
    assert torque.max() > 14_000.0
    power = (torque * wheel / 0.5)[100:] / 1e3
    assert 350.0 < power.max() < 440.0  # the torque follows the limit with the drive's lag
    assert np.any(torque[300:] < 1500.0)


def test_axle_alone_falls_silent_and_the_other_does_not() -> None:
    s = scenario(rail="A", demand=-0.5, speed_m_s=20.0, duration_s=1.0, axles=[1, 2])
    rig = Rig(s, [LOOP])
    channel = Channel(rig_message("Demand_A2"))
    for _ in range(100):
        rig.step()
        if rig.time_us % 10_000 == 0:
            sent = channel.encode(rig.time_us, {"Torque": -1000.0, "Valve": Valve.VENT})
            rig.hear(channel.can_id, sent.data, rig.time_us)
    assert [s.silences for s in rig.silences] == [1, 0]


def test_damaged_repeated_and_foreign_demands_are_no_demands() -> None:
    rig = Rig(DRY, [LOOP])
    channel = Channel(rig_message("Demand_A1"))
    good = channel.encode(10_000, {"Torque": -1000.0, "Valve": Valve.VENT}).data
    rig.hear(0x141, good[:-1], 10_000)
    rig.hear(0x141, bytes([good[0] ^ 1, *good[1:]]), 10_000)
    rig.hear(0x142, good, 10_000)
    heard = rig.demands[0x141]
    assert not heard.fresh(10_000)
    rig.hear(0x141, good, 10_000)
    rig.hear(0x141, good, 20_000)
    assert (heard.stamp_us, heard.rejected) == (10_000, {"length": 1, "CRC": 1, "repeated": 1, "counter": 0})


def test_unknown_valve_fills() -> None:
    rig = Rig(DRY, [LOOP])
    channel = Channel(rig_message("Demand_A1"))
    for _ in range(100):
        rig.step()
        if rig.time_us % 10_000 == 0:
            rig.hear(0x141, channel.encode(rig.time_us, {"Torque": 0.0, "Valve": 3}).data, rig.time_us)
    assert rig.demands[0x141].values["Valve"] == 3
    assert [s.silences for s in rig.silences] == [0]


def frames_of(s: DriveScenario) -> list[Sent]:
    return [f for step in driven(s, 200, -2000.0)[1] for f in step.frames]


@pytest.fixture(scope="module")
def sound() -> list[Sent]:
    """The frames without a fault."""
    return frames_of(DRY)


def test_frames_of_a_fault_that_never_comes_are_the_same(sound: list[Sent]) -> None:
    late = scenario(rail="A", demand=-0.5, speed_m_s=20.0, duration_s=3.0, fault=[{"kind": "crc", "at_s": 100.0}])
    assert sorted(frames_of(late)) == sorted(sound)


@pytest.mark.parametrize("kind", ["burst", "crc", "bias", "delay", "nan", "babble", "sender", "freeze"])
def test_fault_changes_the_sensors_frames_while_it_lasts_and_no_others(kind: str, sound: list[Sent]) -> None:
    fault = {"kind": kind, "at_s": 0.4, "duration_s": 0.3, "of": "yaw_rate"}
    s = scenario(rail="A", demand=-0.5, speed_m_s=20.0, duration_s=3.0, fault=[fault])
    other = set(frames_of(s)) ^ set(sound)
    assert other
    assert {f.due_us // 100_000 for f in other} <= {4, 5, 6, 7}
    assert not {f.can_id for f in other} & {0x131, 0x151, 0x161}


def test_bus_that_is_away_carries_nothing_either_way() -> None:
    fault = {"kind": "link-down", "at_s": 0.4, "duration_s": 0.3}
    s = scenario(rail="A", demand=-0.5, speed_m_s=20.0, duration_s=3.0, fault=[fault])
    rig, steps = driven(s, 200, -2000.0)
    dues = {f.due_us for step in steps for f in step.frames}
    assert not [t for t in dues if 400_000 <= t < 700_000]
    assert [s.silences for s in rig.silences] == [1]
    assert rig.silences[0].silent_us == pytest.approx(280_000, abs=10_000)


def test_frames_are_made_only_for_who_hears_them() -> None:
    for heard, first in ((LOOP, {1}), (WRCD, {1}), (TRUTH, {1, 7})):
        rig = Rig(DRY, [heard])
        ids = {f.can_id for _ in range(8) for f in rig.step().frames}
        assert {i >> 8 for i in ids} == first
        assert (0x151 in ids) is (heard == LOOP)


@pytest.mark.parametrize("demand", [-1.0, 1.0])
def test_speed_from_the_wheels_errs_where_all_slip_and_no_faster_than_full_effort(demand: float) -> None:
    s = scenario(rail="E", demand=demand, speed_m_s=15.0, duration_s=2.0, speed_of_wrcd="wheels")
    message = databases()[0].get_message_by_name("VehicleSpeed")
    rig = Rig(s, [WRCD])
    told, true = [], []
    rig.demand(1, demand * 22_000.0, Valve.VENT)
    for _ in range(400):
        step = rig.step()
        for f in step.frames:
            if f.can_id == message.frame_id:
                values = message.decode(f.data)
                assert isinstance(values, dict)
                assert isinstance(values["Speed"], float)
                told.append(values["Speed"])
                true.append(step.speed_m_s)
    assert told[0] == pytest.approx(15.0, abs=0.1)
    errors = np.sign(demand) * (np.array(told) - true)
    assert errors.max() > 1.0
    most = 1.2 * max(s.actuators.full_brake_N_m, s.actuators.drive.max_traction_N_m) / (0.5 * 15_000.0) + 0.3
    assert np.abs(np.diff(told)).max() < 0.02 * most + 0.05


@pytest.mark.parametrize(
    ("kind", "friction", "vibration"),
    [("mems", 0.0, 0.0), ("mems", 0.0, 0.5), ("mems", 0.3, 0.0), ("mems-8g", 0.3, 9.0)],
)
def test_one_sample_is_read_as_many_are(kind: str, friction: float, vibration: float) -> None:
    sensors = {"kind": kind, "torque_bias_N_m": 100.0, "friction_share": friction, "friction_gain": 0.5}
    s = scenario(
        rail="C", demand=0.2, speed_m_s=20.0, sensors=sensors,
        axlebox={"vibration_m_s2": vibration, "joint_m_s2": 4 * vibration},
    )  # fmt: skip
    one, many = (Sensing(s.train.axles[0]) for _ in range(2))
    simulation = Simulation(s.train.wheelset, on_tracks(s.train.axles), 20.0)
    for _ in range(50):
        samples = simulation.step(np.array([-8000.0]), np.zeros(1))
        assert one.reading(samples, 0) == many.readings(samples, 0)[0].tolist()


@pytest.mark.parametrize("sensor", [Sensor(0.3, 1.0, 0.0), Sensor(0.1, 2.0, 0.25, bias=0.4, gain=-1.1)])
def test_one_sample_is_measured_as_in_a_block(sensor: Sensor) -> None:
    truth = np.linspace(-2.0, 2.0, 101)
    block = sensor.measure(truth, np.random.default_rng(1))
    rng = np.random.default_rng(1)
    assert [sensor.measure_one(float(x), rng) for x in truth] == block.tolist()
    assert len(set(block.tolist())) > 5
