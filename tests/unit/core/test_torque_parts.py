"""Torque that several signals add up to, and torques that are against each other."""

import struct
from pathlib import Path

import pytest

from tests.support.can_ids import TORQUE
from tests.support.config_texts import VEHICLE
from tests.support.sensor_simulator import SensorSimulator, validities
from wrcd.bus.frame import Frame
from wrcd.config import load_config
from wrcd.core.causes import Cause
from wrcd.core.inputs import AGAINST_SHARE

MOTOR, BRAKE = TORQUE[1], TORQUE[2]  # the packaged DBC's torques of other axles stand for more signals of the first
PARTS = """torque = [ "Torque_A1.Torque", { signal = "Torque_A2.Torque", SECOND } ]"""
BESIDE = """torque = "Torque_A1.Torque"
brake_torque = { signal = "Torque_A2.Torque", SECOND }"""


class Train(SensorSimulator):
    """A second torque beside the simulator's."""

    second = 0.0
    second_silent = False

    def frames(self) -> list[Frame]:
        counter = self.counter
        frames = super().frames()
        now, self.counter = self.counter, counter
        self.t -= 5000
        one = self.frame(BRAKE, struct.pack("<i", round(self.second * 100))[:3])
        self.t += 5000
        self.counter = now
        return frames if self.second_silent else [*frames, one]

    @property
    def ratio_Nm(self) -> float:
        """|torque| of axle 1 as the core has it."""
        design = self.config.design
        return self.core._tick.torque_ratio[0] * 2 * design.normal_N * design.r_0


def train(tmp_path: Path, text: str, second: str = "sign = 1") -> Train:
    file = tmp_path / "train.toml"
    file.write_text(
        VEHICLE
        + '[[axle]]\nnumber = 1\nyaw_rate = "YawRate_A1.YawRate"\nlateral_acceleration = "LatAccel_A1.LatAccel"\n'
        + text.replace("SECOND", second)
    )
    return Train(load_config(file))


@pytest.mark.parametrize("text", [PARTS, BESIDE], ids=["parts", "brake torque"])
@pytest.mark.parametrize(
    ("second", "torques", "total"),
    [
        ("sign = 1", (-4000.0, -3000.0), 7000.0),
        ("sign = -1", (-4000.0, 3000.0), 7000.0),
        ('at = "motor", gear_ratio = 4.5', (-4000.0, -1000.0), 8500.0),
        ('at = "motor", gear_ratio = 4.5, sign = -1, share = 0.5', (-4000.0, 1000.0), 6250.0),
        ("sign = 1", (9000.0, 500.0), 9500.0),
    ],
)
def test_parts_add_up(tmp_path: Path, text: str, second: str, torques: tuple[float, float], total: float) -> None:
    sim = train(tmp_path, text, second)
    sim.torque, sim.second = torques
    assert validities(sim.run(1500)) == ["NotAvailable", "Valid"]
    assert sim.ratio_Nm == pytest.approx(total, abs=0.1)


@pytest.mark.parametrize("text", [PARTS, BESIDE], ids=["parts", "brake torque"])
def test_torques_against_each_other_are_degraded_and_mu_used_is_the_larger(tmp_path: Path, text: str) -> None:
    """The sign of the second was forgotten."""
    sim = train(tmp_path, text)
    sim.torque, sim.second = -6000.0, 0.0
    assert validities(sim.run(1500)) == ["NotAvailable", "Valid"]
    sim.second = 3900.0
    (*_, last) = sim.run(200)
    assert last["Validity"] == "Degraded"
    assert sim.core.reports[0].cause is Cause.TORQUES_CONTRADICT
    assert sim.ratio_Nm == pytest.approx(6000.0, abs=0.1)
    assert sim.decoded("AdhesionDetail_A1")[-1]["Cause"] == "TorquesContradict"
    sim.torque = -1500.0
    sim.run(200)
    assert sim.ratio_Nm == pytest.approx(3900.0, abs=0.1)
    sim.second = -3900.0  # mended: Valid a window later
    assert validities(sim.run(1500)) == ["Degraded", "Valid"]
    assert sim.ratio_Nm == pytest.approx(5400.0, abs=0.1)


def test_small_torques_against_each_other_are_no_contradiction(tmp_path: Path) -> None:
    sim = train(tmp_path, BESIDE)
    design = sim.config.design
    limit = AGAINST_SHARE * 2 * design.normal_N * design.r_0
    sim.torque, sim.second = -6000.0, 0.95 * limit
    assert validities(sim.run(1500)) == ["NotAvailable", "Valid"]
    assert sim.ratio_Nm == pytest.approx(6000.0 - 0.95 * limit, abs=0.1)


def test_applied_brake_under_traction_contradicts_and_the_larger_side_is_in_use(tmp_path: Path) -> None:
    sim = train(tmp_path, BESIDE)
    sim.torque, sim.second = 9000.0, -3000.0
    assert validities(sim.run(1500)) == ["NotAvailable", "Degraded"]
    assert sim.ratio_Nm == pytest.approx(9000.0, abs=0.1)
    sim.second = -100.0
    assert validities(sim.run(1500)) == ["Degraded", "Valid"]


def test_silent_part_makes_the_torque_stale_then_unavailable(tmp_path: Path) -> None:
    sim = train(tmp_path, PARTS)
    sim.run(1500)
    assert sim.decoded("InputHealth_A1")[-1]["ReachTorque"] == 255
    sim.second_silent = True
    frames = sim.run(200)
    assert validities(frames) == ["Valid", "Degraded", "NotAvailable"]
    assert frames[-1]["MuUsed"] == "NotAvailable"
    assert frames[-1]["SampleAge"] > 150
    assert sim.decoded("AdhesionDetail_A1")[-1]["StaleTorque"] == "Stale"
    # the worst of both
    assert sim.decoded("InputHealth_A1")[-1]["ReachTorque"] < 255
    sim.second_silent = False
    assert validities(sim.run(1500)) == ["NotAvailable", "Valid"]
    sim.silent = {MOTOR}
    assert validities(sim.run(200))[-1] == "NotAvailable"
