"""Streams of frames against a decoder made of cantools alone: CAN FD, floating-point numbers, both byte orders, pages,
statuses in other frames, torque in parts."""

import math
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.config_texts import AXLE
from tests.support.dbc import database
from tests.support.sensor_simulator import START_US
from wrcd import resources
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.reading import Receiver, Sample

MOTORS = """
BO_ 800 Motor1: 8 B
 SG_ Page M : 7|4@0+ (1,0) [0|15] "" B
 SG_ Torque1 m0 : 16|32@1- (2.5,-40) [0|0] "Nm" B
 SG_ State m1 : 23|8@0+ (1,0) [0|255] "" B
BO_ 801 Motor2: 24 B
 SG_ Torque2 : 71|64@0- (1,0) [0|0] "Nm" B
 SG_ Health : 187|3@1- (1,0) [-4|3] "" B
"""
OTHERS = """
BO_ 802 Imu: 8 B
 SG_ Yaw : 7|16@0- (1,0) [-20|20] "rad/s" B
 SG_ Lat : 16|24@1- (0.00001,0) [-80|80] "m/s2" B
 SG_ V : 47|16@0+ (0.01,0) [0|150] "m/s" B
BO_ 803 Unit: 2 B
 SG_ Word : 4|8@1+ (1,0) [0|255] "" B
"""
CODED = "SIG_VALTYPE_ 800 Torque1 : 1;\nSIG_VALTYPE_ 801 Torque2 : 2;\n"
DBC = database(f"{MOTORS}{OTHERS}{CODED}SIG_VALTYPE_ 802 Yaw : 1;\n")
MESSAGES = {name: find_message(DBC, name) for name in ("Motor1", "Motor2", "Imu", "Unit")}
STATE = StatusRule("Motor1", "State", frozenset({1, 2}), frozenset({3}), 50_000)
HEALTH = StatusRule("Motor2", "Health", frozenset({-1}), frozenset({0, 1}))
WORD = StatusRule("Unit", "Word", frozenset({5, 200}), frozenset({6}), 20_000)
SOURCES = (
    Source("Motor1", "Torque1", Quantity.TORQUE, (0,), statuses=(STATE, WORD)),
    Source("Motor2", "Torque2", Quantity.TORQUE, (0,), part=1, statuses=(HEALTH,), factor=-4.5),
    Source("Imu", "Lat", Quantity.LAT_ACCEL, (0,), statuses=(WORD,)),
    Source("Imu", "Yaw", Quantity.YAW_RATE, (0,), statuses=(WORD,)),
    Source("Imu", "V", Quantity.SPEED, (0,)),
)


def decoded(frame: Frame, scaling: bool = False) -> dict[str, Any]:
    """Of a frame, by cantools."""
    message = next(m for m in MESSAGES.values() if m.frame_id == frame.can_id)
    found = message.decode(frame.data, decode_choices=False, scaling=scaling, allow_truncated=True)
    assert isinstance(found, dict)
    return found


class Decoder:
    """By what cantools gives: what a stream's frames say."""

    def __init__(self) -> None:
        self._newest: dict[StatusRule, tuple[int, int]] = {}  # what was said, and when

    def read(self, frame: Frame) -> list[Sample] | Reason:
        """Samples, or why the frame is refused."""
        raw, physical = decoded(frame), decoded(frame, scaling=True)
        for rule in (STATE, HEALTH, WORD):
            if MESSAGES[rule.message].frame_id == frame.can_id and rule.signal in raw:
                self._newest[rule] = raw[rule.signal], frame.stamp_us
        carried = [
            (number, s) for number, s in enumerate(SOURCES)
            if MESSAGES[s.message].frame_id == frame.can_id and s.signal in raw
        ]  # fmt: skip
        degraded = False
        for rule in (rule for _, s in carried for rule in s.statuses):
            word, stamp_us = self._newest.get(rule, (-999, 0))
            if rule is not HEALTH and frame.stamp_us - stamp_us > rule.timeout_us:
                return Reason.STATUS
            if word not in rule.ok | rule.degraded:
                return Reason.STATUS
            degraded |= word in rule.degraded
        samples = []
        for number, s in carried:
            value = float(physical[s.signal])
            low, high = ((-math.inf, math.inf), (-80, 80), (-20, 20), (0, 150))[max(number - 1, 0)]
            si = value * (1.0 if s.factor is None else s.factor)
            if not math.isfinite(si):
                return Reason.NOT_FINITE
            if not low <= value <= high or abs(si) > s.quantity.limit:
                return Reason.RANGE
            samples.append(Sample(number, si, degraded))
        return samples


