"""What the core sends, and when; clocks that step, and frames that come late."""

import struct
from dataclasses import replace

import pytest

from tests.support.can_ids import (
    ADHESION,
    ADHESION_A1,
    ADHESION_DETAIL,
    ADHESION_DETAIL_A1,
    INPUT_HEALTH,
    TORQUE_A1,
    VEHICLE_SPEED,
    WRCD_LINK,
    WRCD_REJECTS,
    WRCD_STATUS,
)
from tests.support.sensor_simulator import MS, SensorSimulator, until_ms, validities
from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.core.state import OUT, Buffers
from wrcd.native import library


def test_axle_is_valid_after_one_full_window(sim: SensorSimulator) -> None:
    frames = sim.run(1500)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert until_ms(frames, "Valid") == 1000
    first = 1000 // 20 - 1
    assert all(f["MuAvailable"] == "NotAvailable" and f["Confidence"] == "None" for f in frames[:first])
    assert all(f["MuAvailable"] >= f["MuUsed"] - 0.011 for f in frames[first:])
    # in use is known from the first torque on: |T| / (2 N r0)
    assert frames[2]["MuUsed"] == pytest.approx(100 * 10_000 / (2 * 73549.875 * 0.5) - 0.005, abs=0.006)
    others = [f for a in (2, 3, 4) for f in sim.adhesion(sim.out, a)]
    assert len(others) == 3 * len(frames)
    assert {(f["Validity"], f["SampleAge"]) for f in others} == {("NotAvailable", 255)}


def test_sent_frames_keep_their_cycle_slot_and_counter(sim: SensorSimulator) -> None:
    sim.run(3000)
    by_id: dict[int, list[Frame]] = {}
    for o in sim.out:
        by_id.setdefault(o.frame.can_id, []).append(o.frame)
    assert {i: len(f) for i, f in by_id.items()} == (
        dict.fromkeys(ADHESION.values(), 150)
        | dict.fromkeys([*ADHESION_DETAIL.values(), *INPUT_HEALTH.values()], 30)
        | dict.fromkeys([WRCD_STATUS, WRCD_REJECTS, WRCD_LINK], 3)
    )
    for can_id, cycle in ((ADHESION_A1, 20 * MS), (ADHESION_DETAIL_A1, 100 * MS), (WRCD_STATUS, 1000 * MS)):
        for f in by_id[can_id]:
            assert f.data[1] & 0x0F == f.stamp_us // cycle % 15
            assert f == Frame(f.stamp_us, can_id, protect(f.data, can_id, f.data[1] & 0x0F))


def test_detail_frame_has_residuals_model_rule_and_stale_inputs(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.silent = {TORQUE_A1}
    sim.run(160)
    rows = sim.decoded("AdhesionDetail_A1")
    assert rows[0]["Residual1"] == "NotAvailable"
    *_, fresh, last = rows
    assert (fresh["StaleTorque"], last["StaleTorque"], last["StaleYawRate"]) == ("Fresh", "Stale", "Fresh")
    assert fresh["WinningModel"].startswith("Model")
    assert 1 <= fresh["DominantRule"] <= len(sim.config.design.rules)
    assert all(-70 < fresh[f"Residual{m}"] < 32 for m in range(1, 5))


def test_shutdown_frames_are_not_available_and_stopping_with_new_counters(sim: SensorSimulator) -> None:
    sim.run(1500)
    running = sim.decoded("WrcdStatus")[-1]
    assert (running["State"], running["DesignChecksum"]) == ("Running", int(sim.config.design.checksum[:4], 16))
    sent = [o.frame for o in sim.out if o.frame.can_id == ADHESION_A1][-1]
    last = sim.core.shutdown_frames(sim.t)
    by_id = {f.can_id: f for f in last}
    assert len(last) == len(by_id) == 5
    for name, signal, word in (("Adhesion_A1", "Validity", "NotAvailable"), ("WrcdStatus", "State", "Stopping")):
        message = find_message(sim.config.database, name)
        decoded = message.decode(by_id[message.frame_id].data)
        assert isinstance(decoded, dict)
        assert str(decoded[signal]) == word
    assert (last[0].data[1] - sent.data[1]) & 0x0F in (1, 2)


def test_last_frames_are_made_where_there_is_room_alone(sim: SensorSimulator) -> None:
    train, out = sim.core._train.pointer, Buffers(dict.fromkeys(OUT, 0) | {"made": 14})
    assert library().wrcd_shutdown(train, out.pointer, sim.t) == 0
    assert out.take() == {}
    out = Buffers(dict.fromkeys(OUT, 0) | {"made": 15})
    assert library().wrcd_shutdown(train, out.pointer, sim.t) == 1
    assert len(out.take()["made"]) == 5


@pytest.mark.parametrize("step_ms", [-3_600_000, -50, 2_000, 86_400_000])
def test_clock_step_costs_one_window(sim: SensorSimulator, step_ms: int) -> None:
    sim.run(2000)
    sim.t += step_ms * MS
    before = len(sim.out)
    frames = sim.run(1500)
    # Valid only after a full window
    assert validities(frames) == ["NotAvailable", "Valid"]
    # no burst of slots, however far the step
    assert len(frames) <= 77
    assert len(sim.out) - before < 750
    assert sim.core.counts.time_steps == 1


def test_frame_from_before_a_clock_step_fills_no_slots(sim: SensorSimulator) -> None:
    """The clock steps back by a day on a silent bus; then a frame comes that was stamped before."""
    sim.run(2000)
    stamp = sim.t
    for k in range(10):
        sim.core.advance(sim.t - 86_400_000 * MS + k * 5 * MS)
    ticks = sim.core.counts.ticks
    sim.out += sim.core.feed(Frame(stamp, VEHICLE_SPEED, sim.frame(VEHICLE_SPEED, struct.pack("<H", 10_000)).data))
    assert sim.core.counts.ticks - ticks < 10
    assert sim.core.counts.time_steps == 2
    assert validities(sim.run(1500))[-2:] == ["NotAvailable", "Valid"]


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
def test_time_step_is_found_from_frames_alone(step_us: int, anew: int, filled: int, sim: SensorSimulator) -> None:
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
def test_time_step_is_found_from_the_clock_alone(step_us: int, anew: int, sim: SensorSimulator) -> None:
    sim.run(200)
    sim.core.advance(sim.t + step_us)
    assert sim.core.counts.time_steps == anew


def test_frame_of_a_closed_tick_is_used_and_counts_as_late(sim: SensorSimulator) -> None:
    sim.run(1500)
    for back_us, late in ((0, 0), (1, 1), (3_000, 2)):
        frame = sim.frame(TORQUE_A1, struct.pack("<i", 1_000_100)[:3])
        sim.core.feed(replace(frame, stamp_us=sim.t - back_us))
        sim.counter += 1
        assert sim.core.counts.late == late
    assert sim.core.counts.time_steps == 0
    assert validities(sim.run(200)) == ["Valid"]
