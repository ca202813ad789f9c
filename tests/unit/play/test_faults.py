"""Faults of the rig: what they do to frames, how they are asked for, and what the daemon's core makes of them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import e2e.p11
import numpy as np
import pytest

from sim_ecu.cli.main import main as sim_ecu
from sim_ecu.play.encoder import Sent, data_id, databases
from sim_ecu.play.faults import KINDS, SILENT, Fault, Stage, parse_fault
from sim_ecu.play.interface import check
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import Scenario, load_scenario
from tests.matrix.expected import LONG_ROWS, ROWS
from tests.matrix.matrix import BEGINS_S, Matrix
from tests.support.can_ids import LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED, YAW_RATE_A1, YAW_RATE_A2
from wrcd.errors import InputError

BEGIN, END = 200_000, 400_000


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return replace(load_scenario("half-wet"), duration_s=0.6)


def played(scenario: Scenario, *specs: str) -> list[Sent]:
    faults = tuple(parse_fault(spec, [a.number for a in scenario.axles]) for spec in specs)
    return [f for _, frames in Player(replace(scenario, faults=faults), truth=False) for f in frames]


def fault(kind: str, rest: str = "") -> str:
    return f"{kind}:at=0.2,for=0.2{rest}"


def of(frames: Sequence[Sent], can_id: int, begin: int = BEGIN, end: int = END) -> list[Sent]:
    return [f for f in frames if f.can_id == can_id and begin <= f.due_us < end]


def value(f: Sent) -> float:
    values: Any = databases()[0].get_message_by_frame_id(f.can_id).decode(f.data)
    return float(next(v for k, v in values.items() if k not in ("Crc", "Counter", "Status")))


def right(f: Sent, can_id: int | None = None) -> bool:
    """Whether the CRC is right, by the autosar-e2e package."""
    message = databases()[0].get_message_by_frame_id(can_id or f.can_id)
    data = bytearray(f.data)
    e2e.p11.e2e_p11_protect(data, data_id(message), increment_counter=False)
    return bytes(data) == f.data


def counters(frames: Sequence[Sent]) -> list[int]:
    return [f.data[1] & 0x0F for f in frames]


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_stays_within_its_time_and_its_messages(scenario: Scenario, kind: str) -> None:
    clean = played(scenario)
    faulty = played(scenario, fault(kind))
    assert faulty == played(scenario, fault(kind))  # the same again
    assert [f.due_us for f in faulty] == sorted(f.due_us for f in faulty)
    mine = {YAW_RATE_A1, YAW_RATE_A2} if kind.startswith("swap") else {YAW_RATE_A1}
    if KINDS[kind].stage is Stage.BUS:
        mine = {f.can_id for f in clean}
    touched = set(faulty) ^ set(clean)
    if kind != "loss":  # few enough may be lost that it is none
        assert touched
    assert {f.can_id for f in touched} <= mine | {0x000, 0x080}
    late = END + 10_000 if kind in ("delay", "sender") else END
    assert all(BEGIN <= f.due_us < late for f in touched)


def test_without_a_fault_nothing_changes(scenario: Scenario) -> None:
    """A fault after the scenario's end: the frames go through everything and come out as they went in."""
    assert played(scenario, "crc:at=5") == played(scenario)


def test_loss_burst_and_bus_off_drop_frames(scenario: Scenario) -> None:
    assert of(played(scenario, fault("burst")), YAW_RATE_A1) == []
    assert 10 < len(of(played(scenario, fault("loss", ",amount=0.5")), YAW_RATE_A1)) < 30
    away = [f for f in played(scenario) if not BEGIN <= f.due_us < END]
    assert all(played(scenario, fault(kind)) == away for kind in SILENT)


def test_crc_counter_and_dlc_faults_change_nothing_else(scenario: Scenario) -> None:
    clean = of(played(scenario), YAW_RATE_A1)
    flipped = of(played(scenario, fault("crc")), YAW_RATE_A1)
    assert not any(map(right, flipped))
    assert {
        (int.from_bytes(a.data) ^ int.from_bytes(b.data)).bit_count() for a, b in zip(flipped, clean, strict=True)
    } == {1}
    stands = of(played(scenario, fault("counter")), YAW_RATE_A1)
    assert set(counters(stands)) == {counters(clean)[0]}
    assert all(map(right, stands))
    assert list(map(value, stands)) == list(map(value, clean))
    for amount, length in ((-1, 4), (1, 6), (3, 8)):
        assert {len(f.data) for f in of(played(scenario, fault("dlc", f",amount={amount}")), YAW_RATE_A1)} == {length}


