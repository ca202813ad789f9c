"""Single wrong samples, samples that go on being wrong, jumps, and sensors that stand still."""

import pytest

from tests.support.sensor_simulator import MS, SensorSimulator, validities
from wrcd.bus.reasons import Reason


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


def test_clock_step_clears_the_outlier(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.spike = 5_000_000
    sim.run(5)
    sim.spike = 0
    sim.t -= 3_600_000 * MS
    sim.run(2000)
    assert sim.core.counts.rejected.total() == 0  # the first frame after the step is not held against the old chain
    assert sim.decoded("InputHealth_A1")[-1]["Outlier"] == "No"


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
