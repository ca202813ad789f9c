"""Validity and its cause."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.can_ids import LAT_ACCEL_A1, TORQUE_A1, TORQUE_A2, VEHICLE_SPEED, YAW_RATE_A1
from tests.support.config_texts import AXLE
from tests.support.sensor_simulator import SensorSimulator, beside, until_ms, validities
from tests.support.told_stages import Monitor, level_of
from wrcd import resources
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.layouts import layouts
from wrcd.core.terms import EstimateDoubt, PairState

DEFAULT = load_config(None)
DEAD_SHARE = 0.005  # of 2 N r_0: so far below zero a torque may be its signal's noise, for so long
TRACTION_HELD_MS = 60
FREE_RESETS, FIRST_WAIT_S, LAST_WAIT_S = 4, 1.0, 8.0
OF_PAIR = {
    PairState.BOTH_DEAD: Cause.SENSORS_SILENT,
    PairState.REVERSED: Cause.GYRO_REVERSED,
    PairState.OTHER_AXLE: Cause.SENSORS_UNRELATED,
    PairState.LATE: Cause.SENSORS_UNRELATED,
    PairState.ACCEL_DEAD: Cause.ACCEL_SMALL,
    PairState.WRONG_UNIT: Cause.ACCEL_SMALL,
    PairState.GYRO_DEAD: Cause.GYRO_DEAD,
}
OF_ESTIMATE = {
    EstimateDoubt.NO_RULE: Cause.NO_RULE,
    EstimateDoubt.BEYOND_TRAINING: Cause.BEYOND_TRAINING,
    EstimateDoubt.HARSH: Cause.HARSH,
    EstimateDoubt.SHORT: Cause.TOO_LITTLE_DATA,
    EstimateDoubt.GAPS: Cause.TOO_LITTLE_DATA,
}


def own(tmp_path: Path, more: str = "", vehicle: str = "") -> SensorSimulator:
    (tmp_path / "wrcd.toml").write_text(f'[vehicle]\nspeed = "VehicleSpeed.Speed"\n{vehicle}{AXLE}{more}')
    return SensorSimulator(load_config(tmp_path / "wrcd.toml"))


@pytest.mark.parametrize(
    ("min_speed", "speed", "cause"),
    [
        (5.0, 4.9975, "Standstill"),
        (5.0, 5.0, ""),
        (2.0, 2.9975, "SpeedOutOfRange"),
        (2.0, 3.0, ""),
        (2.0, 60.0, ""),
        (2.0, 60.0025, "SpeedOutOfRange"),
    ],
)
def test_speeds_with_an_estimate_include_their_ends(config: Config, min_speed: float, speed: float, cause: str) -> None:
    sim = SensorSimulator(replace(config, min_speed_m_s=min_speed))
    sim.speed = speed
    assert (sim.run(1500)[-1]["Validity"] == "NotAvailable") == (cause == "Standstill")
    assert sim.causes()[-1] == (cause or "None")


def test_sensor_status_degrades_or_rejects(sim: SensorSimulator) -> None:
    sim.run(1500)
    degraded = sim.during(500, yaw_status=1)[2:]
    # only Valid frames have a confidence
    assert {(f["Validity"], f["Confidence"]) for f in degraded} == {("Degraded", "None")}
    assert all(isinstance(f["MuAvailable"], float) for f in degraded)
    assert sim.during(300, yaw_status=14)[-1]["Validity"] == "NotAvailable"
    assert sum(sim.core.counts.rejected.values()) == 60


@pytest.mark.parametrize(
    ("total", "brake", "torque", "expected"),
    [
        (True, False, -8_000.0, "Valid"),
        (False, False, -8_000.0, "Degraded"),
        (False, False, -0.01, "Degraded"),
        (False, False, 0.0, "Degraded"),  # the friction brakes may act alone
        (False, False, 0.05, "Valid"),
        (False, False, 8_000.0, "Valid"),
        (False, True, -8_000.0, "Valid"),
        (False, True, 8_000.0, "Valid"),
    ],
)
def test_braking_with_an_unknown_friction_share_is_degraded(
    tmp_path: Path, total: bool, brake: bool, torque: float, expected: str
) -> None:
    more = 'brake_torque = "Torque_A2.Torque"\n' if brake else ""
    sim = own(tmp_path, more, f"torque_is_total = {str(total).lower()}\n")
    sim.torque = torque
    last = sim.run(1500, lambda frames: beside(frames, TORQUE_A1, TORQUE_A2, -100_000))[-1]
    assert last["Validity"] == expected
    used = abs(torque - (1_000.0 if brake else 0.0))
    assert last["MuUsed"] == pytest.approx(100 * used / (2 * 73549.875 * 0.5) - 0.005, abs=0.006)


@pytest.mark.parametrize(
    ("changed", "cause"),
    [
        ({"yaw_status": 1}, "SensorDegraded"),
        ({"speed": 60.5}, "SpeedOutOfRange"),
        ({"torque": 0.0}, "FrictionShareUnknown"),  # the friction brakes alone
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_degraded_input_degrades_for_one_window(tmp_path: Path, changed: dict[str, Any], cause: str) -> None:
    """The estimate is a window old: what was not sound must have left it."""
    sim = own(tmp_path, vehicle="torque_is_total = false\n")
    sim.speed = 59.9
    assert sim.run(1500)[-1]["Validity"] == "Valid"
    assert sim.during(1500, **changed)[-1]["Validity"] == "Degraded"
    frames = sim.run(1500)
    assert validities(frames) == ["Degraded", "Valid"]
    assert 1000 <= until_ms(frames, "Valid") <= 1040
    assert sim.causes()[-2:] == [cause, "None"]


def test_valid_frame_has_no_more_adhesion_in_use_than_available(sim: SensorSimulator) -> None:
    frames = []
    for k in range(300):
        sim.torque = 2_000.0 + 9_000.0 * (k % 20 >= 10)  # steps that the newest part's mean is behind
        frames += sim.run(20)
    valid = [f for f in frames if f["Validity"] == "Valid"]
    assert len(valid) > 20
    assert all(f["MuUsed"] <= f["MuAvailable"] for f in valid)


def with_body(tmp_path: Path, unit: str, mapped: str) -> SensorSimulator:
    """A DBC of its own, whose message Body has a value in hundredths of a unit."""
    message = f'\nBO_ 800 Body: 8 TCU\n SG_ V : 0|16@1+ (0.01,0) [0|600] "{unit}" WRCD\n\nCM_ '
    (tmp_path / "own.dbc").write_text(resources.DBC.read_text("cp1252").replace("\nCM_ ", message, 1), "cp1252")
    return own(tmp_path, f'{mapped}\n[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n')


def body(sim: SensorSimulator, value: float) -> Frame:
    return Frame(sim.t - 4000, 800, struct.pack("<H", round(value / 0.01)) + bytes(6))


@pytest.mark.parametrize(
    ("key", "share", "cause"),
    [
        ("axle_load", 0.71, "None"),
        ("axle_load", 0.69, "LoadBeyond"),
        ("axle_load", 1.29, "None"),
        ("axle_load", 1.31, "LoadBeyond"),
        ("wheel_radius", 0.91, "None"),
        ("wheel_radius", 0.89, "RadiusBeyond"),
        ("wheel_radius", 1.09, "None"),
        ("wheel_radius", 1.11, "RadiusBeyond"),
    ],
)
def test_load_or_radius_beyond_the_design_is_degraded(tmp_path: Path, key: str, share: float, cause: str) -> None:
    design = DEFAULT.design
    unit, usual = ("kN", 2e-3 * design.normal_N) if key == "axle_load" else ("mm", 1e3 * design.r_0)
    sim = with_body(tmp_path, unit, f'{key} = "Body.V"')
    last = sim.run(1500, lambda frames: [*frames, body(sim, share * usual)])[-1]
    assert last["Validity"] == ("Valid" if cause == "None" else "Degraded")
    assert sim.causes()[-1] == cause


def test_age_of_a_load_told_once_a_second_is_no_sample_age(tmp_path: Path) -> None:
    sim = with_body(tmp_path, "kN", 'axle_load = { signal = "Body.V", timeout_ms = 3000 }')
    for _ in range(3):
        sim.out += sim.core.feed(body(sim, 2e-3 * DEFAULT.design.normal_N))
        sim.run(1000)
    valid = [f for f in sim.adhesion(sim.out) if f["Validity"] == "Valid"]
    assert len(valid) > 90
    assert {f["SampleAge"] for f in valid} == {4}
    assert sim.during(40, silent={TORQUE_A1})[-1]["SampleAge"] > 40


def test_dip_of_the_torque_within_its_noise_is_no_braking(tmp_path: Path) -> None:
    """As where a controller lets go of a wheel that slips."""
    sim = own(tmp_path, vehicle="torque_is_total = false\n")
    sim.torque = 3_000.0
    sim.run(1500)
    carried = 2 * DEFAULT.design.normal_N * DEFAULT.design.r_0
    for dip, ms, brakes in (
        (-135.0, 30, False),
        (-0.9 * DEAD_SHARE * carried, TRACTION_HELD_MS, False),
        (-1.1 * DEAD_SHARE * carried, 10, True),  # braking
        (0.0, TRACTION_HELD_MS + 20, True),  # the friction brakes may act alone
    ):
        before = sim.core.events.total
        sim.during(ms, torque=dip)
        sim.run(1500)
        told = {change.cause for change in sim.core.events.since(before)}
        assert (Cause.FRICTION_SHARE_UNKNOWN in told) == brakes, dip


def test_traction_is_as_old_as_the_torque_that_told_it(tmp_path: Path) -> None:
    """Which comes every 25 ms, and the other inputs between."""
    sim = own(tmp_path, vehicle="torque_is_total = false\n")

    def slow(frames: list[Frame]) -> list[Frame]:
        others = [f for f in frames if f.can_id != TORQUE_A1]
        (torque,) = [f for f in frames if f.can_id == TORQUE_A1]
        now = replace(torque, data=protect(torque.data, TORQUE_A1, sim.counter // 5 % 15))
        return [*others, now] if sim.counter % 5 == 1 else others

    sim.torque = 3_000.0
    sim.run(1500, slow)
    for count, brakes in ((2, False), (3, True)):
        before = sim.core.events.total
        sim.during(25 * count, slow, torque=-10.0)
        sim.run(1500, slow)
        told = {change.cause for change in sim.core.events.since(before)}
        assert (Cause.FRICTION_SHARE_UNKNOWN in told) == brakes


@pytest.mark.parametrize("step_us", [-3_600_000_000, 3_600_000_000])
def test_traction_before_a_time_step_is_none_now(tmp_path: Path, step_us: int) -> None:
    sim = own(tmp_path, vehicle="torque_is_total = false\n")
    sim.torque = 3_000.0
    sim.run(1500)
    sim.t += step_us
    sim.torque = 0.0
    sim.run(1500)
    assert sim.causes()[-1] == "FrictionShareUnknown"


@pytest.mark.parametrize("lost", [lambda k: k % 3 == 0, lambda k: k % 4 < 2, lambda k: k % 6 < 3])
def test_lost_frames_are_too_little_data_or_stale_and_not_harsh(
    lost: Callable[[int], bool], sim: SensorSimulator
) -> None:
    for k in range(600):
        sim.silent = {YAW_RATE_A1, LAT_ACCEL_A1} if lost(k) else set()
        sim.run(5)
    late = sim.decoded("AdhesionDetail_A1")[15:]  # the window is full
    assert {str(row["Cause"]) for row in late} <= {"TooLittleData", "InputStale"}
    (change,) = [c for c in sim.core.events.since(0) if c.cause is Cause.TOO_LITTLE_DATA][:1]
    assert "hold consecutive measurements, limit 40 %" in change.detail


@pytest.mark.parametrize("lost", [lambda k: k % 5 == 0, lambda k: k % 6 < 2])
def test_estimate_of_what_is_left_is_valid_and_the_same(lost: Callable[[int], bool], sim: SensorSimulator) -> None:
    """Where a fifth or a third of the frames is lost, more than 0.4 of the window holds measurements on end."""
    sim.run(2500)
    before = float(sim.decoded("Adhesion_A1")[-1]["MuAvailable"])
    for k in range(400):
        sim.silent = {YAW_RATE_A1, LAT_ACCEL_A1} if lost(k) else set()
        sim.run(5)
    late = sim.decoded("Adhesion_A1")[130:]
    assert {str(row["Validity"]) for row in late} == {"Valid"}
    assert max(abs(float(row["MuAvailable"]) - before) for row in late) < 0.1 * before + 1.0


def test_start_and_stop_have_a_cause_for_each_state(sim: SensorSimulator) -> None:
    sim.out += sim.core.advance(sim.t)
    sim.out += sim.core.advance(sim.t + 500_000)
    sim.t += 500_000
    sim.run(1500)
    sim.during(300, silent={TORQUE_A1})
    sim.run(1500)
    while sim.speed > 1.0:
        sim.speed -= 0.2
        sim.run(20)
    sim.run(500)
    assert sim.adhesion(sim.out)[-1]["Validity"] == "NotAvailable"  # and no fault
    sim.speed = 25.0
    sim.run(1500)
    # slow, a window is of too little track
    told = [c for c, _ in groupby(c for c in sim.causes() if c != "TooLittleData")]
    assert told[:7] == ["InputSilent", "WarmingUp", "None", "InputSilent", "WarmingUp", "None", "Standstill"]
    assert told[-1] == "None"


@pytest.mark.parametrize(
    ("doubt", "cause"), [*OF_ESTIMATE.items(), (EstimateDoubt.NONE, Cause.NONE)], ids=lambda x: x.name
)
def test_doubtful_estimate_is_degraded_with_its_cause(doubt: EstimateDoubt, cause: Cause, sim: SensorSimulator) -> None:
    sim.run(1500)
    estimate = next(o.why for o in reversed(sim.out) if o.why is not None).copy()
    estimate["doubt"] = doubt
    judge = Monitor(200)
    for _ in range(200):
        judge.update(Cause.NONE)
    assert judge.verdict(PairState.SOUND, estimate)[1] is cause
    # what is wrong with the sensors comes first
    for pair, of_pair in OF_PAIR.items():
        assert judge.verdict(pair, estimate) == (Validity.DEGRADED, of_pair)
    judge.update(Cause.UNCHANGED)
    assert judge.verdict(PairState.BOTH_DEAD, estimate) == (Validity.DEGRADED, Cause.UNCHANGED)
    assert set(OF_PAIR) == set(PairState) - {PairState.SOUND}
    assert set(OF_ESTIMATE) == set(EstimateDoubt) - {EstimateDoubt.NONE}


SOUND, STALE, TOLD = Cause.NONE, Cause.INPUT_STALE, Cause.SENSOR_DEGRADED


@pytest.mark.parametrize(
    ("ticks", "validity", "cause"),
    [
        ([(SOUND, 19)], Validity.NOT_AVAILABLE, SOUND),
        ([(SOUND, 20)], Validity.VALID, SOUND),
        # a tick that is not sound belongs to a window all the same, for which the axle is Degraded
        ([(TOLD, 10), (SOUND, 9)], Validity.NOT_AVAILABLE, SOUND),
        ([(TOLD, 10), (SOUND, 10)], Validity.DEGRADED, TOLD),
        ([(TOLD, 20), (SOUND, 19)], Validity.DEGRADED, TOLD),
        ([(TOLD, 20), (SOUND, 20)], Validity.VALID, SOUND),
        # eight ticks without an input neither belong to it nor end it
        ([(SOUND, 20), (STALE, 8)], Validity.DEGRADED, STALE),
        ([(SOUND, 20), (STALE, 8), (SOUND, 1)], Validity.VALID, SOUND),
        ([(SOUND, 10), (STALE, 8), (SOUND, 9)], Validity.NOT_AVAILABLE, SOUND),
        ([(SOUND, 10), (STALE, 8), (SOUND, 10)], Validity.VALID, SOUND),
        ([(SOUND, 10), (STALE, 8), (SOUND, 1), (STALE, 8), (SOUND, 9)], Validity.VALID, SOUND),
        # nine end it
        ([(SOUND, 20), (STALE, 9), (SOUND, 19)], Validity.DEGRADED, STALE),
        ([(SOUND, 20), (STALE, 9), (SOUND, 20)], Validity.VALID, SOUND),
        ([(SOUND, 10), (STALE, 9), (SOUND, 19)], Validity.NOT_AVAILABLE, SOUND),
        ([(TOLD, 10), (STALE, 9), (TOLD, 19)], Validity.NOT_AVAILABLE, TOLD),
        ([(TOLD, 10), (STALE, 9), (TOLD, 20)], Validity.DEGRADED, TOLD),
    ],
    ids=str,
)
def test_axle_is_valid_after_a_full_window_of_sound_ticks(
    ticks: list[tuple[Cause, int]], validity: Validity, cause: Cause
) -> None:
    judge = Monitor(20)
    for _ in range(20):
        judge.update(Cause.UNCHANGED)
    judge.reset(SOUND)
    for against, count in ticks:
        for _ in range(count):
            judge.update(against)
    assert judge.verdict(PairState.SOUND, np.zeros(1, dtype=layouts()["estimate"])) == (validity, cause)


def test_wide_interval_is_valid_and_its_level_does_not_flicker(sim: SensorSimulator) -> None:
    sim.run(1500)
    assert level_of(sim, 0.9, before="None") == "Within1pp"
    said = [level_of(sim, half_width_pp) for half_width_pp in (1.1, 0.95, 1.05, 0.89, 30.0, 11.5, 10.7, 0.5)]
    assert said == [
         "Within2pp", "Within2pp", "Within2pp", "Within1pp", "Wider", "Wider", "Within12pp", "Within1pp"
    ]  # fmt: skip


def test_short_window_excuses_no_other_cause(config: Config) -> None:
    """The recorder takes what is short for no loss: a sensor that says Degraded is one, whatever the window is."""
    sim = SensorSimulator(replace(config, design=replace(config.design, window_s=0.12, recent_s=0.05)))
    sim.speed = 20.0
    sim.run(1500)
    assert (sim.core.reports[0].cause, sim.core.reports[0].short) == (Cause.TOO_LITTLE_DATA, True)
    sim.during(200, yaw_status=1)
    assert (sim.core.reports[0].cause, sim.core.reports[0].short) == (Cause.SENSOR_DEGRADED, False)


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


STEP_EVERY, PER_S = 10, 200  # ticks


def stormy(sim: SensorSimulator, seconds: float) -> Iterator[float]:
    """A yaw rate that steps to and fro without end; yields what time it is before each tick."""
    for k in range(round(seconds * PER_S)):
        sim.spike = 5_000_000 if k // STEP_EVERY % 2 else 0
        yield k / PER_S
    sim.spike = 0


def storm(sim: SensorSimulator, seconds: float) -> list[float]:
    """When the axle was reset in one."""
    resets = []
    for now_s in stormy(sim, seconds):
        before = sim.core.counts.restarts
        sim.run(5)
        if sim.core.counts.restarts > before:
            resets.append(now_s)
    return resets


def test_axle_that_is_reset_again_and_again_waits_and_comes_back(sim: SensorSimulator) -> None:
    """Each time for twice as long, up to a bound; at rest it comes back by itself."""
    resets = storm(sim, 60.0)
    gaps = [b - a for a, b in pairwise(resets)]
    assert max(gaps[: FREE_RESETS - 1]) < 0.3
    wait = FIRST_WAIT_S
    for gap in gaps[FREE_RESETS:]:
        assert wait <= gap < wait + 0.3
        wait = min(2 * wait, LAST_WAIT_S)
    assert wait == LAST_WAIT_S
    assert sim.core.counts.waits == len(resets) - FREE_RESETS
    assert validities(sim.adhesion(sim.out)) == ["NotAvailable"]
    waits = sim.core.counts.waits
    frames = sim.run(12_000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert until_ms(frames, "Valid") <= 1000 * (LAST_WAIT_S + 1.2)
    # a step now, and the step back, are as on the first day
    for spike in (1_000_000, 0):
        sim.spike = spike
        sim.run(500)
    assert validities(sim.run(1000)) == ["NotAvailable", "Valid"]
    assert sim.core.counts.waits == waits


def test_wait_after_one_reset_too_many_is_told(sim: SensorSimulator) -> None:
    for _ in stormy(sim, 8.0):
        sim.run(5)
        if sim.core.counts.restarts == FREE_RESETS:
            break
    sim.during(200, silent={YAW_RATE_A1})
    storm(sim, 0.5)
    (text,) = [c.text for c in sim.core.events.since(0) if "waits" in c.text]
    assert text.endswith("; waits 1 s")


def test_other_axles_do_not_wait(config: Config) -> None:
    def of_axle_2(f: Frame) -> Frame:
        return replace(f, can_id=f.can_id + 1, data=protect(f.data, f.can_id + 1, f.data[1] & 0x0F))

    sim, other = SensorSimulator(config), SensorSimulator(config)
    for _ in stormy(sim, 8.0):
        sim.run(5, lambda own: own + [of_axle_2(f) for f in other.frames() if f.can_id != VEHICLE_SPEED])
    assert sim.core.counts.waits > 0
    assert validities(sim.adhesion(sim.out, 1)) == ["NotAvailable"]
    assert validities(sim.adhesion(sim.out, 2)) == ["NotAvailable", "Valid"]


def test_repeated_speed_jumps_make_all_axles_wait(sim: SensorSimulator) -> None:
    """Believed at its second frame each time: without a wait that is a reset every few frames."""
    sim.run(1500)
    for k in range(20 * PER_S):
        sim.speed = 25.0 if k % 8 < 4 else 28.0
        sim.run(5)
    assert sim.core.counts.restarts < 40
    assert sim.core.counts.waits == sim.core.counts.restarts - FREE_RESETS
    sim.speed = 25.0
    assert validities(sim.run(11_000)) == ["NotAvailable", "Valid"]


def test_time_step_ends_the_wait(sim: SensorSimulator) -> None:
    storm(sim, 8.0)
    assert sim.core.counts.waits > 0
    sim.t -= 3_600_000_000
    assert validities(sim.run(1200)) == ["NotAvailable", "Valid"]
