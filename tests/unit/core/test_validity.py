"""What Validity must say in the cases that a change of its code would turn round first."""

import struct
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.can_ids import ADHESION_A1, LAT_ACCEL_A1, TORQUE_A1, TORQUE_A2, VEHICLE_SPEED, YAW_RATE_A1
from tests.support.config_texts import AXLE
from tests.support.sensor_simulator import SensorSimulator, validities
from wrcd import resources
from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import CANDIDATE_FORGOTTEN, MAX_MOVES, Checker, protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.config import load_config
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.report import Validity
from wrcd.core.validity import OF_ESTIMATE, OF_PAIR, ValidityMonitor
from wrcd.estimator.doubts import Doubt
from wrcd.estimator.estimator import EstimateDoubt
from wrcd.estimator.gate import COMPARED_TICKS, GATE_SIGMA, MAX_JUMP, MAX_NET_OUTLIERS, MIN_TICKS, Gate

DEFAULT = load_config(None)


@pytest.mark.parametrize("can_id", [YAW_RATE_A1, LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED])
def test_rejected_frame_between_good_ones_leaves_the_axle_valid(can_id: int) -> None:
    """A bad CRC behind every good frame, the last before each slot, too: good frames are what counts."""
    sim = SensorSimulator(DEFAULT)
    sim.run(1500)
    for _ in range(100):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
            if frame.can_id == can_id:
                sim.out += sim.core.feed(replace(frame, data=bytes((frame.data[0] ^ 1, *frame.data[1:]))))
        sim.out += sim.core.advance(sim.t)
    assert validities(sim.adhesion(sim.out)) == ["NotAvailable", "Valid"]
    assert sim.core.counts.rejected == {Reason.CRC: 100}


def test_rejection_is_reported_by_axle_signal_and_reason() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(1000)
    for number, name in (
        (YAW_RATE_A1, "YawRate"),
        (LAT_ACCEL_A1, "LatAccel"),
        (TORQUE_A1, "Torque"),
        (VEHICLE_SPEED, "Speed"),
    ):
        length = 4 if number == VEHICLE_SPEED else 5
        sim.core.feed(Frame(sim.t, number, bytes(length)))
        sim.run(100)
        told = {k: str(v) for k, v in sim.decoded("InputHealth_A1")[-1].items() if k.startswith("Refused")}
        assert told.pop(f"Refused{name}") == "Crc"
        assert set(told.values()) == {"None"}
        others = sim.decoded("InputHealth_A2")[-1]
        # the speed is everybody's
        assert str(others[f"Refused{name}"]) == ("Crc" if name == "Speed" else "None")
        sim.run(1000)


def test_rejected_frames_do_not_clear_a_degraded_status() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(1500)
    sim.yaw_status = 1
    first = len(sim.out)
    for _ in range(40):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
            if frame.can_id == YAW_RATE_A1:
                sim.out += sim.core.feed(replace(frame, data=bytes((frame.data[0] ^ 1, *frame.data[1:]))))
        sim.out += sim.core.advance(sim.t)
    assert {f["Validity"] for f in sim.adhesion(sim.out[first:])} == {"Degraded"}


def own(tmp_path: Path, more: str, vehicle: str) -> Config:
    (tmp_path / "wrcd.toml").write_text(f'[vehicle]\nspeed = "VehicleSpeed.Speed"\n{vehicle}{AXLE}{more}')
    return load_config(tmp_path / "wrcd.toml")


