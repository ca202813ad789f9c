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
from tests.matrix.expected import (
    LONG_ROWS,
    ROWS,
    SETTLED_AFTER_MS,
    Found,
    Leaves,
    Must,
    Stays,
    Unseen,
    expected_lines,
    wrong_lines,
)
from tests.matrix.matrix import BEGINS_S, Matrix, SentAdhesion, judge
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


BAD = {
    "crv:at=3": "there is no fault 'crv' — did you mean 'crc'?",
    "": "there is no fault ''",
    "crc": "--fault crc: at: is missing",
    "crc:at=x": "at: takes a number, not 'x'",
    "crc:at=-1": "at: takes a number from 0",
    "crc:at=3,far=1": "far: unknown key — did you mean 'for'?",
    "crc:at=3,for=0": "for: takes a number from 0.001",
    "crc:at=3,of=yawrate": "did you mean 'yaw_rate'?",
    "crc:at=3,axle=4": "axle: axle 4 is not among the scenario's: 1, 2, 3",
    "crc:at=3,axle=1.5": "axle: takes a whole number",
    "crc:at=3,amount=1": "amount: unknown key",
    "crc:at=3,at=4": "not valid TOML",
    "crc:3": "'3' is not KEY=VALUE",
    "loss:at=3,amount=2": "amount: takes a number from 0 to 1",
    "bias:at=3,of=all,amount=1": "amount: is in the unit of one signal",
    "swap:at=3,of=speed": "of: the speed belongs to no axle",
    "link-down:at=3,axle=1": "axle: unknown key",
}


@pytest.mark.parametrize("spec", BAD)
def test_bad_fault_specification_is_an_error_with_its_key(spec: str) -> None:
    with pytest.raises(InputError) as e:
        parse_fault(spec, [1, 2, 3])
    assert BAD[spec] in str(e.value)


def test_fault_behind_the_scenarios_end_is_an_error() -> None:
    assert parse_fault("dead:at=29.9", [1], 30.0).at_s == 29.9
    for at in ("30", "60"):
        with pytest.raises(InputError, match=f"at: {at} s is not before the scenario's end — it lasts 30 s"):
            parse_fault(f"dead:at={at}", [1], 30.0)


def test_play_takes_no_fault_behind_the_scenarios_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "a.log"
    assert sim_ecu(["play", "half-wet", "--fault", "dead:at=600", "--fast", "--log", str(log)]) == 2
    assert "not before the scenario's end" in capsys.readouterr().err
    assert not log.exists()


def test_swap_of_a_single_axle_is_an_error() -> None:
    with pytest.raises(InputError, match="two axles"):
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
    file = tmp_path / "faulty.toml"
    file.write_text('[[rail]]\ncurve = "C"\n[drive]\nutilisation = 0.1\n[[fault]]\nat_s = 1\nkind = "crash"\n')
    assert sim_ecu(["play", str(file), "--fast", "--log", str(tmp_path / "x.log")]) == 2
    assert "faulty.toml:7: fault[1].kind: is 'crash', not one of" in capsys.readouterr().err


def test_list_has_every_kind_of_fault(capsys: pytest.CaptureFixture[str]) -> None:
    assert sim_ecu(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if " fault: " in line] == list(KINDS)


def frames_said(valid: Sequence[bool], mu: float = 20.0) -> list[SentAdhesion]:
    return [SentAdhesion(20_000 * k, k, v, mu) for k, v in enumerate(valid, 1)]


SETTLED = round(SETTLED_AFTER_MS / 20)  # frames
# a frame every 20 ms; a fault from 100 ms to 300 ms is left 40 ms after it began, and forgotten 240 ms after it ended
GOOD = [*[True] * 6, *[False] * 20, *[True] * (SETTLED + 30)]
ALWAYS = [True] * len(GOOD)
MUS = dict.fromkeys(range(300), 20.0)  # without the fault
LEAVES = Leaves(within_ms=40.0, back_ms=240.0)