def test_value_faults_change_the_signal_under_a_right_crc(scenario: Scenario) -> None:
    clean = list(map(value, of(played(scenario), YAW_RATE_A1)))

    def off(kind: str, rest: str = "") -> list[float]:
        frames = of(played(scenario, fault(kind, rest)), YAW_RATE_A1)
        assert all(map(right, frames))
        return [value(f) - v for f, v in zip(frames, clean, strict=True)]

    assert off("bias") == pytest.approx([0.1] * 40, abs=2e-6)
    assert off("drift", ",amount=1.0") == pytest.approx([k * 0.005 for k in range(40)], abs=2e-6)
    assert [round(x, 3) for x in off("spike")] == [0.5 if k % 20 == 0 else 0.0 for k in range(40)]
    last = value(of(played(scenario), YAW_RATE_A1, 0, BEGIN)[-1])
    assert off("freeze") == pytest.approx([last - v for v in clean], abs=2e-6)
    torques = of(played(scenario, fault("spike", ",of=torque,amount=100000")), TORQUE_A1)
    assert [value(f) > 60_000 for f in torques] == [k % 10 == 0 for k in range(20)]
    speeds = of(played(scenario, fault("bias", ",of=speed")), VEHICLE_SPEED)
    assert list(map(value, speeds)) == pytest.approx([27.0] * 10, abs=0.05)


def test_dead_sensor_has_noise_alone_and_reversed_sensor_its_sign(scenario: Scenario) -> None:
    clean = {i: [value(f) for f in of(played(scenario), i)] for i in (YAW_RATE_A1, LAT_ACCEL_A1, TORQUE_A1)}
    assert [value(f) for f in of(played(scenario, fault("reverse")), YAW_RATE_A1)] == pytest.approx(
        [-v for v in clean[YAW_RATE_A1]]
    )
    dead = played(scenario, fault("dead", ",of=all"))
    noise = {i: np.std([value(f) for f in of(dead, i)]) for i in (YAW_RATE_A1, LAT_ACCEL_A1)}
    assert noise[YAW_RATE_A1] == pytest.approx(3e-4, rel=0.4)
    assert noise[LAT_ACCEL_A1] == pytest.approx(0.01, rel=0.4)
    assert [value(f) for f in of(dead, TORQUE_A1)] == clean[TORQUE_A1]
    assert all(map(right, of(dead, YAW_RATE_A1)))


def test_nan_and_status_faults_keep_the_crc_right(scenario: Scenario) -> None:
    none = of(played(scenario, fault("nan")), YAW_RATE_A1)
    assert {f.data[2:] for f in none} == {b"\x00\x00\x80"}
    assert {f.data[2:] for f in of(played(scenario, fault("nan", ",of=speed")), VEHICLE_SPEED)} == {b"\xff\xff"}
    failed = of(played(scenario, fault("status")), YAW_RATE_A1)
    assert {f.data[1] >> 4 for f in failed} == {14}
    assert all(map(right, none + failed))


def test_swap_changes_ids_and_swap_wiring_values(scenario: Scenario) -> None:
    clean = played(scenario)
    frames = played(scenario, fault("swap"))
    assert [f.data for f in of(frames, YAW_RATE_A2)] == [f.data for f in of(clean, YAW_RATE_A1)]
    assert all(right(f, YAW_RATE_A2) and not right(f) for f in of(frames, YAW_RATE_A1))
    wires = played(scenario, fault("swap-wiring"))
    assert list(map(value, of(wires, YAW_RATE_A2))) == list(map(value, of(clean, YAW_RATE_A1)))
    assert all(map(right, of(wires, YAW_RATE_A1)))
    assert of(wires, LAT_ACCEL_A1) == of(clean, LAT_ACCEL_A1)


def test_delay_keeps_the_order_of_a_message(scenario: Scenario) -> None:
    frames = of(played(scenario, fault("delay", ",amount=50")), YAW_RATE_A1, 0, 10**9)
    clean = of(played(scenario), YAW_RATE_A1, 0, 10**9)
    assert [f.data for f in frames] == [f.data for f in clean]
    assert of(frames, YAW_RATE_A1, BEGIN, BEGIN + 50_000) == []
    assert frames[40].due_us - clean[40].due_us == 50_000
    assert frames[-1] == clean[-1]


def test_second_sender_has_its_own_counter(scenario: Scenario) -> None:
    clean, frames = played(scenario), played(scenario, fault("sender", ",of=all"))
    for can_id in (YAW_RATE_A1, LAT_ACCEL_A1, TORQUE_A1):
        first = of(clean, can_id)
        second = [f for f in of(frames, can_id, BEGIN, END + 2_500) if f not in clean]
        assert len(second) == len(first)
        assert all(map(right, second))
        assert {(b - a) % 15 for a, b in zip(counters(first), counters(second), strict=True)} == {7}
        assert list(map(value, second)) == pytest.approx([value(f) / 2 for f in first], abs=0.01)


