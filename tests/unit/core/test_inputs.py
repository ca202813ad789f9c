"""What comes of the inputs: gaps, rejected frames, torque that several signals add up to, the direction of travel."""

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import RailSection, rail_at, rail_table
from sim_ecu.physics.wheelset import AXLE_STATES, PSIDOT, W_L, W_R, Wheelset, Y, axle_derivatives, constants
from tests.support.can_ids import (
    ADHESION_A1,
    LAT_ACCEL_A1,
    SIM_TRUTH_A1,
    TORQUE_A1,
    TORQUE_A2,
    VEHICLE_SPEED,
    YAW_RATE_A1,
    id_of,
)
from tests.support.config_texts import AXLE, VEHICLE
from tests.support.dbc import DIRECTION_AND_LOAD_DBC
from tests.support.sensor_simulator import SensorSimulator, beside, until_ms, validities
from tests.support.stages import Inputs
from wrcd import resources
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.config.config import DEFAULT, load_config
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import Core

TIMEOUTS_MS = {YAW_RATE_A1: 15, LAT_ACCEL_A1: 15, TORQUE_A1: 30, VEHICLE_SPEED: 60}


@pytest.mark.parametrize(
    ("silent", "ms", "during", "after"),
    [
        (LAT_ACCEL_A1, 5, "Valid", ["Valid"]),  # one frame
        (YAW_RATE_A1, 40, "Degraded", ["Valid"]),  # 40 ms past the time-out are bridged; the estimate goes on
        (TORQUE_A1, 60, "Degraded", ["Valid"]),
        (YAW_RATE_A1, 80, "Degraded", ["Degraded", "Valid"]),  # for one window
    ],
)
def test_gap_is_bridged_or_costs_a_window(
    sim: SensorSimulator, silent: int, ms: int, during: str, after: list[str]
) -> None:
    sim.run(2000)
    assert {f["Validity"] for f in sim.during(ms, silent={silent})[-1:]} <= {during}
    frames = sim.run(1500)
    assert validities(frames) == after
    if "Degraded" in after:
        assert isinstance(frames[0]["MuAvailable"], float)
        assert 1000 <= until_ms(frames, "Valid") <= 1040


@pytest.mark.parametrize("missing", TIMEOUTS_MS)
def test_silent_input_is_degraded_then_not_available(sim: SensorSimulator, missing: int) -> None:
    sim.run(2000)
    frames = sim.during(300, silent={missing})
    assert [v for v in validities(frames) if v != "Valid"] == ["Degraded", "NotAvailable"]
    # never Valid longer than the time-out and one cycle after the last frame, 4 ms before the silence began
    assert until_ms(frames, "Degraded") <= TIMEOUTS_MS[missing] + 40
    assert 100 - 4 <= until_ms(frames, "NotAvailable") <= 100 + 20
    frames = sim.run(1500)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert 1000 <= until_ms(frames, "Valid") <= 1040


def test_sensor_slower_than_the_tick_is_never_valid(sim: SensorSimulator) -> None:
    """Gains made for every tick are wrong for every second one; no number is better than a wrong one."""
    frames = sim.run(
        2000, lambda all_: [f for f in all_ if sim.counter % 2 or f.can_id not in (YAW_RATE_A1, LAT_ACCEL_A1)]
    )
    assert {f["MuAvailable"] for f in frames} == {"NotAvailable"}
    assert "Valid" not in {f["Validity"] for f in frames}


def test_every_mapped_frame_is_accepted_or_counted(sim: SensorSimulator) -> None:
    sim.run(100)
    good = sim.core.counts.accepted
    for can_id, data in (
        *((YAW_RATE_A1, data) for data in (bytes(5), bytes(4), b"\xff" * 5)),
        (SIM_TRUTH_A1, bytes(8)),
        (ADHESION_A1, bytes(8)),
    ):
        sim.core.feed(Frame(sim.t, can_id, data))
    assert sim.core.counts.accepted == good
    assert sum(sim.core.counts.rejected.values()) == 3


def with_bad_crc(frames: list[Frame], can_id: int) -> list[Frame]:
    """A tick's frames, and a bad CRC behind the good one of an id."""
    bad = [replace(f, data=bytes((f.data[0] ^ 1, *f.data[1:]))) for f in frames if f.can_id == can_id]
    return [*frames, *bad]