@pytest.mark.parametrize(
    ("total", "brake", "torque", "expected"),
    [
        (True, False, -8_000.0, "Valid"),
        (False, False, -8_000.0, "Degraded"),
        (False, False, -0.01, "Degraded"),
        (False, False, 0.0, "Degraded"),  # the friction brakes may act alone
        (False, False, 8_000.0, "Valid"),
        (False, True, -8_000.0, "Valid"),
        (False, True, 8_000.0, "Valid"),
    ],
)
def test_braking_with_an_unknown_friction_share_is_degraded(
    tmp_path: Path, total: bool, brake: bool, torque: float, expected: str
) -> None:
    config = own(
        tmp_path,
        'brake_torque = "Torque_A2.Torque"\n' if brake else "",
        f"torque_is_total = {str(total).lower()}\n",
    )
    sim = SensorSimulator(config)
    sim.torque = torque
    for _ in range(400):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
            if frame.can_id == TORQUE_A1:
                payload = struct.pack("<i", -100_000)[:3]
                sim.core.feed(
                    Frame(frame.stamp_us, TORQUE_A2, protect(b"\0\0" + payload, TORQUE_A2, frame.data[1] & 0x0F))
                )
        sim.out += sim.core.advance(sim.t)
    last = sim.adhesion(sim.out)[-1]
    assert last["Validity"] == expected
    used = abs(torque - (1_000.0 if brake else 0.0))
    assert last["MuUsed"] == pytest.approx(100 * used / (2 * 73549.875 * 0.5), abs=0.006)


def causes(sim: SensorSimulator) -> list[str]:
    """Runs of equal causes in AdhesionDetail."""
    told = [str(row["Cause"]) for row in sim.decoded("AdhesionDetail_A1")]
    return [c for k, c in enumerate(told) if k == 0 or c != told[k - 1]]


@pytest.mark.parametrize("fault", ["status", "speed"])
def test_degraded_input_degrades_for_one_window(fault: str) -> None:
    """The estimate is a window old: what was not sound must have left it."""
    sim = SensorSimulator(DEFAULT)
    sim.speed = 59.9
    sim.run(1500)
    sim.yaw_status, sim.speed = (1, 59.9) if fault == "status" else (0, 60.5)
    assert sim.run(3000)[-1]["Validity"] == "Degraded"
    sim.yaw_status, sim.speed = 0, 59.9
    frames = sim.run(1500)
    assert validities(frames) == ["Degraded", "Valid"]
    back = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert 1000 <= (back + 1) * 20 <= 1040
    assert causes(sim)[-2:] == ["SensorDegraded" if fault == "status" else "SpeedOutOfRange", "None"]


def test_only_valid_frames_have_a_confidence() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(1500)
    sim.yaw_status = 1
    degraded = [f for f in sim.run(500) if f["Validity"] == "Degraded"]
    assert len(degraded) > 20
    assert {f["Confidence"] for f in degraded} == {"None"}
    assert all(isinstance(f["MuAvailable"], float) for f in degraded)


def test_valid_frame_has_no_more_adhesion_in_use_than_available() -> None:
    sim = SensorSimulator(DEFAULT)
    frames = []
    for k in range(300):
        sim.torque = 2_000.0 + 9_000.0 * (k % 20 >= 10)  # steps that the newest part's mean is behind
        frames += sim.run(20)
    valid = [f for f in frames if f["Validity"] == "Valid"]
    assert len(valid) > 20
    assert all(f["MuUsed"] <= f["MuAvailable"] for f in valid)


def test_friction_brakes_alone_degrade_for_one_window(tmp_path: Path) -> None:
    sim = SensorSimulator(own(tmp_path, "", "torque_is_total = false\n"))
    sim.run(2000)
    sim.torque = 0.0
    assert sim.run(100)[-1]["Validity"] == "Degraded"
    sim.torque = 8_000.0
    assert validities(sim.run(1500)) == ["Degraded", "Valid"]
    assert causes(sim)[-2:] == ["FrictionShareUnknown", "None"]


