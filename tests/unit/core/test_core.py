"""States and time, as the contract says, on a virtual clock."""

import struct
from dataclasses import replace
from typing import Any

import pytest

from tests.support.can_ids import (
    ADHESION,
    ADHESION_A1,
    ADHESION_DETAIL,
    ADHESION_DETAIL_A1,
    INPUT_HEALTH,
    LAT_ACCEL_A1,
    SIM_TRUTH_A1,
    TORQUE_A1,
    VEHICLE_SPEED,
    WRCD_LINK,
    WRCD_REJECTS,
    WRCD_STATUS,
    YAW_RATE_A1,
)
from tests.support.sensor_simulator import MS, SensorSimulator, validities
from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config


def test_axle_is_valid_after_one_full_window(sim: SensorSimulator) -> None:
    frames = sim.run(1500)
    first = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert (first + 1) * 20 == 1000
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert all(f["MuAvailable"] == "NotAvailable" and f["Confidence"] == "None" for f in frames[:first])
    assert all(isinstance(f["MuAvailable"], float) for f in frames[first:])
    assert all(f["MuAvailable"] >= f["MuUsed"] - 0.011 for f in frames[first:])
    # in use is known from the first torque on: |T| / (2 N r0)
    assert frames[2]["MuUsed"] == pytest.approx(100 * 10_000 / (2 * 73549.875 * 0.5), abs=0.006)


def test_axle_without_frames_sends_not_available_every_cycle(sim: SensorSimulator) -> None:
    sim.run(2000)
    others = [f for a in (2, 3, 4) for f in sim.adhesion(sim.out, a)]
    assert len(others) == 300
    assert {f["Validity"] for f in others} == {"NotAvailable"}
    assert {f["SampleAge"] for f in others} == {255}


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