@pytest.mark.parametrize("can_id", TIMEOUTS_MS)
def test_rejected_frame_between_good_ones_leaves_the_axle_as_it_is(can_id: int, sim: SensorSimulator) -> None:
    """A bad CRC behind every good frame, the last before each slot, too: good frames are what counts."""
    sim.run(1500)
    sim.run(500, lambda frames: with_bad_crc(frames, can_id))
    assert validities(sim.adhesion(sim.out)) == ["NotAvailable", "Valid"]
    assert sim.core.counts.rejected == {Reason.CRC: 100}
    degraded = sim.during(200, lambda frames: with_bad_crc(frames, YAW_RATE_A1), yaw_status=1)
    assert validities(degraded) == ["Degraded"]


def test_two_senders_of_one_id_are_rejected(sim: SensorSimulator) -> None:
    sim.run(2000)
    other_us, begin = sim.t, len(sim.out)
    for k in range(60):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
        data = protect(b"\0\0" + struct.pack("<i", 5000 + k)[:3], YAW_RATE_A1, (sim.counter + 6) % 15)
        sim.out += sim.core.feed(Frame(other_us, YAW_RATE_A1, data))
        other_us = sim.t + 2500
        sim.out += sim.core.advance(sim.t)
    frames = sim.adhesion(sim.out[begin:])
    assert "Valid" not in {f["Validity"] for f in frames[2:]}
    assert sim.core.counts.rejected[Reason.TWO_SENDERS] > 80
    assert sim.decoded("InputHealth_A1")[-1]["RefusedYawRate"] == "TwoSenders"
    assert validities(sim.run(2000)) == ["NotAvailable", "Valid"]


@pytest.mark.parametrize("name", ["YawRate", "LatAccel", "Torque", "Speed"])
def test_rejection_is_reported_by_axle_signal_and_reason(sim: SensorSimulator, name: str) -> None:
    sim.run(100)
    can_id = VEHICLE_SPEED if name == "Speed" else id_of(f"{name}_A1")
    sim.core.feed(Frame(sim.t, can_id, bytes(4 if name == "Speed" else 5)))
    sim.run(100)
    told = {k: str(v) for k, v in sim.decoded("InputHealth_A1")[-1].items() if k.startswith("Refused")}
    assert told.pop(f"Refused{name}") == "Crc"
    assert set(told.values()) == {"None"}
    # the speed is everybody's
    assert sim.decoded("InputHealth_A2")[-1][f"Refused{name}"] == ("Crc" if name == "Speed" else "None")


def test_rejections_are_counted_by_reason_and_message(sim: SensorSimulator) -> None:
    sim.run(995)
    for can_id, data in (
        (YAW_RATE_A1, bytes(5)),
        (YAW_RATE_A1, bytes(4)),
        (YAW_RATE_A1, protect(bytes(5), LAT_ACCEL_A1, 0)),
        (TORQUE_A1, bytes(5)),
    ):
        sim.core.feed(Frame(sim.t, can_id, data))
    sim.run(2005)
    rows = [[r[f"Rejected{reason}"] for reason in ("Crc", "Length", "DataId")] for r in sim.decoded("WrcdRejects")]
    assert rows == [[2, 1, 1], [0, 0, 0], [0, 0, 0]]
    status = sim.decoded("WrcdStatus")[-1]
    assert (status["RejectedFrames"], status["LastReason"]) == (4, "Crc")
    by_message = sim.core.counts.rejected_by_message
    assert (by_message["Torque_A1", Reason.CRC], by_message.total()) == (1, 4)


PARTS = 'torque = [ "Torque_A1.Torque", { signal = "Torque_A2.Torque", SECOND } ]'
BESIDE = 'torque = "Torque_A1.Torque"\nbrake_torque = { signal = "Torque_A2.Torque", SECOND }'


class TwoTorques(SensorSimulator):
    """A second torque beside the simulator's: the packaged DBC's of another axle stands for it."""

    second = 0.0

    def __init__(self, folder: Path, text: str, second: str = "sign = 1") -> None:
        file = folder / "train.toml"
        axle = AXLE.replace('torque = "Torque_A1.Torque"', text.replace("SECOND", second))
        file.write_text(VEHICLE + axle)
        super().__init__(load_config(file))

    def frames(self) -> list[Frame]:
        every = beside(super().frames(), YAW_RATE_A1, TORQUE_A2, round(self.second * 100))
        return [f for f in every if f.can_id not in self.silent]

    @property
    def ratio_Nm(self) -> float:
        """|torque| of axle 1 as the core has it."""
        design = self.config.design
        return float(self.core._train.state["axle"]["torque_ratio"][0]) * 2 * design.normal_N * design.r_0