@pytest.mark.parametrize(
    ("key", "share", "expected", "cause"),
    [
        ("axle_load", 0.71, "Valid", "None"),
        ("axle_load", 0.69, "Degraded", "LoadBeyond"),
        ("axle_load", 1.29, "Valid", "None"),
        ("axle_load", 1.31, "Degraded", "LoadBeyond"),
        ("wheel_radius", 0.91, "Valid", "None"),
        ("wheel_radius", 0.89, "Degraded", "RadiusBeyond"),
        ("wheel_radius", 1.09, "Valid", "None"),
        ("wheel_radius", 1.11, "Degraded", "RadiusBeyond"),
    ],
)
def test_load_or_radius_beyond_the_design_is_degraded(
    tmp_path: Path, key: str, share: float, expected: str, cause: str
) -> None:
    unit, design = ("kN", 2e-3 * DEFAULT.design.normal_N) if key == "axle_load" else ("mm", 1e3 * DEFAULT.design.r_0)
    message = f'\nBO_ 800 Body: 8 TCU\n SG_ V : 0|16@1+ (0.01,0) [0|600] "{unit}" WRCD\n\nCM_ '
    text = resources.DBC.read_text("cp1252").replace("\nCM_ ", message, 1)
    (tmp_path / "own.dbc").write_text(text, "cp1252")
    more = f'{key} = "Body.V"\n[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "default"\n'
    sim = SensorSimulator(own(tmp_path, more, ""))
    for _ in range(400):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
        raw = struct.pack("<H", round(share * design / 0.01)) + bytes(6)
        sim.out += sim.core.feed(Frame(sim.t - 4000, 800, raw))
        sim.out += sim.core.advance(sim.t)
    assert sim.adhesion(sim.out)[-1]["Validity"] == expected
    assert causes(sim)[-1] == cause


def test_start_and_stop_have_a_cause_for_each_state() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.out += sim.core.advance(sim.t)
    sim.out += sim.core.advance(sim.t + 500_000)
    sim.t += 500_000
    sim.run(2000)
    sim.silent = {TORQUE_A1}
    sim.run(300)
    sim.silent = set()
    sim.run(1500)
    while sim.speed > 1.0:
        sim.speed -= 0.2
        sim.run(20)
    sim.run(500)
    # slow, with what the sensors say at speed, the estimate is vague
    told = [c for c in causes(sim) if c != "TooLittleData"]
    assert [c for c, _ in groupby(told)] == [
        "InputSilent", "WarmingUp", "None", "InputSilent", "WarmingUp", "None", "Standstill",
    ]  # fmt: skip


def test_reset_after_outliers_has_the_cause_restarted() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(1500)
    sim.spike = 500_000
    sim.run(400)
    assert causes(sim)[-1] == "Restarted"
    sim.run(1500)
    assert causes(sim)[-1] == "None"


@pytest.mark.parametrize(
    ("doubt", "cause"), [*OF_ESTIMATE.items(), (EstimateDoubt.NONE, Cause.NONE)], ids=lambda x: x.name
)
def test_doubtful_estimate_is_degraded_with_its_cause(doubt: EstimateDoubt, cause: Cause) -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(1500)
    estimate = replace(sim.core.estimator.estimate(), doubt=np.full(4, int(doubt)))
    judge = ValidityMonitor(200, 4)
    for _ in range(200):
        judge.update(0, Cause.NONE)
    assert judge.verdict(0, estimate, Doubt.NONE)[1] is cause
    # what is wrong with the sensors comes first
    for pair, of_pair in OF_PAIR.items():
        assert judge.verdict(0, estimate, pair) == (Validity.DEGRADED, of_pair)
    judge.update(0, Cause.UNCHANGED)
    assert judge.verdict(0, estimate, Doubt.SILENT) == (Validity.DEGRADED, Cause.UNCHANGED)
    assert set(OF_PAIR) == set(Doubt) - {Doubt.NONE}
    assert set(OF_ESTIMATE) == set(EstimateDoubt) - {EstimateDoubt.NONE}


@pytest.mark.parametrize(("speed", "outside"), [(2.9975, True), (3.0, False), (60.0, False), (60.0025, True)])
def test_design_speed_range_includes_its_ends(speed: float, outside: bool) -> None:
    sim = SensorSimulator(replace(DEFAULT, min_speed_m_s=2.0))
    sim.speed = speed
    sim.run(2000)
    # slow, with what the sensors say at speed, the estimate may be vague, too
    assert (causes(sim)[-1] == "SpeedOutOfRange") == outside