def floats(width: Literal[16, 32, 64], most: float) -> st.SearchStrategy[float]:
    """Usual ones most of the time."""
    usual = st.floats(-most, most, width=width)
    return st.one_of(usual, usual, usual, st.floats(width=width))


WORDS = st.one_of(st.sampled_from((1, 2, 3, 5, 6, 200)), st.sampled_from((1, 5)), st.integers(0, 255))
CONTENTS = st.one_of(
    st.tuples(st.just("Motor1"), st.fixed_dictionaries({"Page": st.just(0), "Torque1": floats(32, 4096.0)})),
    st.tuples(st.just("Motor1"), st.fixed_dictionaries({"Page": st.just(1), "State": WORDS})),
    st.tuples(
        st.just("Motor2"),
        st.fixed_dictionaries({"Torque2": floats(64, 1e5), "Health": st.sampled_from((-1, 0, 1)) | st.integers(-4, 3)}),
    ),
    st.tuples(
        st.just("Imu"),
        st.fixed_dictionaries({
            "Yaw": floats(16, 19.0), "Lat": st.integers(-(1 << 23), (1 << 23) - 1), "V": st.integers(0, 16_000)
        }),
    ),
    st.tuples(st.just("Unit"), st.fixed_dictionaries({"Word": WORDS})),
)  # fmt: skip


@given(st.lists(st.tuples(CONTENTS, st.integers(0, 15_000)), max_size=40), st.sampled_from((0, -START_US, START_US)))
def test_stream_is_read_as_by_an_independent_decoder(
    stream: list[tuple[tuple[str, dict[str, float]], int]], begin_us: int
) -> None:
    receiver, decoder, stamp_us = Receiver(DBC, SOURCES), Decoder(), begin_us
    for (name, raw), after_us in stream:
        stamp_us += after_us
        message = MESSAGES[name]
        data = message.encode(raw, scaling=False, strict=False)
        frame = Frame(stamp_us, message.frame_id, data, fd=len(data) > 8)
        assert receiver.read(frame) == decoder.read(frame)


def test_page_that_nobody_reads_brings_nothing() -> None:
    assert Receiver(DBC, SOURCES).read(Frame(0, 800, bytes([0x70, *range(1, 8)]))) == []


@pytest.fixture(scope="module")
def motors(tmp_path_factory: pytest.TempPathFactory) -> Config:
    """The packaged DBC, and two motors of one axle."""
    folder = tmp_path_factory.mktemp("motors")
    own = MOTORS.replace(" B\n", " WRCD\n")
    text = resources.DBC.read_text("cp1252").replace("\nCM_ ", f"{own}\nCM_ ", 1)
    (folder / "own.dbc").write_text(text + CODED, "cp1252")
    parts = 'torque = ["Motor1.Torque1", { signal = "Motor2.Torque2", at = "motor", gear_ratio = 4.5, sign = -1 }]'
    (folder / "train.toml").write_text(
        '[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n[vehicle]\nspeed = "VehicleSpeed.Speed"\n'
        + AXLE.replace('torque = "Torque_A1.Torque"', parts)
    )
    return load_config(folder / "train.toml")


@given(first=st.floats(-8192, 8192, width=32), second=st.floats(-5000, 5000), begin_us=st.sampled_from((0, START_US)))
def test_torque_in_parts_is_the_sum_of_what_an_independent_decoder_reads(
    motors: Config, first: float, second: float, begin_us: int
) -> None:
    """Of those against each other the larger side."""
    core = Core(motors)
    frames = []
    for name, raw in (("Motor1", {"Page": 0, "Torque1": first}), ("Motor2", {"Torque2": second, "Health": 0})):
        data = MESSAGES[name].encode(raw, scaling=False, strict=False)
        frames.append(Frame(begin_us + 1000, MESSAGES[name].frame_id, data, fd=len(data) > 8))
    core.feed(frames)
    core.advance(begin_us + 5000)
    assert core.counts.accepted == 2
    torques = float(decoded(frames[0], True)["Torque1"]), -4.5 * float(decoded(frames[1], True)["Torque2"])
    whole_Nm = 2 * motors.design.normal_N * motors.design.r_0
    against = min(torques) < -0.02 * whole_Nm and max(torques) > 0.02 * whole_Nm
    torque = max(map(abs, torques)) if against else abs(sum(torques))
    assert core._train.state["axle"]["torque_ratio"][0] == pytest.approx(torque / whole_Nm, rel=1e-12, abs=1e-15)
