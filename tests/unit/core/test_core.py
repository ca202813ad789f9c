"""What the core sends, and when."""

from typing import Any

import pytest

from tests.support.can_ids import (
    ADHESION,
    ADHESION_A1,
    ADHESION_DETAIL,
    ADHESION_DETAIL_A1,
    INPUT_HEALTH,
    TORQUE_A1,
    WRCD_LINK,
    WRCD_REJECTS,
    WRCD_STATUS,
    YAW_RATE_A1,
)
from tests.support.sensor_simulator import MS, SensorSimulator, validities
from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame


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


def test_silent_bus_at_start_is_not_available(sim: SensorSimulator) -> None:
    sim.out += sim.core.advance(sim.t)
    sim.out += sim.core.advance(sim.t + 100_000)
    assert [f["Validity"] for f in sim.adhesion(sim.out)] == ["NotAvailable"] * 5


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


def test_shutdown_frame_has_a_new_e2e_counter(sim: SensorSimulator) -> None:
    sim.run(1500)
    last = [o.frame for o in sim.out if o.frame.can_id == ADHESION_A1][-1]
    assert (sim.core.shutdown_frames(sim.t)[0].data[1] - last.data[1]) & 0x0F in (1, 2)


def test_shutdown_status_is_stopping(sim: SensorSimulator) -> None:
    sim.run(100)
    message = find_message(sim.config.database, "WrcdStatus")
    (last,) = (f for f in sim.core.shutdown_frames(sim.t) if f.can_id == message.frame_id)
    decoded: Any = message.decode(last.data)
    assert str(decoded["State"]) == "Stopping"
