"""The rig's frames by columns against those of cantools and the autosar-e2e package, one by one."""

import numpy as np
import pytest
from cantools.database.can import Message

from sim_ecu.play.encoder import (
    SAMPLE_US,
    Channel,
    EncodedStretch,
    Encoder,
    Sent,
    data_id,
    databases,
    protect,
    stretch_of,
)

NUMBERS = (1, 3)
UNITS = np.array([4.0, 30.0, 4e4, 60.0, 60.0, 0.2])  # of a Reading's columns; some values lie beyond their signal


def stretch(seed: int, samples: int, first: int = 1) -> EncodedStretch:
    rng = np.random.default_rng(seed)
    due_us = np.arange(first, first + samples) * SAMPLE_US
    readings = UNITS * rng.standard_normal((samples, len(NUMBERS), len(UNITS)))
    return EncodedStretch(NUMBERS, due_us, np.abs(80.0 * rng.standard_normal(samples)), readings)


@pytest.mark.parametrize(("truth", "counter"), [(True, 0), (False, 7)])
def test_a_stretch_is_the_bytes_of_its_samples(truth: bool, counter: int) -> None:
    s = stretch(1, 500)
    encoder = Encoder(list(NUMBERS), truth, counter)
    assert encoder.stretch(s) == [list(encoder.frames(sample)) for sample in s.samples()]


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


def test_stretches_may_be_cut_anywhere() -> None:
    whole, encoder = stretch(2, 61), Encoder(list(NUMBERS))
    frames = encoder.stretch(whole)
    for first, end in ((0, 1), (1, 7), (7, 61)):
        part = EncodedStretch(NUMBERS, whole.due_us[first:end], whole.speed_m_s[first:end], whole.readings[first:end])
        assert encoder.stretch(part) == frames[first:end]


def test_a_stretch_of_samples_is_what_they_came_from() -> None:
    s = stretch(3, 20)
    again = stretch_of(list(s.samples()))
    assert again.numbers == s.numbers
    assert all(np.array_equal(a, b) for a, b in zip(again[1:], s[1:], strict=True))


@pytest.mark.parametrize("raw", [-0.5, 0.5, 1.5, 2.5, -(2**23) - 7, 2**23 + 7, 0.0, -0.0])
def test_halves_and_ends_are_rounded_as_cantools_does(raw: float) -> None:
    message, due_us = message_of("YawRate_A1"), 3 * SAMPLE_US
    channel, value = Channel(message), raw * float(message.get_signal_by_name("YawRate").scale)
    (frame,) = channel.encode_all(np.array([due_us]), {"YawRate": np.array([value])})
    assert frame == channel.encode(due_us, {"YawRate": value}) == by_the_libraries(message, due_us, {"YawRate": value})
