"""States and time, as the contract says, on a virtual clock."""

import struct
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest

from tests.support.signals import measured
from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.config import load_config
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing

START = 1_700_000_000_000_000
MS = 1000


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config(None)


class Rig:
    """Feeds one axle with frames of a steady run, 1 ms after the tick's beginning, and collects what the core sends."""

    def __init__(self, config: Config) -> None:
        self.core = Core(config)
        self.config = config
        self.t = START
        self.counter = 0
        self.silent: set[int] = set()
        self.speed = 25.0
        self.torque = 10_000.0
        self.yaw_status = 0
        self.frozen = False
        self.spike = 0  # on top of the yaw rate, in 1e-6 rad/s
        self.out: list[Outgoing] = []

    def frame(self, can_id: int, payload: bytes, status: int = 0) -> Frame:
        data = protect(bytes([0, status << 4]) + payload, can_id, self.counter % 15)
        return Frame(self.t + 1000, can_id, data)

    def run(self, ms: int) -> list[dict[str, Any]]:
        """Plays so many milliseconds; returns the decoded Adhesion_A1 frames of that time."""
        first = len(self.out)
        for _ in range(ms // 5):
            for frame in self.frames():
                self.out += self.core.feed(frame)
            self.out += self.core.advance(self.t)
        return self.adhesion(self.out[first:])

    def frames(self) -> list[Frame]:
        """The frames of one tick that are not silent; time moves on by the tick."""
        z = measured()
        yaw_rate, lat_accel = z[self.counter % len(z)]
        yaw = 600 if self.frozen else round(yaw_rate * 1e6) + self.spike
        every = [
            self.frame(0x101, struct.pack("<i", yaw)[:3], self.yaw_status),
            self.frame(0x111, struct.pack("<i", round(lat_accel * 1e5))[:3]),
            self.frame(0x121, struct.pack("<i", round(self.torque * 100))[:3]),
            self.frame(0x130, struct.pack("<H", round(self.speed / 0.0025))),
        ]
        self.counter += 1
        self.t += 5000
        return [f for f in every if f.can_id not in self.silent]

    def adhesion(self, out: Iterable[Outgoing], axle: int = 1) -> list[dict[str, Any]]:
        message = find_message(self.config.database, f"Adhesion_A{axle}")
        decoded: list[Any] = [
            {k: str(v) if hasattr(v, "name") else v for k, v in dict(message.decode(o.frame.data)).items()}
            for o in out
            if o.frame.can_id == message.frame_id
        ]
        return decoded


@pytest.fixture
def rig(config: Config) -> Rig:
    return Rig(config)


def validities(frames: list[dict[str, Any]]) -> list[str]:
    """Runs of equal validity."""
    out: list[str] = []
    for f in frames:
        if not out or out[-1] != f["Validity"]:
            out.append(f["Validity"])
    return out


def test_valid_after_one_full_window(rig: Rig) -> None:
    frames = rig.run(1500)
    first = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert (first + 1) * 20 == 1000
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert all(f["MuAvailable"] == "NotAvailable" and f["Confidence"] == "None" for f in frames[:first])
    assert all(isinstance(f["MuAvailable"], float) for f in frames[first:])
    assert all(f["MuAvailable"] >= f["MuUsed"] - 0.011 for f in frames[first:])
    # in use is known from the first torque on: |T| / (2 N r0)
    assert frames[2]["MuUsed"] == pytest.approx(100 * 10_000 / (2 * 73549.875 * 0.5), abs=0.006)


def test_an_axle_without_frames_is_not_available_at_its_cycle(rig: Rig) -> None:
    rig.run(2000)
    others = [f for a in (2, 3, 4) for f in rig.adhesion(rig.out, a)]
    assert len(others) == 300
    assert {f["Validity"] for f in others} == {"NotAvailable"}
    assert {f["SampleAge"] for f in others} == {255}


def test_cycles_slots_and_counters(rig: Rig) -> None:
    rig.run(3000)
    by_id: dict[int, list[Frame]] = {}
    for o in rig.out:
        by_id.setdefault(o.frame.can_id, []).append(o.frame)
    assert {i: len(f) for i, f in by_id.items()} == (
        {0x090 + a: 150 for a in range(1, 5)}
        | {base + a: 30 for base in (0x0A0, 0x0A8) for a in range(1, 5)}
        | {0x0B0: 3, 0x0B1: 3, 0x0B2: 3}
    )
    for can_id, cycle in ((0x091, 20 * MS), (0x0A1, 100 * MS), (0x0B0, 1000 * MS)):
        for f in by_id[can_id]:
            assert f.data[1] & 0x0F == f.stamp_us // cycle % 15
            assert f == Frame(f.stamp_us, can_id, protect(f.data, can_id, f.data[1] & 0x0F))


@pytest.mark.parametrize("missing", [0x101, 0x111, 0x121, 0x130])
def test_a_silent_input_degrades_then_ends_the_estimate(rig: Rig, missing: int) -> None:
    rig.run(2000)
    rig.silent = {missing}
    frames = rig.run(300)
    assert [v for v in validities(frames) if v != "Valid"] == ["Degraded", "NotAvailable"]
    timeout = {0x101: 15, 0x111: 15, 0x121: 30, 0x130: 60}[missing]
    degraded = next(i for i, f in enumerate(frames) if f["Validity"] == "Degraded")
    gone = next(i for i, f in enumerate(frames) if f["Validity"] == "NotAvailable")
    # never Valid longer than the time-out and one cycle after the last frame, 4 ms before the silence began
    assert degraded * 20 <= timeout + 20
    assert 100 - 4 <= (gone + 1) * 20 <= 100 + 20
    rig.silent = set()
    frames = rig.run(2000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    back = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert 1000 <= (back + 1) * 20 <= 1040


@pytest.mark.parametrize("can_id", [0x101, 0x121])
def test_a_short_gap_degrades_while_it_lasts(rig: Rig, can_id: int) -> None:
    """40 ms past the time-out are bridged; the estimate goes on."""
    rig.run(2000)
    rig.silent = {can_id}
    during = rig.run({0x101: 40, 0x121: 60}[can_id])
    rig.silent = set()
    frames = rig.run(2000)
    assert validities(during)[-1] == "Degraded"
    assert validities(frames) == ["Valid"]


def test_a_longer_gap_degrades_for_a_window(rig: Rig) -> None:
    rig.run(2000)
    rig.silent = {0x101}
    rig.run(80)
    rig.silent = set()
    frames = rig.run(2000)
    assert validities(frames) == ["Degraded", "Valid"]
    assert isinstance(frames[0]["MuAvailable"], float)
    assert 980 <= [f["Validity"] for f in frames].index("Valid") * 20 <= 1020


def test_one_lost_frame_changes_nothing(rig: Rig) -> None:
    rig.run(2000)
    rig.silent = {0x111}
    rig.run(5)
    rig.silent = set()
    assert validities(rig.run(500)) == ["Valid"]


def test_standstill_is_not_available_and_no_fault(rig: Rig) -> None:
    rig.run(1500)
    rig.speed = 2.0
    assert validities(rig.run(1000))[-1] == "NotAvailable"
    rig.speed = 25.0
    assert validities(rig.run(2000)) == ["NotAvailable", "Valid"]


def test_speed_beyond_the_design_is_degraded(rig: Rig) -> None:
    rig.speed = 60.0
    assert validities(rig.run(1500))[-1] == "Valid"
    rig.speed = 60.5
    assert validities(rig.run(200))[-1] == "Degraded"


def test_a_degraded_sensor_degrades(rig: Rig) -> None:
    rig.run(1500)
    rig.yaw_status = 1
    assert validities(rig.run(200))[-1] == "Degraded"
    rig.yaw_status = 14
    assert validities(rig.run(300))[-1] == "NotAvailable"
    assert sum(rig.core.counts.rejected.values()) == 60


@pytest.mark.parametrize("step_ms", [-3_600_000, -50, 2_000, 3_600_000, 86_400_000])
def test_a_step_of_the_clock_starts_anew(rig: Rig, step_ms: int) -> None:
    rig.run(2000)
    rig.t += step_ms * MS
    before = len(rig.out)
    frames = rig.run(2000)
    # Valid only after a full window
    assert validities(frames) == ["NotAvailable", "Valid"]
    # no burst of slots, however far the step
    assert len(frames) <= 102
    assert len(rig.out) - before < 1000
    assert rig.core.counts.time_steps == 1


def test_a_frame_from_before_a_step_back_of_the_clock_does_not_fill_the_time_between(rig: Rig) -> None:
    """The clock steps back by a day on a silent bus; then a frame comes that was stamped before."""
    rig.run(2000)
    stamp = rig.t
    for k in range(10):
        rig.core.advance(rig.t - 86_400_000 * MS + k * 5 * MS)
    ticks = rig.core.counts.ticks
    rig.out += rig.core.feed(Frame(stamp, 0x130, rig.frame(0x130, struct.pack("<H", 10_000)).data))
    assert rig.core.counts.ticks - ticks < 10
    assert rig.core.counts.time_steps == 2
    assert validities(rig.run(2000))[-2:] == ["NotAvailable", "Valid"]


def test_frames_a_little_out_of_order_are_used(rig: Rig) -> None:
    rig.run(1500)
    late = rig.frame(0x121, struct.pack("<i", 1_000_100)[:3])
    rig.core.feed(Frame(rig.t - 3000, 0x121, late.data))
    assert rig.core.counts.time_steps == 0
    assert rig.core.counts.late == 1
    assert validities(rig.run(200)) == ["Valid"]


def test_every_mapped_frame_is_accepted_or_counted(rig: Rig) -> None:
    rig.run(100)
    good = rig.core.counts.accepted
    for data in (bytes(5), bytes(4), b"\xff" * 5):
        rig.core.feed(Frame(rig.t, 0x101, data))
    rig.core.feed(Frame(rig.t, 0x7A1, bytes(8)))
    rig.core.feed(Frame(rig.t, 0x091, bytes(8)))
    assert rig.core.counts.accepted == good
    assert sum(rig.core.counts.rejected.values()) == 3


def test_the_details_explain(rig: Rig) -> None:
    rig.run(1500)
    rig.silent = {0x121}
    rig.run(60)
    message = find_message(rig.config.database, "AdhesionDetail_A1")
    rows: list[Any] = [message.decode(o.frame.data) for o in rig.out if o.frame.can_id == message.frame_id]
    assert str(rows[0]["Residual1"]) == "NotAvailable"
    assert str(rows[-1]["WinningModel"]).startswith("Model")
    assert 1 <= rows[-1]["DominantRule"] <= len(rig.config.design.rules)
    assert all(-70 < rows[-1][f"Residual{m}"] < 32 for m in range(1, 5))
    assert str(rows[-2]["StaleTorque"]) == "Fresh"
    rig.run(100)
    rows = [message.decode(o.frame.data) for o in rig.out if o.frame.can_id == message.frame_id]
    assert str(rows[-1]["StaleTorque"]) == "Stale"
    assert str(rows[-1]["StaleYawRate"]) == "Fresh"


def test_the_status_tells_the_design(rig: Rig) -> None:
    rig.core.feed(Frame(rig.t, 0x101, bytes(5)))
    rig.run(1500)
    message = find_message(rig.config.database, "WrcdStatus")
    rows: list[Any] = [message.decode(o.frame.data) for o in rig.out if o.frame.can_id == message.frame_id]
    assert rows[-1]["DesignChecksum"] == int(rig.config.design.checksum[:4], 16)
    assert rows[-1]["RejectedFrames"] == 1
    assert str(rows[-1]["State"]) == "Running"


def test_the_last_frames_say_not_available(rig: Rig) -> None:
    rig.run(1500)
    last = rig.core.shutdown_frames(rig.t)
    message = find_message(rig.config.database, "Adhesion_A1")
    decoded: Any = message.decode(last[0].data)
    assert str(decoded["Validity"]) == "NotAvailable"
    assert len(last) == 5


def test_what_the_rules_were_not_made_from_is_never_valid(config: Config) -> None:
    """Rules made from residuals of another size than any rail makes: unknown, and said so."""
    d = config.design
    rig = Rig(replace(config, design=replace(d, low=d.low + 9.0, high=d.high + 9.0, beyond=0.1)))
    frames = rig.run(3000)
    assert {f["Validity"] for f in frames} == {"NotAvailable", "Degraded"}
    assert {f["Confidence"] for f in frames} == {"None"}
    assert rig.core.reports[0].cause is Cause.BEYOND_TRAINING


def test_the_farewell_is_no_repeat(rig: Rig) -> None:
    rig.run(1500)
    last = [o.frame for o in rig.out if o.frame.can_id == 0x091][-1]
    assert (rig.core.shutdown_frames(rig.t)[0].data[1] - last.data[1]) & 0x0F in (1, 2)


def decoded(rig: Rig, name: str) -> list[dict[str, Any]]:
    """All frames of a message so far, words as strings."""
    message = find_message(rig.config.database, name)
    rows: list[Any] = [message.decode(o.frame.data) for o in rig.out if o.frame.can_id == message.frame_id]
    return [{k: str(v) if hasattr(v, "name") else v for k, v in row.items()} for row in rows]


def test_a_gyro_that_stands_still_while_the_train_moves(rig: Rig) -> None:
    rig.run(2000)
    rig.frozen = True
    frames = rig.run(500)
    # not Valid from the time-out and a cycle after the last true sample, refused soon after, then NotAvailable
    assert {f["Validity"] for f in frames[2:]} == {"Degraded", "NotAvailable"}
    assert validities(frames)[-1] == "NotAvailable"
    assert rig.core.counts.rejected[Reason.STUCK] > 80
    rows = decoded(rig, "InputHealth_A1")
    assert rows[-1]["RefusedYawRate"] == "Stuck"
    assert rows[-1]["ReachYawRate"] == 0
    assert rows[-1]["ReachTorque"] == 255
    assert rows[-1]["Unchanged"] == "Yes"
    rig.frozen = False
    frames = rig.run(2000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert next(i for i, f in enumerate(frames) if f["Validity"] == "Valid") * 20 <= 1060


def test_at_standstill_a_sensor_may_stand_still(rig: Rig) -> None:
    rig.speed = 0.0
    rig.frozen = True
    rig.run(2000)
    assert rig.core.counts.rejected.total() == 0
    rig.speed, rig.frozen = 25.0, False
    frames = rig.run(2000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert rig.core.counts.rejected == {Reason.JUMP: 1}  # from rest to 25 m/s at once


def test_one_absurd_sample_changes_nothing(rig: Rig) -> None:
    twin = Rig(rig.config)
    twin.run(2000)
    rig.run(2000)
    rig.spike = 5_000_000  # 5 rad/s
    rig.run(5)
    rig.spike = 0
    twin.run(5)
    mine, its = rig.run(1000), twin.run(1000)
    assert rig.core.estimator.outliers == 1
    assert validities(mine) == ["Valid"]
    assert max(abs(a["MuAvailable"] - b["MuAvailable"]) for a, b in zip(mine, its, strict=True)) < 1.5
    assert decoded(rig, "WrcdLink")[-1]["Outliers"] == 1
    assert "Yes" in {row["Outlier"] for row in decoded(rig, "InputHealth_A1")}


@pytest.mark.parametrize("tick", [7, 12, 19, 24])
def test_one_absurd_sample_among_the_first_starts_the_axle_anew(rig: Rig, tick: int) -> None:
    """Later all looks usual beside it, and the estimate would be Valid and wrong."""
    clean = Rig(rig.config)
    clean.run(5 * tick + 5)
    rig.run(5 * tick)
    rig.spike = 5_000_000
    rig.run(5)
    rig.spike = 0
    pairs = list(zip(rig.run(3000), clean.run(3000), strict=True))
    assert rig.core.counts.restarts == 1 or rig.core.estimator.outliers == 1
    off = [f["MuAvailable"] - g["MuAvailable"] for f, g in pairs if f["Validity"] == "Valid"]
    assert len(off) > 80
    assert max(map(abs, off)) < 3.0


def test_absurd_samples_that_go_on_start_the_axle_anew(rig: Rig) -> None:
    undisturbed = Rig(rig.config).run(6000)[-1]["MuAvailable"]
    rig.run(2000)
    rig.spike = 1_000_000
    frames = rig.run(4000)
    assert rig.core.counts.restarts == 1
    assert validities(frames)[-2:] == ["NotAvailable", "Valid"]
    gone = next(i for i, f in enumerate(frames) if f["Validity"] == "NotAvailable")
    assert gone * 20 <= 15 + 20  # as a silent sensor would be
    assert frames[-1]["MuAvailable"] == pytest.approx(undisturbed, abs=1.0)


@pytest.mark.parametrize(("what", "value"), [("speed", 0.5), ("speed", 120.0), ("torque", -80_000.0)])
def test_a_value_that_jumps_is_believed_at_the_second_frame(rig: Rig, what: str, value: float) -> None:
    rig.run(2000)
    before = getattr(rig, what)
    setattr(rig, what, value)
    rig.run(5)
    setattr(rig, what, before)
    assert validities(rig.run(500)) == ["Valid"]
    assert rig.core.counts.rejected == {Reason.JUMP: 1}
    setattr(rig, what, value)
    rig.run(1000)
    assert rig.core.counts.rejected == {Reason.JUMP: 2}


def test_an_outlier_is_forgotten_with_a_step_of_the_clock(rig: Rig) -> None:
    rig.run(2000)
    rig.spike = 5_000_000
    rig.run(5)
    rig.spike = 0
    rig.t -= 3_600_000 * MS
    rig.run(2000)
    assert rig.core.counts.rejected.total() == 0  # the first frame after the step is not held against the old chain
    assert decoded(rig, "InputHealth_A1")[-1]["Outlier"] == "No"


def test_a_sensor_that_is_slower_than_the_ticks_is_never_valid(rig: Rig) -> None:
    """Gains made for every tick are wrong for every second one; no number is better than a wrong one."""
    for _ in range(400):
        for frame in rig.frames():
            if rig.counter % 2 or frame.can_id not in (0x101, 0x111):
                rig.out += rig.core.feed(frame)
        rig.out += rig.core.advance(rig.t)
    frames = rig.adhesion(rig.out)
    assert {f["MuAvailable"] for f in frames} == {"NotAvailable"}
    assert "Valid" not in {f["Validity"] for f in frames}


def test_a_speed_that_jumps_and_stays_starts_anew(rig: Rig) -> None:
    rig.run(2000)
    rig.speed = 28.0
    frames = rig.run(2000)
    assert validities(frames)[-2:] == ["NotAvailable", "Valid"]
    assert "Valid" not in {f["Validity"] for f in frames[2:40]}
    assert rig.core.counts.restarts == 1  # the others have not started yet
    rig.torque += 9000.0  # a torque may do that, though the sensors of this rig do not feel it
    assert "NotAvailable" not in validities(rig.run(500))
    assert rig.core.counts.restarts == 1


def test_two_senders_are_not_believed(rig: Rig) -> None:
    rig.run(2000)
    other = Rig(rig.config)
    begin = len(rig.out)
    for k in range(60):
        for frame in rig.frames():
            rig.out += rig.core.feed(frame)
        data = protect(b"\0\0" + struct.pack("<i", 5000 + k)[:3], 0x101, (rig.counter + 6) % 15)
        rig.out += rig.core.feed(Frame(other.t, 0x101, data))
        other.t = rig.t + 2500
        rig.out += rig.core.advance(rig.t)
    frames = rig.adhesion(rig.out[begin:])
    assert "Valid" not in {f["Validity"] for f in frames[2:]}
    assert rig.core.counts.rejected[Reason.TWO_SENDERS] > 80
    assert decoded(rig, "InputHealth_A1")[-1]["RefusedYawRate"] == "TwoSenders"
    assert validities(rig.run(2000)) == ["NotAvailable", "Valid"]


def test_rejections_are_told_by_reason(rig: Rig) -> None:
    rig.run(995)
    for can_id, data in ((0x101, bytes(5)), (0x101, bytes(4)), (0x101, protect(bytes(5), 0x111, 0)), (0x121, bytes(5))):
        rig.core.feed(Frame(rig.t, can_id, data))
    rig.run(2005)
    rows = decoded(rig, "WrcdRejects")
    assert [(r["RejectedCrc"], r["RejectedLength"], r["RejectedDataId"]) for r in rows] == [
        (2, 1, 1),
        (0,) * 3,
        (0,) * 3,
    ]
    status = decoded(rig, "WrcdStatus")[-1]
    assert (status["RejectedFrames"], status["LastReason"]) == (4, "Crc")


def test_more_in_use_than_there_is_said_to_be_is_a_contradiction(config: Config) -> None:
    """Rules that say a quarter of what they should; a torque of two thirds of the load says not so."""
    rig = Rig(replace(config, design=replace(config.design, polynomial=0.25 * config.design.polynomial)))
    rig.torque = 2000.0
    rig.run(1000)
    for torque in range(2000, 60_000, 2000):
        rig.torque = float(torque)
        rig.run(10)
    rig.run(300)
    rows = decoded(rig, "InputHealth_A1")
    assert {row["Plausibility"] for row in rows} >= {"Unknown", "Contradiction"}
    contradicted = [row["Plausibility"] == "Contradiction" for row in rows]
    adhesion = decoded(rig, "Adhesion_A1")[4::5]
    assert all(a["Validity"] != "Valid" for a, c in zip(adhesion, contradicted, strict=True) if c)