@pytest.mark.parametrize("missing", [YAW_RATE_A1, LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED])
def test_silent_input_is_degraded_then_not_available(sim: SensorSimulator, missing: int) -> None:
    sim.run(2000)
    sim.silent = {missing}
    frames = sim.run(300)
    assert [v for v in validities(frames) if v != "Valid"] == ["Degraded", "NotAvailable"]
    timeout = {YAW_RATE_A1: 15, LAT_ACCEL_A1: 15, TORQUE_A1: 30, VEHICLE_SPEED: 60}[missing]
    degraded = next(i for i, f in enumerate(frames) if f["Validity"] == "Degraded")
    gone = next(i for i, f in enumerate(frames) if f["Validity"] == "NotAvailable")
    # never Valid longer than the time-out and one cycle after the last frame, 4 ms before the silence began
    assert degraded * 20 <= timeout + 20
    assert 100 - 4 <= (gone + 1) * 20 <= 100 + 20
    sim.silent = set()
    frames = sim.run(2000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    back = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert 1000 <= (back + 1) * 20 <= 1040


@pytest.mark.parametrize("can_id", [YAW_RATE_A1, TORQUE_A1])
def test_short_gap_is_degraded_while_it_lasts(sim: SensorSimulator, can_id: int) -> None:
    """40 ms past the time-out are bridged; the estimate goes on."""
    sim.run(2000)
    sim.silent = {can_id}
    during = sim.run({YAW_RATE_A1: 40, TORQUE_A1: 60}[can_id])
    sim.silent = set()
    frames = sim.run(2000)
    assert validities(during)[-1] == "Degraded"
    assert validities(frames) == ["Valid"]


def test_longer_gap_is_degraded_for_one_window(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.silent = {YAW_RATE_A1}
    sim.run(80)
    sim.silent = set()
    frames = sim.run(2000)
    assert validities(frames) == ["Degraded", "Valid"]
    assert isinstance(frames[0]["MuAvailable"], float)
    assert 980 <= [f["Validity"] for f in frames].index("Valid") * 20 <= 1020


def test_one_lost_frame_leaves_the_axle_valid(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.silent = {LAT_ACCEL_A1}
    sim.run(5)
    sim.silent = set()
    assert validities(sim.run(500)) == ["Valid"]


def test_standstill_is_not_available_and_no_fault(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.speed = 2.0
    assert validities(sim.run(1000))[-1] == "NotAvailable"
    sim.speed = 25.0
    assert validities(sim.run(2000)) == ["NotAvailable", "Valid"]


def test_speed_beyond_the_design_is_degraded(sim: SensorSimulator) -> None:
    sim.speed = 60.0
    assert validities(sim.run(1500))[-1] == "Valid"
    sim.speed = 60.5
    assert validities(sim.run(200))[-1] == "Degraded"


def test_sensor_status_degrades_or_rejects(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.yaw_status = 1
    assert validities(sim.run(200))[-1] == "Degraded"
    sim.yaw_status = 14
    assert validities(sim.run(300))[-1] == "NotAvailable"
    assert sum(sim.core.counts.rejected.values()) == 60


@pytest.mark.parametrize("step_ms", [-3_600_000, -50, 2_000, 3_600_000, 86_400_000])
def test_clock_step_costs_one_window(sim: SensorSimulator, step_ms: int) -> None:
    sim.run(2000)
    sim.t += step_ms * MS
    before = len(sim.out)
    frames = sim.run(2000)
    # Valid only after a full window
    assert validities(frames) == ["NotAvailable", "Valid"]
    # no burst of slots, however far the step
    assert len(frames) <= 102
    assert len(sim.out) - before < 1000
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
    assert validities(sim.run(2000))[-2:] == ["NotAvailable", "Valid"]


def test_frame_slightly_out_of_order_is_used(sim: SensorSimulator) -> None:
    sim.run(1500)
    late = sim.frame(TORQUE_A1, struct.pack("<i", 1_000_100)[:3])
    sim.core.feed(Frame(sim.t - 3000, TORQUE_A1, late.data))
    assert sim.core.counts.time_steps == 0
    assert sim.core.counts.late == 1
    assert validities(sim.run(200)) == ["Valid"]


def test_every_mapped_frame_is_accepted_or_counted(sim: SensorSimulator) -> None:
    sim.run(100)
    good = sim.core.counts.accepted
    for data in (bytes(5), bytes(4), b"\xff" * 5):
        sim.core.feed(Frame(sim.t, YAW_RATE_A1, data))
    sim.core.feed(Frame(sim.t, SIM_TRUTH_A1, bytes(8)))
    sim.core.feed(Frame(sim.t, ADHESION_A1, bytes(8)))
    assert sim.core.counts.accepted == good
    assert sum(sim.core.counts.rejected.values()) == 3


def test_detail_frame_has_residuals_model_rule_and_stale_inputs(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.silent = {TORQUE_A1}
    sim.run(60)
    message = find_message(sim.config.database, "AdhesionDetail_A1")
    rows: list[Any] = [message.decode(o.frame.data) for o in sim.out if o.frame.can_id == message.frame_id]
    assert str(rows[0]["Residual1"]) == "NotAvailable"
    assert str(rows[-1]["WinningModel"]).startswith("Model")
    assert 1 <= rows[-1]["DominantRule"] <= len(sim.config.design.rules)
    assert all(-70 < rows[-1][f"Residual{m}"] < 32 for m in range(1, 5))
    assert str(rows[-2]["StaleTorque"]) == "Fresh"
    sim.run(100)
    rows = [message.decode(o.frame.data) for o in sim.out if o.frame.can_id == message.frame_id]
    assert str(rows[-1]["StaleTorque"]) == "Stale"
    assert str(rows[-1]["StaleYawRate"]) == "Fresh"


def test_status_frame_has_design_checksum_and_rejections(sim: SensorSimulator) -> None:
    sim.core.feed(Frame(sim.t, YAW_RATE_A1, bytes(5)))
    sim.run(1500)
    message = find_message(sim.config.database, "WrcdStatus")
    rows: list[Any] = [message.decode(o.frame.data) for o in sim.out if o.frame.can_id == message.frame_id]
    assert rows[-1]["DesignChecksum"] == int(sim.config.design.checksum[:4], 16)
    assert rows[-1]["RejectedFrames"] == 1
    assert str(rows[-1]["State"]) == "Running"


def test_shutdown_frames_are_not_available(sim: SensorSimulator) -> None:
    sim.run(1500)
    last = sim.core.shutdown_frames(sim.t)
    message = find_message(sim.config.database, "Adhesion_A1")
    decoded: Any = message.decode(last[0].data)
    assert str(decoded["Validity"]) == "NotAvailable"
    assert len(last) == 5


def test_residuals_beyond_training_are_never_valid(config: Config) -> None:
    """Rules made from residuals of another size than any rail makes: unknown, and said so."""
    d = config.design
    sim = SensorSimulator(replace(config, design=replace(d, low=d.low + 9.0, high=d.high + 9.0, beyond=0.1)))
    frames = sim.run(3000)
    assert {f["Validity"] for f in frames} == {"NotAvailable", "Degraded"}
    assert {f["Confidence"] for f in frames} == {"None"}
    assert sim.core.reports[0].cause is Cause.BEYOND_TRAINING


def test_shutdown_frame_has_a_new_e2e_counter(sim: SensorSimulator) -> None:
    sim.run(1500)
    last = [o.frame for o in sim.out if o.frame.can_id == ADHESION_A1][-1]
    assert (sim.core.shutdown_frames(sim.t)[0].data[1] - last.data[1]) & 0x0F in (1, 2)


def test_stuck_gyro_of_a_moving_train_is_rejected(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.frozen = True
    frames = sim.run(500)
    # not Valid from the time-out and a cycle after the last true sample, refused soon after, then NotAvailable
    assert {f["Validity"] for f in frames[2:]} == {"Degraded", "NotAvailable"}
    assert validities(frames)[-1] == "NotAvailable"
    assert sim.core.counts.rejected[Reason.STUCK] > 80
    rows = sim.decoded("InputHealth_A1")
    assert rows[-1]["RefusedYawRate"] == "Stuck"
    assert rows[-1]["ReachYawRate"] == 0
    assert rows[-1]["ReachTorque"] == 255
    assert rows[-1]["Unchanged"] == "Yes"
    sim.frozen = False
    frames = sim.run(2000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert next(i for i, f in enumerate(frames) if f["Validity"] == "Valid") * 20 <= 1060


def test_stuck_sensor_at_standstill_is_accepted(sim: SensorSimulator) -> None:
    sim.speed = 0.0
    sim.frozen = True
    sim.run(2000)
    assert sim.core.counts.rejected.total() == 0
    sim.speed, sim.frozen = 25.0, False
    frames = sim.run(2000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert sim.core.counts.rejected == {Reason.JUMP: 1}  # from rest to 25 m/s at once


def test_single_outlier_leaves_the_estimate(sim: SensorSimulator) -> None:
    twin = SensorSimulator(sim.config)
    twin.run(2000)
    sim.run(2000)
    sim.spike = 5_000_000  # 5 rad/s
    sim.run(5)
    sim.spike = 0
    twin.run(5)
    mine, its = sim.run(1000), twin.run(1000)
    assert sim.core.estimator.outliers == 1
    assert validities(mine) == ["Valid"]
    assert max(abs(a["MuAvailable"] - b["MuAvailable"]) for a, b in zip(mine, its, strict=True)) < 1.5
    assert sim.decoded("WrcdLink")[-1]["Outliers"] == 1
    assert "Yes" in {row["Outlier"] for row in sim.decoded("InputHealth_A1")}


@pytest.mark.parametrize("tick", [7, 12, 19, 24])
def test_outlier_during_start_up_resets_the_axle(sim: SensorSimulator, tick: int) -> None:
    """Later all looks usual beside it, and the estimate would be Valid and wrong."""
    clean = SensorSimulator(sim.config)
    clean.run(5 * tick + 5)
    sim.run(5 * tick)
    sim.spike = 5_000_000
    sim.run(5)
    sim.spike = 0
    pairs = list(zip(sim.run(3000), clean.run(3000), strict=True))
    assert sim.core.counts.restarts == 1 or sim.core.estimator.outliers == 1
    off = [f["MuAvailable"] - g["MuAvailable"] for f, g in pairs if f["Validity"] == "Valid"]
    assert len(off) > 80
    assert max(map(abs, off)) < 3.0


def test_continued_outliers_reset_the_axle(sim: SensorSimulator) -> None:
    undisturbed = SensorSimulator(sim.config).run(6000)[-1]["MuAvailable"]
    sim.run(2000)
    sim.spike = 1_000_000
    frames = sim.run(4000)
    assert sim.core.counts.restarts == 1
    assert validities(frames)[-2:] == ["NotAvailable", "Valid"]
    gone = next(i for i, f in enumerate(frames) if f["Validity"] == "NotAvailable")
    assert gone * 20 <= 15 + 20  # as a silent sensor would be
    assert frames[-1]["MuAvailable"] == pytest.approx(undisturbed, abs=1.0)


@pytest.mark.parametrize(("what", "value"), [("speed", 0.5), ("speed", 120.0), ("torque", -80_000.0)])
def test_jump_is_accepted_at_its_second_frame(sim: SensorSimulator, what: str, value: float) -> None:
    sim.run(2000)
    before = getattr(sim, what)
    setattr(sim, what, value)
    sim.run(5)
    setattr(sim, what, before)
    assert validities(sim.run(500)) == ["Valid"]
    assert sim.core.counts.rejected == {Reason.JUMP: 1}
    setattr(sim, what, value)
    sim.run(1000)
    assert sim.core.counts.rejected == {Reason.JUMP: 2}


def test_clock_step_clears_the_outlier(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.spike = 5_000_000
    sim.run(5)
    sim.spike = 0
    sim.t -= 3_600_000 * MS
    sim.run(2000)
    assert sim.core.counts.rejected.total() == 0  # the first frame after the step is not held against the old chain
    assert sim.decoded("InputHealth_A1")[-1]["Outlier"] == "No"


def test_sensor_slower_than_the_tick_is_never_valid(sim: SensorSimulator) -> None:
    """Gains made for every tick are wrong for every second one; no number is better than a wrong one."""
    for _ in range(400):
        for frame in sim.frames():
            if sim.counter % 2 or frame.can_id not in (YAW_RATE_A1, LAT_ACCEL_A1):
                sim.out += sim.core.feed(frame)
        sim.out += sim.core.advance(sim.t)
    frames = sim.adhesion(sim.out)
    assert {f["MuAvailable"] for f in frames} == {"NotAvailable"}
    assert "Valid" not in {f["Validity"] for f in frames}


def test_confirmed_speed_jump_resets_the_axle(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.speed = 28.0
    frames = sim.run(2000)
    assert validities(frames)[-2:] == ["NotAvailable", "Valid"]
    assert "Valid" not in {f["Validity"] for f in frames[2:40]}
    assert sim.core.counts.restarts == 1  # the others have not started yet
    sim.torque += 9000.0  # a torque may do that, though the sensors of this sim do not feel it
    assert "NotAvailable" not in validities(sim.run(500))
    assert sim.core.counts.restarts == 1


def test_two_senders_of_one_id_are_rejected(sim: SensorSimulator) -> None:
    sim.run(2000)
    other = SensorSimulator(sim.config)
    begin = len(sim.out)
    for k in range(60):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
        data = protect(b"\0\0" + struct.pack("<i", 5000 + k)[:3], YAW_RATE_A1, (sim.counter + 6) % 15)
        sim.out += sim.core.feed(Frame(other.t, YAW_RATE_A1, data))
        other.t = sim.t + 2500
        sim.out += sim.core.advance(sim.t)
    frames = sim.adhesion(sim.out[begin:])
    assert "Valid" not in {f["Validity"] for f in frames[2:]}
    assert sim.core.counts.rejected[Reason.TWO_SENDERS] > 80
    assert sim.decoded("InputHealth_A1")[-1]["RefusedYawRate"] == "TwoSenders"
    assert validities(sim.run(2000)) == ["NotAvailable", "Valid"]


def test_rejects_frame_counts_by_reason(sim: SensorSimulator) -> None:
    sim.run(995)
    for can_id, data in (
        (YAW_RATE_A1, bytes(5)),
        (YAW_RATE_A1, bytes(4)),
        (YAW_RATE_A1, protect(bytes(5), LAT_ACCEL_A1, 0)),
        (TORQUE_A1, bytes(5)),
    ):
        sim.core.feed(Frame(sim.t, can_id, data))
    sim.run(2005)
    rows = sim.decoded("WrcdRejects")
    assert [(r["RejectedCrc"], r["RejectedLength"], r["RejectedDataId"]) for r in rows] == [
        (2, 1, 1),
        (0,) * 3,
        (0,) * 3,
    ]
    status = sim.decoded("WrcdStatus")[-1]
    assert (status["RejectedFrames"], status["LastReason"]) == (4, "Crc")


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