# must, Validity of each frame, MuAvailable in % until the fault has settled and from then on, the verdict
@pytest.mark.parametrize(
    ("must", "valid", "mu", "late", "wrong"),
    [
        pytest.param(LEAVES, GOOD, 20.0, 20.0, "", id="leaves in time and comes back"),
        pytest.param(LEAVES, ALWAYS, 20.0, 20.0, "Valid for too long", id="never leaves"),
        pytest.param(LEAVES, [True, *GOOD], 20.0, 20.0, "Valid for too long", id="leaves a frame late"),
        pytest.param(
            LEAVES, [*GOOD[:10], True, *GOOD[11:]], 20.0, 20.0, "Valid during the fault", id="Valid in between"
        ),
        pytest.param(LEAVES, GOOD[:20], 20.0, 20.0, "not Valid again in time", id="never comes back"),
        pytest.param(
            LEAVES, [*GOOD[:10], False, *GOOD[10:]], 20.0, 20.0, "not Valid again in time", id="back a frame late"
        ),
        pytest.param(LEAVES, [*GOOD, False], 20.0, 20.0, "not Valid for good afterwards", id="leaves again"),
        pytest.param(LEAVES, GOOD, 20.0, 22.0, "not itself again", id="another estimate afterwards"),
        pytest.param(Stays(0.5), ALWAYS, 20.5, 20.0, "", id="stays within its change"),
        pytest.param(Stays(0.4), ALWAYS, 20.5, 20.0, "changed too much", id="stays and changes more"),
        pytest.param(Stays(0.5), GOOD, 20.0, 20.0, "not Valid throughout", id="does not stay"),
        pytest.param(Unseen(), GOOD, 30.0, 20.0, "", id="unseen, itself again"),
        pytest.param(Unseen(), GOOD, 30.0, 22.0, "not itself again", id="unseen, another estimate afterwards"),
        # found out at 200 ms; what comes after the fault's end is not judged
        pytest.param(
            Found(100.0), [*[True] * 10, *[False] * 5, *[True] * 70], 30.0, 30.0, "", id="found out in time"
        ),
        pytest.param(
            Found(100.0), [*[True] * 11, *[False] * 4, *[True] * 70], 20.0, 20.0, "not found out",
            id="found out a frame late",
        ),
        pytest.param(Found(100.0), ALWAYS, 20.0, 20.0, "not found out", id="never found out"),
    ],
)  # fmt: skip
def test_fault_is_judged_by_what_must_be(must: Must, valid: Sequence[bool], mu: float, late: float, wrong: str) -> None:
    said = [*frames_said(valid, mu)[: SETTLED + 10], *frames_said(valid, late)[SETTLED + 10 :]]
    assert judge(must, 100_000, 300_000, said, MUS).wrong == wrong


def test_verdict_has_times_and_changes_of_the_estimate() -> None:
    verdict = judge(LEAVES, 100_000, 300_000, frames_said(GOOD, 20.5), MUS)
    assert (verdict.left_ms, verdict.back_ms, verdict.change_pp, verdict.settled_pp) == (40.0, 240.0, 0.5, 0.5)


HARSH = "Valid -> Degraded, Harsh: 50 % of 1.00 s are far from pulses, limit 40 %"
BURST = next(r for r in ROWS if r.fault.kind == "burst")
BURST_LINES = [
    "axle 1: Valid -> Degraded, InputStale: yaw rate YawRate_A1.YawRate 20.0 ms old, limit 15",
    "axle 1: Degraded -> NotAvailable, InputSilent: yaw rate YawRate_A1.YawRate 105.0 ms old, limit 100",
    "axle 1: NotAvailable, WarmingUp: 0.01 s of the window's 1 s",
    "rejected 1 frames in the last second: counter YawRate_A1 1",
    "axle 1: NotAvailable -> Valid",
]


@pytest.mark.parametrize(
    ("changed", "wrong"),
    [
        pytest.param({}, "", id="as expected"),
        pytest.param(
            {0: "of another figure 19.0 ms"}, "does not say of axle 1: Valid -> Degraded, InputStale", id="text"
        ),
        pytest.param({0: BURST_LINES[0].replace("limit 15", "limit 16")}, "does not say of axle 1", id="limit"),
        pytest.param({0: BURST_LINES[0].replace("20.0", "25.0")}, "", id="another figure"),
        pytest.param({1: BURST_LINES[1].replace("YawRate_A1", "YawRate_A2")}, "does not say of axle 1", id="input"),
        pytest.param({2: ""}, "does not say of axle 1: NotAvailable, WarmingUp", id="a line less"),
        pytest.param(
            {4: "axle 2: Valid -> Degraded, Harsh: x"}, "does not say of axle 1: NotAvailable -> Valid", id="axle"
        ),
        pytest.param({3: BURST_LINES[3] + ", crc YawRate_A1 1"}, "were rejected: crc YawRate_A1", id="rejected"),
        pytest.param({3: ""}, "does not say that frames were rejected", id="no rejected"),
        pytest.param({5: f"axle 2: {HARSH}"}, f"the journal also says: axle 2: {HARSH}", id="a line more"),
        pytest.param({3: "the clock stepped: started anew"}, "the journal says 'the clock", id="another line"),
    ],
)
def test_lines_of_a_journal_are_compared_with_axle_input_and_limit(changed: dict[int, str], wrong: str) -> None:
    lines = [line for k, old in enumerate([*BURST_LINES, ""]) if (line := changed.get(k, old))]
    found = wrong_lines(BURST, lines)
    assert wrong in found
    assert bool(wrong) == bool(found)


def test_every_kind_has_a_row_and_one_that_leaves_valid_expects_its_axle_and_input_in_the_journal() -> None:
    assert {r.fault.kind for r in (*ROWS, *LONG_ROWS)} == set(KINDS)
    for row in (*ROWS, *LONG_ROWS):
        said = [line for lines in expected_lines(row).axles for line in lines]
        if isinstance(row.must, Leaves | Found):
            assert any("_A1." in line or "VehicleSpeed.Speed" in line for line in said), row
        else:
            assert said == []


@pytest.mark.night
def test_fault_matrix_holds_at_one_moment() -> None:
    """`python -m tests.matrix`, at one of its moments; to the core the faults of the whole bus are one."""
    rows = [r for r in (*ROWS, *LONG_ROWS) if r.fault.kind not in SILENT[1:]]
    matrix = Matrix(rows, BEGINS_S[1:2])
    wrong = {(r.fault.kind, r.fault.of, r.fault.duration_s, r.fault.amount): matrix.play(r).wrong for r in rows}
    assert {k: v for k, v in wrong.items() if v} == {}
