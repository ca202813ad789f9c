"""Validity and its cause."""

import struct
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from tests.support.can_ids import (
    TORQUE_A1,
    TORQUE_A2,
)
from tests.support.config_texts import AXLE
from tests.support.sensor_simulator import SensorSimulator, validities
from wrcd import resources
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config import load_config
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.validity import OF_ESTIMATE, OF_PAIR, ValidityMonitor, verdict
from wrcd.estimator.doubts import Doubt
from wrcd.estimator.records import EstimateDoubt

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
    assert verdict(judge.standing(0, Doubt.NONE), 0, estimate)[1] is cause
    # what is wrong with the sensors comes first
    for pair, of_pair in OF_PAIR.items():
        assert verdict(judge.standing(0, pair), 0, estimate) == (Validity.DEGRADED, of_pair)
    judge.update(0, Cause.UNCHANGED)
    assert verdict(judge.standing(0, Doubt.SILENT), 0, estimate) == (Validity.DEGRADED, Cause.UNCHANGED)
    assert set(OF_PAIR) == set(Doubt) - {Doubt.NONE}
    assert set(OF_ESTIMATE) == set(EstimateDoubt) - {EstimateDoubt.NONE}


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
