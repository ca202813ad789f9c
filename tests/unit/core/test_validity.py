"""Validity and its cause."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from tests.support.can_ids import (
    LAT_ACCEL_A1,
    TORQUE_A1,
    TORQUE_A2,
    YAW_RATE_A1,
)
from tests.support.config_texts import AXLE
from tests.support.sensor_simulator import SensorSimulator, validities
from wrcd import resources
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config import load_config
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.inputs import DEAD_SHARE, TRACTION_HELD_US
from wrcd.core.validity import OF_ESTIMATE, OF_PAIR, ValidityMonitor, verdict
from wrcd.estimator.answer import Draft
from wrcd.estimator.doubts import Doubt
from wrcd.estimator.records import Estimate, EstimateDoubt

DEFAULT = load_config(None)


def own(tmp_path: Path, more: str, vehicle: str) -> Config:
    (tmp_path / "wrcd.toml").write_text(f'[vehicle]\nspeed = "VehicleSpeed.Speed"\n{vehicle}{AXLE}{more}')
    return load_config(tmp_path / "wrcd.toml")


def causes(sim: SensorSimulator) -> list[str]:
    """Runs of equal causes in AdhesionDetail."""
    told = [str(row["Cause"]) for row in sim.decoded("AdhesionDetail_A1")]
    return [c for k, c in enumerate(told) if k == 0 or c != told[k - 1]]


def test_standstill_is_not_available_and_no_fault(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.speed = 2.0
    assert validities(sim.run(1000))[-1] == "NotAvailable"
    sim.speed = 25.0
    assert validities(sim.run(2000)) == ["NotAvailable", "Valid"]


@pytest.mark.parametrize(("speed", "available"), [(4.9975, False), (5.0, True)])
def test_axle_at_min_speed_is_available(speed: float, available: bool) -> None:
    sim = SensorSimulator(replace(DEFAULT, min_speed_m_s=5.0))
    sim.speed = speed
    assert (sim.run(2000)[-1]["Validity"] != "NotAvailable") == available


def test_speed_beyond_the_design_is_degraded(sim: SensorSimulator) -> None:
    sim.speed = 60.0
    assert validities(sim.run(1500))[-1] == "Valid"
    sim.speed = 60.5
    assert validities(sim.run(200))[-1] == "Degraded"


@pytest.mark.parametrize(("speed", "outside"), [(2.9975, True), (3.0, False), (60.0, False), (60.0025, True)])
def test_design_speed_range_includes_its_ends(speed: float, outside: bool) -> None:
    sim = SensorSimulator(replace(DEFAULT, min_speed_m_s=2.0))
    sim.speed = speed
    sim.run(2000)
    # slow, with what the sensors say at speed, the estimate may be vague, too
    assert (causes(sim)[-1] == "SpeedOutOfRange") == outside


def test_sensor_status_degrades_or_rejects(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.yaw_status = 1
    assert validities(sim.run(200))[-1] == "Degraded"
    sim.yaw_status = 14
    assert validities(sim.run(300))[-1] == "NotAvailable"
    assert sum(sim.core.counts.rejected.values()) == 60


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


@pytest.mark.parametrize("fault", ["status", "speed"])
def test_degraded_input_degrades_for_one_window(fault: str, sim: SensorSimulator) -> None:
    """The estimate is a window old: what was not sound must have left it."""
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


def test_only_valid_frames_have_a_confidence(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.yaw_status = 1
    degraded = [f for f in sim.run(500) if f["Validity"] == "Degraded"]
    assert len(degraded) > 20
    assert {f["Confidence"] for f in degraded} == {"None"}
    assert all(isinstance(f["MuAvailable"], float) for f in degraded)


def test_valid_frame_has_no_more_adhesion_in_use_than_available(sim: SensorSimulator) -> None:
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


def test_age_of_a_load_told_once_a_second_is_no_sample_age(tmp_path: Path) -> None:
    message = '\nBO_ 800 Body: 8 TCU\n SG_ V : 0|16@1+ (0.01,0) [0|600] "kN" WRCD\n\nCM_ '
    text = resources.DBC.read_text("cp1252").replace("\nCM_ ", message, 1)
    (tmp_path / "own.dbc").write_text(text, "cp1252")
    load = (
        'axle_load = { signal = "Body.V", timeout_ms = 3000 }\n[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "default"\n'
    )
    sim = SensorSimulator(own(tmp_path, load, ""))
    raw = struct.pack("<H", round(2e-3 * DEFAULT.design.normal_N / 0.01)) + bytes(6)
    for _ in range(3):
        sim.out += sim.core.feed(Frame(sim.t, 800, raw))
        sim.run(1000)
    valid = [f for f in sim.adhesion(sim.out) if f["Validity"] == "Valid"]
    assert len(valid) > 90
    assert {f["SampleAge"] for f in valid} == {4}
    sim.silent = {TORQUE_A1}
    assert sim.run(40)[-1]["SampleAge"] > 40


def test_dip_of_the_torque_within_its_noise_is_no_braking(tmp_path: Path) -> None:
    """As where a controller lets go of a wheel that slips."""
    sim = SensorSimulator(own(tmp_path, "", "torque_is_total = false\n"))
    sim.torque = 3_000.0
    sim.run(1500)
    carried = 2 * DEFAULT.design.normal_N * DEFAULT.design.r_0
    for dip, ms, brakes in (
        (-135.0, 30, False),
        (-0.9 * DEAD_SHARE * carried, TRACTION_HELD_US // 1000, False),
        (-1.1 * DEAD_SHARE * carried, 10, True),  # braking
        (0.0, TRACTION_HELD_US // 1000 + 20, True),  # the friction brakes may act alone
    ):
        sim.torque = dip
        before = sim.core.events.total
        sim.run(ms)
        sim.torque = 3_000.0
        sim.run(1500)
        told = {change.cause for change in sim.core.events.since(before)}
        assert (Cause.FRICTION_SHARE_UNKNOWN in told) == brakes, dip


@pytest.mark.parametrize("lost", [lambda k: k % 5 == 0, lambda k: k % 6 < 2, lambda k: k % 6 < 3])
def test_lost_frames_are_too_little_data_or_stale_and_not_harsh(
    lost: Callable[[int], bool], sim: SensorSimulator
) -> None:
    for k in range(600):
        sim.silent = {YAW_RATE_A1, LAT_ACCEL_A1} if lost(k) else set()
        sim.run(5)
    late = sim.decoded("AdhesionDetail_A1")[15:]  # the window is full
    assert {str(row["Cause"]) for row in late} <= {"TooLittleData", "InputStale"}
    (change,) = [c for c in sim.core.events.since(0) if c.cause is Cause.TOO_LITTLE_DATA][:1]
    assert "hold measurements on end, limit 70 %" in change.detail


def test_start_and_stop_have_a_cause_for_each_state(sim: SensorSimulator) -> None:
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


def test_reset_after_outliers_has_the_cause_restarted(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.spike = 500_000
    sim.run(400)
    assert causes(sim)[-1] == "Restarted"
    sim.run(1500)
    assert causes(sim)[-1] == "None"


@pytest.mark.parametrize(
    ("doubt", "cause"), [*OF_ESTIMATE.items(), (EstimateDoubt.NONE, Cause.NONE)], ids=lambda x: x.name
)
def test_doubtful_estimate_is_degraded_with_its_cause(doubt: EstimateDoubt, cause: Cause, sim: SensorSimulator) -> None:
    sim.run(1500)
    estimate = replace(sim.core.estimator.estimate(), doubt=np.full(4, int(doubt)))
    judge = ValidityMonitor(200, 4)
    for _ in range(200):
        judge.update(0, Cause.NONE)
    before = Validity.DEGRADED
    assert verdict(judge.standing(0, Doubt.NONE), 0, estimate, before)[1] is cause
    # what is wrong with the sensors comes first
    for pair, of_pair in OF_PAIR.items():
        assert verdict(judge.standing(0, pair), 0, estimate, before) == (Validity.DEGRADED, of_pair)
    judge.update(0, Cause.UNCHANGED)
    assert verdict(judge.standing(0, Doubt.SILENT), 0, estimate, before) == (Validity.DEGRADED, Cause.UNCHANGED)
    assert set(OF_PAIR) == set(Doubt) - {Doubt.NONE}
    assert set(OF_ESTIMATE) == set(EstimateDoubt) - {EstimateDoubt.NONE}


@pytest.mark.parametrize("held", [False, True], ids=["at once", "held back"])
def test_wide_interval_keeps_what_is_valid_and_makes_nothing_so(
    held: bool, sim: SensorSimulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    none, wide, vague = EstimateDoubt.NONE, EstimateDoubt.WIDE, EstimateDoubt.VAGUE
    doubts = iter([wide] * 3 + [none, wide, wide, none, wide] + [vague, wide, wide, none])
    estimates = sim.core.estimator.estimates

    def doubtful(drafts: Sequence[Draft]) -> list[Estimate]:
        return [replace(e, doubt=np.full(4, int(next(doubts, none)))) for e in estimates(drafts)]

    monkeypatch.setattr(sim.core.estimator, "estimates", doubtful)
    if held:
        sim.core.hold()
    sim.run(2000)
    if held:
        sim.out += sim.core.release()
    said = [f["Validity"] for f in sim.adhesion(sim.out) if f["Validity"] != "NotAvailable"]
    assert said[:12] == ["Degraded"] * 3 + ["Valid"] * 5 + ["Degraded"] * 3 + ["Valid"]


def test_residuals_beyond_training_are_never_valid(config: Config) -> None:
    """Rules made from residuals of another size than any rail makes: unknown, and said so."""
    d = config.design
    sim = SensorSimulator(replace(config, design=replace(d, low=d.low + 9.0, high=d.high + 9.0, beyond=0.1)))
    frames = sim.run(3000)
    assert {f["Validity"] for f in frames} == {"NotAvailable", "Degraded"}
    assert {f["Confidence"] for f in frames} == {"None"}
    assert sim.core.reports[0].cause is Cause.BEYOND_TRAINING


def test_adhesion_in_use_beyond_the_estimate_is_a_contradiction(config: Config) -> None:
    """Rules that say a quarter of what they should; a torque of two thirds of the load says not so."""
    sim = SensorSimulator(replace(config, design=replace(config.design, polynomial=0.25 * config.design.polynomial)))
    sim.torque = 2000.0
    sim.run(1000)
    for torque in range(2000, 60_000, 2000):
        sim.torque = float(torque)
        sim.run(10)
    sim.run(300)
    rows = sim.decoded("InputHealth_A1")
    assert {row["Plausibility"] for row in rows} >= {"Unknown", "Contradiction"}
    contradicted = [row["Plausibility"] == "Contradiction" for row in rows]
    adhesion = sim.decoded("Adhesion_A1")[4::5]
    assert all(a["Validity"] != "Valid" for a, c in zip(adhesion, contradicted, strict=True) if c)
