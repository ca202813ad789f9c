"""The rig's frames against those of cantools and the autosar-e2e package, one by one."""

import numpy as np
import pytest
from cantools.database.can import Message

from sim_ecu.play.encoder import (
    SAMPLE_US,
    Channel,
    Encoder,
    Reading,
    SensorSample,
    Sent,
    data_id,
    databases,
    protect,
)  # fmt: skip


def by_the_libraries(message: Message, due_us: int, values: dict[str, float]) -> Sent:
    """A frame by cantools and the autosar-e2e package."""
    own = {s.name: s for s in message.signals}
    held = {k: min(max(v, float(own[k].minimum or 0.0)), float(own[k].maximum or 0.0)) for k, v in values.items()}
    counter = (due_us // (1000 * int(message.cycle_time or 0)) - 1) % 15
    data = message.encode({"Crc": 0, "Counter": counter, "Status": 0, **held}, strict=False)
    return Sent(due_us, message.frame_id, protect(data, data_id(message)))


def message_of(name: str) -> Message:
    message = next(m for database in databases() for m in database.messages if m.name == name)
    assert isinstance(message, Message)
    return message


@pytest.mark.parametrize(
    "name",
    ["YawRate_A1", "LatAccel_A2", "Torque_A1", "VehicleSpeed", "SimTruth_A1", "Demand_A1", "DriverDemand",
     "WheelSpeed_A2", "BrakePressure_A1"],
)  # fmt: skip
def test_frames_are_the_bytes_of_cantools(name: str) -> None:
    message = message_of(name)
    channel, rng = Channel(message), np.random.default_rng(5)
    own = [s for s in message.signals if s.name not in ("Crc", "Counter", "Status")]
    for k in range(1, 200):
        values = {s.name: float(rng.uniform(-1.2, 1.2) * (s.maximum or 1.0)) for s in own if s.choices is None}
        values |= {s.name: int(rng.choice(list(s.choices))) for s in own if s.choices is not None}
        due_us = k * channel.every_us
        assert channel.encode(due_us, values) == by_the_libraries(message, due_us, values)


@pytest.mark.parametrize("raw", [-0.5, 0.5, 1.5, 2.5, -(2**23) - 7, 2**23 + 7, 0.0, -0.0])
def test_halves_and_ends_are_rounded_as_cantools_does(raw: float) -> None:
    message, due_us = message_of("YawRate_A1"), 3 * SAMPLE_US
    channel, value = Channel(message), raw * float(message.get_signal_by_name("YawRate").scale)
    assert channel.encode(due_us, {"YawRate": value}) == by_the_libraries(message, due_us, {"YawRate": value})


def test_frames_of_many_samples_at_once_are_those_one_by_one() -> None:
    n, rng = 60, np.random.default_rng(7)
    due_us, speed, readings = SAMPLE_US * np.arange(1, n + 1), rng.uniform(0, 60, n), rng.normal(0, 3, (n, 2, 6))
    readings[..., 2] *= 2e4
    one_by_one, at_once = Encoder([1, 3], truth=False, counter=4), Encoder([1, 3], truth=False, counter=4)
    expected = [
        (f.due_us, f.can_id, f.data)
        for t, v, of in zip(due_us.tolist(), speed.tolist(), readings.tolist(), strict=True)
        for f in one_by_one.frames(SensorSample(t, v, (Reading(1, *of[0]), Reading(3, *of[1]))))
    ]
    found = at_once.frames_of(due_us, speed, readings)
    assert [(f["due_us"], f["can_id"], f["data"][: f["length"]].tobytes()) for f in found] == expected
    with pytest.raises(ValueError, match="truth"):
        Encoder([1]).frames_of(due_us, speed, readings)