both = pytest.mark.parametrize("text", [PARTS, BESIDE], ids=["parts", "brake torque"])


@both
@pytest.mark.parametrize(
    ("second", "torques", "total"),
    [
        ("sign = 1", (-4000.0, -3000.0), 7000.0),
        ("sign = -1", (-4000.0, 3000.0), 7000.0),
        ('at = "motor", gear_ratio = 4.5', (-4000.0, -1000.0), 8500.0),
        ('at = "motor", gear_ratio = 4.5, sign = -1, share = 0.5', (-4000.0, 1000.0), 6250.0),
        ("sign = 1", (9000.0, 500.0), 9500.0),
    ],
)
def test_parts_add_up(tmp_path: Path, text: str, second: str, torques: tuple[float, float], total: float) -> None:
    sim = TwoTorques(tmp_path, text, second)
    sim.torque, sim.second = torques
    assert validities(sim.run(1200)) == ["NotAvailable", "Valid"]
    assert sim.ratio_Nm == pytest.approx(total, abs=0.1)


@both
def test_torques_against_each_other_are_degraded_and_mu_used_is_the_larger(tmp_path: Path, text: str) -> None:
    """The sign of the second was forgotten."""
    sim = TwoTorques(tmp_path, text)
    for torque, second, ms, found, used in (
        (-6000.0, 0.0, 1200, ["NotAvailable", "Valid"], 6000.0),
        (-6000.0, 3900.0, 200, ["Degraded"], 6000.0),
        (-1500.0, 3900.0, 200, ["Degraded"], 3900.0),
        (-1500.0, -3900.0, 1500, ["Degraded", "Valid"], 5400.0),  # mended: Valid a window later
        (9000.0, -3000.0, 200, ["Degraded"], 9000.0),  # the brake is applied under traction
        (9000.0, -100.0, 1500, ["Degraded", "Valid"], 8900.0),
    ):
        sim.torque, sim.second = torque, second
        assert validities(sim.run(ms)[-ms // 20 + 2 :]) == found
        assert sim.ratio_Nm == pytest.approx(used, abs=0.1)
        assert (sim.core.reports[0].cause is Cause.TORQUES_CONTRADICT) == (found == ["Degraded"])
    assert sim.causes()[-2:] == ["TorquesContradict", "None"]


def test_small_torques_against_each_other_are_no_contradiction(tmp_path: Path) -> None:
    sim = TwoTorques(tmp_path, BESIDE)
    limit = 0.02 * 2 * sim.config.design.normal_N * sim.config.design.r_0
    sim.torque, sim.second = -6000.0, 0.95 * limit
    assert validities(sim.run(1200)) == ["NotAvailable", "Valid"]
    assert sim.ratio_Nm == pytest.approx(6000.0 - 0.95 * limit, abs=0.1)


def test_silent_part_makes_the_torque_stale_then_unavailable(tmp_path: Path) -> None:
    sim = TwoTorques(tmp_path, PARTS)
    sim.run(1500)
    assert sim.decoded("InputHealth_A1")[-1]["ReachTorque"] == 255
    frames = sim.during(200, silent={TORQUE_A2})
    assert validities(frames) == ["Valid", "Degraded", "NotAvailable"]
    assert frames[-1]["MuUsed"] == "NotAvailable"
    assert frames[-1]["SampleAge"] > 150
    assert sim.decoded("AdhesionDetail_A1")[-1]["StaleTorque"] == "Stale"
    # the worst of both
    assert sim.decoded("InputHealth_A1")[-1]["ReachTorque"] < 255
    assert validities(sim.run(1500)) == ["NotAvailable", "Valid"]
    assert validities(sim.during(200, silent={TORQUE_A1}))[-1] == "NotAvailable"


def test_silent_brake_torque_makes_the_axle_unavailable(tmp_path: Path) -> None:
    sim = TwoTorques(tmp_path, BESIDE)
    sim.run(1500)
    frames = sim.during(200, silent={TORQUE_A2})
    assert validities(frames) == ["Valid", "Degraded", "NotAvailable"]
    assert (frames[-1]["MuUsed"], frames[-1]["SampleAge"]) == ("NotAvailable", 204)
    assert sim.during(100, silent={TORQUE_A2})[-1]["SampleAge"] == 255  # no more is told
    assert sim.core.reports[0].sample_age_ms == 255


STATE_ID = 800
FORWARD, REVERSE = bytes(4), bytes([1, 0, 0, 0])


@pytest.fixture
def with_direction(tmp_path: Path) -> Config:
    """The default configuration, and a signal of the direction of travel."""
    lines = DIRECTION_AND_LOAD_DBC.replace(" B\n", " WRCD\n").splitlines(keepends=True)
    values, message = lines.pop(), "".join(lines[next(i for i, x in enumerate(lines) if x.startswith("BO_ ")) :])
    text = resources.DBC.read_bytes().replace(b"\nBO_ ", f"\n{message}\nBO_ ".encode(), 1) + values.encode()
    (tmp_path / "train.dbc").write_bytes(text)
    file = tmp_path / "train.toml"
    own = '[dbc]\nfile = "train.dbc"\n[wheelset]\nname = "multiple-unit"\n'
    file.write_text(own + DEFAULT.replace("[vehicle]", '[vehicle]\ndirection = "State.Dir"'))
    return load_config(file)


def ridden(config: Config, signs: Sequence[int], state: bytes = b"") -> list[dict[str, object]]:
    """Two seconds whose yaw rate and acceleration have these signs, and a message of the direction."""

    def turned(frames: list[Frame]) -> list[Frame]:
        out = [Frame(sim.t - 4500, STATE_ID, state)] if state else []
        for f in frames:
            sign = dict(zip((YAW_RATE_A1, LAT_ACCEL_A1), signs, strict=True)).get(f.can_id, 1)
            value = sign * int.from_bytes(f.data[2:], "little", signed=True)
            data = f.data[:2] + value.to_bytes(3, "little", signed=True) if sign < 0 else f.data
            out.append(replace(f, data=protect(data, f.can_id, f.data[1] & 0x0F)))
        return out

    sim = SensorSimulator(config)
    return [{name: f[name] for name in ("Validity", "MuAvailable")} for f in sim.run(2000, turned)]


def test_train_in_reverse_gives_what_it_gives_forwards(with_direction: Config) -> None:
    """Turned round, its left is on the right: the accelerometer's sign changes. Its yaw stays counter-clockwise."""
    forwards = ridden(with_direction, (1, 1), FORWARD)
    assert forwards[-1]["Validity"] == "Valid"
    assert ridden(with_direction, (1, -1), REVERSE) == forwards
    assert ridden(with_direction, (-1, -1), REVERSE) != forwards


def test_speed_below_zero_is_a_train_in_reverse_where_no_direction_is_mapped(tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    speed = "VehicleSpeed.Speed"
    file.write_text(DEFAULT.replace(f'speed = "{speed}"', f'speed = {{ signal = "{speed}", sign = -1 }}'))
    backwards = ridden(load_config(file), (1, -1))
    assert validities(backwards) == ["NotAvailable", "Valid"]
    assert backwards == ridden(load_config(None), (1, 1))


def test_mapped_direction_counts_more_than_the_sign_of_the_speed(with_direction: Config) -> None:
    core = Core(with_direction)
    inputs, signals = Inputs(core._train), [s.source.quantity for s in core.mapped.signals]
    for quantity, value in ((Quantity.DIRECTION, 1.0), (Quantity.SPEED, -25.0), (Quantity.LAT_ACCEL, 0.5)):
        inputs.accept(signals.index(quantity), value, 0)
    assert 0.5 in inputs.close(5_000)[0]  # in reverse it would be -0.5


def test_wheelset_left_of_the_track_turns_clockwise() -> None:
    """Why: the wheel with the larger rolling radius leads. In axes that turn with the travel the equations are the
    same backwards; in the vehicle's own the wheelset left of the track turns counter-clockwise then."""
    w, v = Wheelset(), 20.0
    rail = rail_at(rail_table([RailSection(0.0, CURVES["A"])]), 1.0)

    def yaw_acceleration(y: float) -> float:
        state, out = np.zeros(AXLE_STATES), np.zeros(AXLE_STATES)
        state[Y], state[W_R], state[W_L] = y, v / w.r_0, v / w.r_0
        axle_derivatives(state, v, 0.0, 0.0, rail, constants(w), w.contact, out)
        return float(out[PSIDOT])

    assert yaw_acceleration(1e-4) < 0 < yaw_acceleration(-1e-4)