@pytest.mark.parametrize(("speed", "available"), [(4.9975, False), (5.0, True)])
def test_axle_at_min_speed_is_available(speed: float, available: bool) -> None:
    sim = SensorSimulator(replace(DEFAULT, min_speed_m_s=5.0))
    sim.speed = speed
    assert (sim.run(2000)[-1]["Validity"] != "NotAvailable") == available


@pytest.mark.parametrize(
    ("step_us", "anew", "filled"),
    [
        (-10_000, 0, 0),
        (-10_001, 1, 0),
        (1_000_000, 0, 50),
        (1_000_001, 1, 0),
        (59_990_000, 1, 0),
        (3_600_000_000, 1, 0),
    ],
)
def test_time_step_is_found_from_frames_alone(step_us: int, anew: int, filled: int) -> None:
    sim = SensorSimulator(DEFAULT)
    sim.t += 4_000  # frames at a tick's beginning
    for _ in range(40):
        for frame in sim.frames():
            sim.core.feed(frame)
    before = sim.core.counts.accepted
    assert before == 160
    out = sim.core.feed(replace(frame, stamp_us=frame.stamp_us + step_us, data=sim.frames()[-1].data))
    assert sim.core.counts.time_steps == anew
    assert sim.core.counts.accepted == before + 1
    assert len(sim.adhesion(out)) == filled
    # what follows is no step of its own, and a late frame is counted as one
    sim.core.feed(replace(frame, stamp_us=frame.stamp_us + step_us + 5_000, data=sim.frames()[-1].data))
    assert sim.core.counts.time_steps == anew


@pytest.mark.parametrize(("step_us", "anew"), [(1_000_000, 0), (1_005_000, 1), (-10_000, 0), (-10_001, 1)])
def test_time_step_is_found_from_the_clock_alone(step_us: int, anew: int) -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(200)
    sim.core.advance(sim.t + step_us)
    assert sim.core.counts.time_steps == anew


def test_frame_of_a_closed_tick_counts_as_late() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(200)
    for stamp_us in (sim.t, sim.t - 1, sim.t - 3_000):
        sim.core.feed(replace(sim.frame(TORQUE_A1, struct.pack("<i", 1_000_000)[:3]), stamp_us=stamp_us))
        sim.counter += 1
    assert sim.core.counts.late == 2


def test_rejections_are_counted_by_message_and_reason() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(20)
    for _ in range(2):
        sim.core.feed(Frame(sim.t, TORQUE_A1, bytes(5)))
    assert sim.core.counts.rejected_by_message == {("Torque_A1", Reason.CRC): 2}


def test_shutdown_status_is_stopping() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.run(100)
    message = find_message(DEFAULT.database, "WrcdStatus")
    (last,) = (f for f in sim.core.shutdown_frames(sim.t) if f.can_id == message.frame_id)
    decoded: Any = message.decode(last.data)
    assert str(decoded["State"]) == "Stopping"


def sent(counter: int) -> bytes:
    return protect(bytes(5), ADHESION_A1, counter % 15)


def test_sender_restarting_more_than_max_moves_times_counts_as_two() -> None:
    checker = Checker(ADHESION_A1)
    assert [checker.check(sent(c)) for c in (0, 1, 2)] == [None] * 3
    starts = (9, 7, 0)  # none continues the chain or the one before it
    assert len(starts) == MAX_MOVES + 1
    verdicts = [(checker.check(sent(s)), checker.check(sent(s + 1))) for s in starts]
    assert verdicts[:-1] == [(Reason.COUNTER, None)] * MAX_MOVES
    assert verdicts[-1][1] is Reason.TWO_SENDERS


