"""What the monitor makes of frames: no terminal, no clock."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.daemon_frames import DEGRADED, GOOD, NOTHING, REACHED, START_US, DaemonFrames
from wrcd.bus.dbc import find_message, load_dbc
from wrcd.bus.frame import Frame
from wrcd.bus.writers import Value, Writer
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.logs.story_events import of_frames
from wrcd.monitor.buffers import Batch, ColumnBuffer, Held
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.history import event_text, state_name
from wrcd.monitor.panels import axle_at, daemon_at

ROOT = Path(__file__).parents[3]
WRCD_STATUS = 0x0B0
THIRD_PARTY = ROOT / "tests/data/dbc/third-party.toml"
TRUTH = ROOT / "dbc/sim_ecu.dbc"


def fed(model: BusModel, frames: list[Frame], until_us: int | None = None) -> BusModel:
    """All frames at once, and the time that has come."""
    model.take(Batch.of_frames(frames), 0 if until_us is None else START_US + until_us)
    model.update()
    return model


@pytest.fixture
def made(config: Config) -> DaemonFrames:
    return DaemonFrames(config)


def test_axle_shows_what_its_newest_frame_says(config: Config, made: DaemonFrames) -> None:
    model = fed(BusModel(config), made.stretch(0, 500_000, GOOD))
    now = axle_at(model, model.axles[0], model.now_us)
    assert now.event is not None
    assert (state_name(now.event), now.contact, now.surface, now.damaged) == ("Valid", "Adhering", "Dry", 0)
    assert (now.available_pct, now.low_pct, now.high_pct, now.used_pct) == pytest.approx((30, 27, 33, 10), abs=0.02)


def test_frame_with_wrong_crc_is_damaged_and_shows_nothing(config: Config, made: DaemonFrames) -> None:
    frames = made.stretch(0, 200_000, GOOD)
    wrong = made.adhesion(200_000, {**GOOD, "MuAvailable": 1.0})
    wrong.data = bytes([wrong.data[0] ^ 0xFF]) + wrong.data[1:]
    model = fed(BusModel(config), [*frames, wrong])
    now = axle_at(model, model.axles[0], model.now_us)
    assert now.damaged == 1
    assert now.available_pct == pytest.approx(30, abs=0.02)
    assert len(model.axles[0].held.adhesion) == 10


@pytest.mark.parametrize(
    ("change", "reason"),
    [({"data": b"\0\0\0"}, "length"), ({"remote": True, "data": b"", "extra": 8}, "kind"), ({"fd": True}, "kind")],
)
def test_frame_of_another_kind_or_length_is_refused(
    config: Config, made: DaemonFrames, change: dict[str, Any], reason: str
) -> None:
    wrong = replace(made.adhesion(0, GOOD), **change)
    model = fed(BusModel(config), [wrong])

    refused = model.watched[wrong.key].refused_within(model.now_us)
    assert refused == {reason: 1}
    assert not len(model.axles[0].held.adhesion)


def test_values_older_than_three_cycles_are_not_shown(config: Config, made: DaemonFrames) -> None:
    model = fed(BusModel(config), made.stretch(0, 500_000, GOOD), until_us=3_680_000)
    now = axle_at(model, model.axles[0], model.now_us)
    assert np.isnan(now.available_pct)
    assert now.event is not None
    assert state_name(now.event) == "Silent"
    assert daemon_at(model, model.now_us).parts == ["no Adhesion frame for 3.2 s"]
    assert daemon_at(model, model.now_us).level == "bad"


def test_daemon_that_never_spoke_is_said_to(config: Config) -> None:
    model = fed(BusModel(config), [Frame(START_US, 0x300, b"")], until_us=2_500_000)
    assert daemon_at(model, model.now_us).parts == ["no Adhesion frame in 2.5 s"]


def test_daemon_with_another_design_is_named(config: Config, made: DaemonFrames) -> None:
    status: dict[str, Value] = {"State": "Running", "DesignChecksum": 1.0}
    model = fed(BusModel(config), [*made.stretch(20_000, 120_000, GOOD), made.frame(config.status, 100_000, status)])
    now = daemon_at(model, model.now_us)
    assert now.level == "warn"
    assert now.parts[0].startswith("runs another design (0001, here ")


@pytest.mark.parametrize("fit", ["Unknown", "Like", "Unsure", "Unlike"])
def test_design_that_may_be_another_bogies_is_told(config: Config, made: DaemonFrames, fit: str) -> None:
    checksum = float(int(config.design.checksum[:4], 16))
    status: dict[str, Value] = {"State": "Running", "DesignFit": fit, "DesignChecksum": checksum}
    model = fed(BusModel(config), [*made.stretch(20_000, 120_000, GOOD), made.frame(config.status, 100_000, status)])
    now = daemon_at(model, model.now_us)
    parts = [f"DesignFit {fit}: wrcd check --log says more"] if fit in ("Unsure", "Unlike") else []
    assert (now.parts, now.level) == (parts, "warn" if parts else "good")


@pytest.mark.parametrize(
    ("overruns", "grown"),
    [((254.0, 255.0, 3.0), "overruns +5"), ((1.0, 3.0, 0.0, 1.0), "overruns +3")],
    ids=["wraps round", "starts anew"],
)
def test_counts_are_told_as_growth(config: Config, made: DaemonFrames, overruns: tuple[float, ...], grown: str) -> None:
    frames = [f for f in made.stretch(20_000, len(overruns) * 1_000_000, GOOD) if f.can_id != WRCD_STATUS]
    for second, count in enumerate(overruns):
        frames.append(made.frame(config.status, second * 1_000_000, {"State": "Running", "Overruns": count}))
    model = fed(BusModel(config), sorted(frames, key=lambda f: f.stamp_us))
    assert grown in daemon_at(model, model.now_us).parts


def test_events_carry_causes_and_durations(config: Config, made: DaemonFrames) -> None:
    frames = [
        *made.stretch(0, 1_000_000, NOTHING, "WarmingUp"),
        *made.stretch(1_000_000, 3_000_000, GOOD),
        *made.stretch(3_000_000, 3_400_000, DEGRADED, "Harsh"),
        *made.stretch(3_400_000, 4_000_000, GOOD),
    ]
    at_once = fed(BusModel(config), frames)
    bit_by_bit = BusModel(config)
    for k in range(0, len(frames), 5):
        fed(bit_by_bit, frames[k : k + 5])
    for model in (at_once, bit_by_bit):
        told = [(state_name(e), e.cause.label, e.duration_s) for e in model.axles[0].history.events()]
        assert told == [
            ("NotAvailable", "WarmingUp", 1.0), ("Valid", "None", 2.0), ("Degraded", "Harsh", 0.4),
            ("Valid", "None", pytest.approx(0.58)),
        ]  # fmt: skip


@pytest.mark.parametrize("rows_at_once", [pytest.param(1, marks=pytest.mark.night), 3, 17, 1000])
def test_events_have_the_causes_of_a_story(config: Config, made: DaemonFrames, rows_at_once: int) -> None:
    """However the frames come: those of a short state have no cause, and never that of an older one."""
    random = np.random.default_rng(7)
    frames, at_us = [], 0
    while at_us < 30_000_000:
        valid = bool(random.integers(2))
        end_us = at_us + 20_000 * int(random.integers(1, 30))
        cause = "None" if valid else str(random.choice(["Harsh", "InputStale", "TooLittleData"]))
        frames += made.stretch(at_us, end_us, GOOD if valid else DEGRADED, cause)
        at_us = end_us
    model = BusModel(config)
    for k in range(0, len(frames), rows_at_once):
        fed(model, frames[k : k + rows_at_once])
    axle = model.axles[0]
    a = axle.held.adhesion
    events = of_frames(1, a, axle.held.detail, None, axle.cycle_us, int(a.time_us[0]), int(a.time_us[-1]))
    told = [e for e in axle.history.events() if e.begin_us < a.time_us[-1]]
    assert len(told) > 50
    assert [(e.begin_us, e.validity, e.cause) for e in told] == [(e.begin_us, e.validity, e.cause) for e in events]
    assert [e.end_us for e in told[:-1]] == [e.end_us for e in events[:-1]]


def test_state_without_a_cause_of_its_own_shows_no_older_one(config: Config, made: DaemonFrames) -> None:
    frames = [
        *made.stretch(0, 200_000, DEGRADED, "InputStale"), *made.stretch(200_000, 300_000, GOOD),
        *(made.adhesion(t, GOOD) for t in range(300_000, 3_000_000, 20_000)),
        *(made.adhesion(t, DEGRADED) for t in range(3_000_000, 5_000_000, 20_000)),
    ]  # fmt: skip
    model = fed(BusModel(config), frames)
    assert [(state_name(e), e.cause.label) for e in model.axles[0].history.events()] == [
        ("Degraded", "InputStale"), ("Valid", "None"), ("Degraded", "None"),
    ]  # fmt: skip


def test_silence_between_frames_is_a_spell(config: Config, made: DaemonFrames) -> None:
    model = fed(BusModel(config), [*made.stretch(0, 1_000_000, GOOD), *made.stretch(3_000_000, 4_000_000, GOOD)])
    assert [state_name(e) for e in model.axles[0].history.events()] == ["Valid", "Silent", "Valid"]
    assert event_text(model.axles[0].history.events()[1]) == "Silent for 2.0 s"


def test_inputs_tell_rate_age_value_reach_and_refusals(config: Config, made: DaemonFrames) -> None:
    frames = [made.sensor("YawRate_A1", t, Status=0, YawRate=20_000) for t in range(0, 2_000_000, 5_000)]
    frames[350].data = bytes([frames[350].data[0] ^ 1]) + frames[350].data[1:]
    health = {**REACHED, "RefusedYawRate": "Jump", "ReachTorque": 254.0}
    frames.append(made.frame(config.axles[0].inputs, 1_999_000, health))
    model = fed(BusModel(config), frames, until_us=2_000_000)
    yaw, lateral, torque, _ = model.inputs_at(model.axles[0], model.now_us)
    assert yaw.rate_hz == 198  # of a second that holds 199, and one is refused
    assert yaw.age_ms == 5.0
    assert yaw.value == pytest.approx(0.02)
    assert yaw.refused == "crc 1/s, jump"
    assert (yaw.reach, torque.reach) == (255, 254)
    assert yaw.is_stale is False
    assert lateral.is_stale is True
    assert (lateral.age_ms, lateral.value) == (None, None)


def test_inputs_at_an_earlier_time_are_those_of_then(config: Config, made: DaemonFrames) -> None:
    frames = [made.sensor("YawRate_A1", t, Status=0, YawRate=t // 100) for t in range(0, 4_000_000, 5_000)]
    model = fed(BusModel(config), frames[:400] + frames[600:])
    then = model.inputs_at(model.axles[0], START_US + 2_500_000)[0]
    assert then.rate_hz == 99
    assert then.age_ms == 505.0
    assert then.value == pytest.approx(0.01995)  # of its newest frame, not of one up to a tenth of a second older


def test_truth_of_a_second_dbc_is_shown_and_checked(config: Config, made: DaemonFrames) -> None:
    database = load_dbc(TRUTH)
    message = find_message(database, "SimTruth_A1")
    writer = Writer(message)
    good = writer.raw_frame(START_US + 100_000, 5, {"MuAvailable": 2500, "MuUsed": 1000, "Status": 0})
    wrong = writer.raw_frame(START_US + 120_000, 6, {"MuAvailable": 100, "MuUsed": 1000, "Status": 0})
    wrong.data = bytes([wrong.data[0] ^ 1]) + wrong.data[1:]
    model = fed(BusModel(config, [database]), [*made.stretch(0, 100_000, GOOD), good, wrong])
    assert axle_at(model, model.axles[0], model.now_us).truth_pct == pytest.approx(25.0)
    assert not BusModel(config, [database]).has_truth


def test_truth_that_is_protected_in_another_way_is_an_input_error(config: Config, tmp_path: Path) -> None:
    file = tmp_path / "other.dbc"
    file.write_text(TRUTH.read_text().replace('BO_ 1953 "P11"', 'BO_ 1953 "P07"'))
    with pytest.raises(InputError, match="--dbc"):
        BusModel(config, [load_dbc(file)])


@pytest.mark.parametrize(
    ("frame", "bits"),
    [
        # from start to CRC, 13 behind, and half of the most stuff bits that there can be
        (Frame(0, 0x300, bytes(8)), 34 + 64 + 13 + 12),
        (Frame(0, 0x300, bytes(8), extended=True), 54 + 64 + 13 + 14.5),
        (Frame(0, 0x300, b"", remote=True, extra=8), 34 + 13 + 4),
        # 22 or 41 bits from start to DLC; stuff count, CRC and fixed stuff bits are 27, beyond 16 bytes 32
        (Frame(0, 0x300, bytes(8), fd=True), 22 + 64 + 27 + 13 + 10.5),
        (Frame(0, 0x300, bytes(16), fd=True), 22 + 128 + 27 + 13 + 18.5),
        (Frame(0, 0x300, bytes(64), fd=True), 22 + 512 + 32 + 13 + 66.5),
        (Frame(0, 0x300, bytes(64), extended=True, fd=True), 41 + 512 + 32 + 13 + 69),
    ],
)
def test_bits_of_a_frame_are_those_of_its_format(config: Config, frame: Frame, bits: float) -> None:
    frames = [replace(frame, stamp_us=START_US + t) for t in range(0, 2_000_000, 10_000)]
    model = fed(BusModel(config, bit_rate=500_000), frames, until_us=2_000_000)
    now = model.load.at(model.now_us)
    assert [now.frames_per_s, now.load_pct] == pytest.approx([100.0, 100 * bits * 100 / 500_000])


def test_error_frames_are_counted_apart(config: Config) -> None:
    frames = [Frame(START_US + t, 0x40, bytes(8), error=True) for t in range(0, 1_000_000, 100_000)]
    model = fed(BusModel(config), frames, until_us=1_000_000)
    assert (model.load.frames, model.load.errors, model.load.at(model.now_us).errors) == (0, 10, 10)


def test_clock_that_steps_back_does_not_turn_time_round(config: Config, made: DaemonFrames) -> None:
    frames = made.stretch(10_000_000, 11_000_000, GOOD) + made.stretch(0, 1_000_000, GOOD)
    model = fed(BusModel(config), frames, until_us=1_000_000)
    times = model.axles[0].held.adhesion.time_us
    assert (np.diff(times) >= 0).all()
    assert len(times) == 100
    assert model.clock_steps == 1
    assert model.now_us - int(times[-1]) == 20_000
    assert state_name(model.axles[0].history.events()[-1]) == "Valid"


def test_held_frames_are_bounded_and_the_newest(config: Config) -> None:
    model = BusModel(config, max_frames=3000)
    for k in range(60):
        model.take(Batch.of_frames([Frame(START_US + 1000 * (100 * k + n), 0x300, b"") for n in range(100)]), 0)
    assert model.held.frames == 3000
    assert next(iter(model.held)).stamp_us[0] == START_US + 3_000_000


def test_frames_that_come_one_by_one_take_no_more_room_than_many_at_once() -> None:
    held, n = Held(100_000), 20_000
    frames = [Batch.of_frames([Frame(START_US + k, 0x300, bytes(8))]) for k in range(n)]
    for batch in frames:
        held.add(batch)
    assert held.frames == n
    assert len(held) <= n // 1000
    batches = list(held)
    assert np.concatenate([b.stamp_us for b in batches]).tolist() == [START_US + k for k in range(n)]
    size = sum(getattr(b, name).nbytes for b in batches for name in Batch.__slots__)
    assert size < 40 * n


def test_columns_hold_a_stated_time(config: Config, made: DaemonFrames) -> None:
    model = BusModel(config, hold_s=10.0)
    for begin in range(0, 60_000_000, 1_000_000):
        fed(model, made.stretch(begin, begin + 1_000_000, GOOD))
    times = model.axles[0].held.adhesion.time_us
    assert 10.0 <= (times[-1] - times[0]) / 1e6 <= 20.0


def test_a_trains_own_names_and_words_are_understood() -> None:
    config = load_config(THIRD_PARTY)
    made = DaemonFrames(config)
    frames = made.stretch(0, 1_000_000, GOOD, axles=range(len(config.axles)))
    model = fed(BusModel(config), frames)
    for axle in model.axles:
        now = axle_at(model, axle, model.now_us)
        assert now.event is not None
        assert state_name(now.event) == "Valid"
        assert now.available_pct == pytest.approx(30.0, abs=1.0)
    assert axle_at(model, model.axles[0], model.now_us).low_pct == pytest.approx(27.0, abs=1.0)


def test_long_fd_frames_beside_classical_ones_lose_nothing(config: Config, made: DaemonFrames) -> None:
    frames = made.stretch(0, 200_000, GOOD)
    mixed = [g for f in frames for g in (f, Frame(f.stamp_us, 0x400, bytes(64), fd=True))]
    model = fed(BusModel(config), mixed)
    assert model.load.frames == len(mixed)
    assert len(model.axles[0].held.adhesion) == 10


@pytest.mark.parametrize("axles", [1, 6, 8])
def test_any_number_of_axles_is_shown(axles: int, tmp_path: Path) -> None:
    text = "".join(
        f'[[axle]]\nnumber = {n}\nyaw_rate = "YawRate_A{n}.YawRate"\nlateral_acceleration = "LatAccel_A{n}.LatAccel"\n'
        f'torque = "Torque_A{n}.Torque"\n' for n in range(1, axles + 1)
    )  # fmt: skip
    file = tmp_path / "train.toml"
    file.write_text(f'[vehicle]\nspeed = "VehicleSpeed.Speed"\n{text}')
    config = load_config(file)
    model = fed(BusModel(config), DaemonFrames(config).stretch(0, 300_000, GOOD, axles=range(axles)))
    assert [len(a.held.adhesion) for a in model.axles] == [15] * axles


def test_no_frame_at_all_is_no_error(config: Config) -> None:
    model = BusModel(config)
    model.take(Batch.of_frames([]), START_US)
    model.update()
    assert axle_at(model, model.axles[0], model.now_us).event is None


@pytest.mark.parametrize("rows_at_once", [1, 7, 400, 2500])
def test_table_beyond_its_limit_keeps_the_newest_rows(rows_at_once: int) -> None:
    table = ColumnBuffer(1000)
    for first in range(0, 5000, rows_at_once):
        a = np.arange(first, first + rows_at_once)
        table.append({"a": a, "b": np.stack([a, 2 * a], axis=1)})
    table.append({"a": np.arange(0), "b": np.zeros((0, 2))})
    end = -(-5000 // rows_at_once) * rows_at_once
    assert len(table) == 1000
    assert table["a"].tolist() == list(range(end - 1000, end))
    assert (table["b"][:, 1] == 2 * table["a"]).all()
