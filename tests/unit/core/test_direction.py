"""A train that runs backwards, with sensors that are fixed to it."""

from pathlib import Path

import numpy as np
import pytest

from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import RailSection, rail_at, rail_table
from sim_ecu.physics.wheelset import (
    AXLE_STATES,
    PSIDOT,
    W_L,
    W_R,
    Wheelset,
    Y,
    axle_derivatives,
    constants,
)
from tests.support.dbc_texts import DIRECTION_AND_LOAD_DBC
from tests.support.sensor_simulator import SensorSimulator, validities
from wrcd import resources
from wrcd.bus.codec import Sample
from wrcd.bus.frame import Frame
from wrcd.bus.units import Quantity
from wrcd.config import DEFAULT, load_config
from wrcd.core.configuration import Config
from wrcd.core.inputs import Inputs

STATE_ID = 800
FORWARD, REVERSE = bytes(4), bytes([1, 0, 0, 0])


@pytest.fixture
def with_direction(tmp_path: Path) -> Config:
    """The default configuration, and a signal of the direction of travel."""
    lines = DIRECTION_AND_LOAD_DBC.replace(" B\n", " WRCD\n").splitlines(keepends=True)
    values, message = lines.pop(), "".join(lines[next(i for i, x in enumerate(lines) if x.startswith("BO_ ")) :])
    text = resources.DBC.read_bytes().replace(b"\nBO_ ", f"\n{message}\nBO_ ".encode(), 1) + values.encode()
    (tmp_path / "train.dbc").write_bytes(text)
    file = tmp_path / "train.toml"
    own = '[dbc]\nfile = "train.dbc"\n[wheelset]\nname = "default"\n'
    file.write_text(own + DEFAULT.replace("[vehicle]", '[vehicle]\ndirection = "State.Dir"'))
    return load_config(file)


class Turned(SensorSimulator):
    """What its gyro and accelerometer say, each times its sign."""

    def __init__(self, config: Config, signs: tuple[int, int]) -> None:
        super().__init__(config)
        self._signs = signs

    def frame(self, can_id: int, payload: bytes, status: int = 0) -> Frame:
        for first, sign in zip((0x100, 0x110), self._signs, strict=True):
            if first < can_id <= first + 8 and sign < 0:
                value = -int.from_bytes(payload, "little", signed=True)
                payload = value.to_bytes(3, "little", signed=True)
        return super().frame(can_id, payload, status)


class Train(Turned):
    """The same, in the vehicle's own axes: x is its front, whichever way it runs."""

    def __init__(self, config: Config, state: bytes, signs: tuple[int, int]) -> None:
        super().__init__(config, signs)
        self._state = state

    def frames(self) -> list[Frame]:
        return [Frame(self.t + 500, STATE_ID, self._state), *super().frames()]


def test_train_in_reverse_gives_what_it_gives_forwards(with_direction: Config) -> None:
    """Turned round, its left is on the right: the accelerometer's sign changes. Its yaw stays counter-clockwise."""
    forwards = Train(with_direction, FORWARD, (1, 1)).run(2000)
    backwards = Train(with_direction, REVERSE, (1, -1)).run(2000)
    assert validities(forwards)[-1] == "Valid"
    assert [f["MuAvailable"] for f in backwards] == [f["MuAvailable"] for f in forwards]
    assert validities(backwards) == validities(forwards)
    wrong = Train(with_direction, REVERSE, (-1, -1)).run(2000)
    assert [f["MuAvailable"] for f in wrong] != [f["MuAvailable"] for f in forwards]


def test_speed_below_zero_is_a_train_in_reverse_where_no_direction_is_mapped(tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    file.write_text(
        DEFAULT.replace('speed = "VehicleSpeed.Speed"', 'speed = { signal = "VehicleSpeed.Speed", sign = -1 }')
    )
    config = load_config(file)
    forwards = Turned(load_config(None), (1, 1)).run(2000)
    backwards = Turned(config, (1, -1)).run(2000)
    assert validities(backwards) == ["NotAvailable", "Valid"]
    assert [f["MuAvailable"] for f in backwards] == [f["MuAvailable"] for f in forwards]


def test_mapped_direction_counts_more_than_the_sign_of_the_speed(with_direction: Config) -> None:
    inputs = Inputs(with_direction)
    speed, direction = (
        next(k for k, i in enumerate(with_direction.inputs) if i.source.quantity is q)
        for q in (Quantity.SPEED, Quantity.DIRECTION)
    )
    inputs.accept(Sample(direction, 1.0, False, False), 0)
    inputs.accept(Sample(speed, -25.0, False, False), 0)
    assert not inputs.reverse


def test_wheelset_left_of_the_track_turns_clockwise() -> None:
    """Why: the wheel with the larger rolling radius leads. In axes that turn with the travel the equations are the
    same backwards; in the vehicle's own the wheelset left of the track turns counter-clockwise then."""
    w, v = Wheelset(), 20.0
    rail = rail_at(rail_table([RailSection(0.0, CURVES["A"])]), 1.0)

    def yaw_acceleration(y: float) -> float:
        state, out = np.zeros(AXLE_STATES), np.zeros(AXLE_STATES)
        state[Y], state[W_R], state[W_L] = y, v / w.r_0, v / w.r_0
        axle_derivatives(state, v, 0.0, 0.0, rail, constants(w), w.contact, out)
        return float(out[PSIDOT])

    assert yaw_acceleration(1e-4) < 0 < yaw_acceleration(-1e-4)