def test_babble_and_error_flood_add_frames(scenario: Scenario) -> None:
    clean, frames = played(scenario), played(scenario, fault("babble", ",amount=1000"))
    assert len(of(frames, 0x000)) == 100
    assert len(of(frames, YAW_RATE_A1)) - len(of(clean, YAW_RATE_A1)) == 100
    assert {f.data for f in of(frames, YAW_RATE_A1)} == {f.data for f in of(clean, YAW_RATE_A1)}
    errors = [f for f in played(scenario, fault("error-flood", ",amount=300")) if f.error]
    assert len(errors) == 60
    assert {f.can_id for f in errors} == {0x80}


# what is wrong is named
BAD = {
    "crv:at=3": "did you mean 'crc'",
    "crc": "--fault crc: at:",
    "crc:at=x": "at:",
    "crc:3": "'3'",
    "crc:at=3,far=1": "far:",
    "crc:at=3,axle=4": "axle:",
    "loss:at=3,amount=2": "amount:",
    "bias:at=3,of=all,amount=1": "amount:",
    "swap:at=3,of=speed": "of:",
    "dead:at=30": "at:",  # the scenario lasts 30 s
}


@pytest.mark.parametrize("spec", BAD)
def test_bad_fault_specification_is_an_error_with_its_key(spec: str) -> None:
    with pytest.raises(InputError) as e:
        parse_fault(spec, [1, 2, 3], 30.0)
    assert BAD[spec] in str(e.value)


def test_swap_of_a_single_axle_is_an_error() -> None:
    with pytest.raises(InputError, match="swap"):
        parse_fault("swap:at=3", [1])
    assert parse_fault("swap:at=3,axle=2", [2, 4]) == Fault("swap", 3.0, axle=2)


def test_faults_need_their_interface() -> None:
    for kind, interface, channel in (
        ("bus-off", "socketcan", "vcan0"), ("link-down", "socketcan", "can0"), ("device-gone", "virtual", "vcan0"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=kind):
            check([Fault(kind, 1.0)], interface, channel)
    check([Fault("error-flood", 1.0), Fault("crc", 1.0)], "virtual", "x")


def test_play_with_faults_writes_the_same_log_each_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "faulty.toml"
    file.write_text(
        'duration_s = 0.5\nrail = [{ curve = "C" }]\ndrive = { utilisation = 0.1 }\n'
        '[[fault]]\nat_s = 0.1\nkind = "burst"\nduration_s = 0.1\nof = "all"\n'
    )
    logs = []
    for name in ("a.log", "b.log"):
        logs.append(tmp_path / name)
        command = ["play", str(file), "--fault", "error-flood:at=0.3,for=0.1", "--fast", "--no-truth", "--log"]
        assert sim_ecu([*command, str(logs[-1])]) == 0
    assert logs[0].read_bytes() == logs[1].read_bytes()
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "fault burst of=all axle=1 begin=1700000000.100000 end=1700000000.200000"
    assert said[1] == "fault error-flood of=bus begin=1700000000.300000 end=1700000000.400000"
    lines = logs[0].read_text().splitlines()
    yaw = [float(line[1:18]) - 1.7e9 for line in lines if " 101#" in line]
    assert len(yaw) == 80
    assert not any(0.0999 < t < 0.1999 for t in yaw)
    assert sum(" 20000080#" in line for line in lines) == 100


def test_wrong_fault_in_a_scenario_is_an_error_with_its_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, log = tmp_path / "faulty.toml", tmp_path / "x.log"
    file.write_text('[[rail]]\ncurve = "C"\n[drive]\nutilisation = 0.1\n[[fault]]\nat_s = 1\nkind = "crash"\n')
    assert sim_ecu(["play", str(file), "--fast", "--log", str(log)]) == 2
    assert "faulty.toml:7: fault[1].kind:" in capsys.readouterr().err
    assert not log.exists()


def test_list_has_every_kind_of_fault(capsys: pytest.CaptureFixture[str]) -> None:
    assert sim_ecu(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if " fault: " in line] == list(KINDS)


@pytest.mark.night
def test_fault_matrix_holds_at_one_moment() -> None:
    """`python -m tests.matrix`, at one of its moments; to the core the faults of the whole bus are one."""
    assert {r.fault.kind for r in (*ROWS, *LONG_ROWS)} == set(KINDS)
    rows = [r for r in (*ROWS, *LONG_ROWS) if r.fault.kind not in SILENT[1:]]
    matrix = Matrix(rows, BEGINS_S[1:2])
    wrong = {(r.fault.kind, r.fault.of, r.fault.duration_s, r.fault.amount): matrix.play(r).wrong for r in rows}
    assert {k: v for k, v in wrong.items() if v} == {}