def test_candidate_is_suspected_at_its_second_frame_then_forgotten() -> None:
    checker = Checker(ADHESION_A1)
    for c in (0, 1, 2):
        checker.check(sent(c))
    assert (checker.check(sent(9)), checker.suspect) == (Reason.COUNTER, False)
    assert checker.check(sent(3)) is None
    assert (checker.check(sent(10)), checker.suspect) == (Reason.COUNTER, True)
    for k in range(CANDIDATE_FORGOTTEN + 1):
        assert checker.suspect
        assert checker.check(sent(4 + k)) is None
    assert not checker.suspect


STILL = np.zeros(2)  # yaw rates


def test_gate_reset_affects_one_axle_only() -> None:
    gate = Gate(2)
    e, there = np.ones((4, 2, 2)), np.ones(2, dtype=bool)
    for _ in range(int(MIN_TICKS)):
        gate.learn(e, STILL, there, gate.outliers(e, STILL, there))
    assert gate.outliers(100 * e, STILL, there).all()
    gate.reset(0)
    assert (gate.outliers(100 * e, STILL, there) == [[False, True], [False, True]]).all()
    # for as many ticks as at first, and with as many absurd ones before it is upset
    quiet = 1e-3 * e
    for k in range(int(MIN_TICKS)):
        assert not gate.outliers(0.5 * e, STILL, there)[:, 0].any(), k
        gate.learn(quiet, STILL, there, np.zeros((2, 2), dtype=bool))
    assert gate.outliers(0.5 * e, STILL, there)[:, 0].all()
    nobody = np.zeros(2, dtype=bool)
    upset = [
        bool(gate.learn(e, STILL, nobody, np.ones((2, 2), dtype=bool))[0]) for _ in range(int(MAX_NET_OUTLIERS) + 1)
    ]
    assert upset == [False] * int(MAX_NET_OUTLIERS) + [True]


def test_gate_limit_is_gate_sigma_times_the_rms() -> None:
    gate = Gate(1)
    e, there, none = np.ones((4, 2, 1)), np.ones(1, dtype=bool), np.zeros((2, 1), dtype=bool)
    for k in range(int(MIN_TICKS)):
        gate.learn((1 + 2 * (k % 2)) * e, STILL[:1], there, none)  # 1 and 3: a mean square of 5
    usual = 5**0.5
    assert not gate.outliers(0.999 * GATE_SIGMA * usual * e, STILL[:1], there).any()
    assert gate.outliers(1.001 * GATE_SIGMA * usual * e, STILL[:1], there).all()


def test_non_finite_innovation_is_an_outlier_from_the_first_tick() -> None:
    gate = Gate(1)
    e = np.ones((4, 2, 1))
    e[2, 1, 0] = np.inf
    assert (gate.outliers(e, STILL[:1], np.ones(1, dtype=bool))[:, 0] == [False, True]).all()
    e[2, 1, 0] = 1e200
    with np.errstate(all="raise"):
        gate.outliers(e, STILL[:1], np.ones(1, dtype=bool))


def test_yaw_rate_jump_is_an_outlier_until_it_is_old() -> None:
    gate, e, there = Gate(1), np.ones((4, 2, 1)), np.ones(1, dtype=bool)
    none, jump = np.zeros((2, 1), dtype=bool), np.array([1.01 * MAX_JUMP])
    gate.learn(e, STILL[:1], there, none)
    assert not gate.outliers(e, 0.98 * jump, there).any()
    for _ in range(COMPARED_TICKS):
        absurd = gate.outliers(e, jump, there)
        assert (absurd[:, 0] == [True, False]).all()
        upset = gate.learn(e, jump, ~there, absurd)
    assert upset[0]
    assert not gate.outliers(e, jump, there).any()


def test_silent_bus_at_start_is_not_available() -> None:
    sim = SensorSimulator(DEFAULT)
    sim.out += sim.core.advance(sim.t)
    sim.out += sim.core.advance(sim.t + 100_000)
    assert [f["Validity"] for f in sim.adhesion(sim.out)] == ["NotAvailable"] * 5
