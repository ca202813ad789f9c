"""Signals of which a frame carries only some: simple and extended multiplexing."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.support.dbc import database
from wrcd.bus.batch import FrameBatch
from wrcd.bus.dbc import Database, find_message
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity
from wrcd.core.counts import REASONS
from wrcd.core.reading import Receiver, Sample

SIMPLE = """
BO_ 800 M: 8 B
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" B
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" B
 SG_ Mode M : 12|4@1+ (1,0) [0|15] "" B
 SG_ Yaw m0 : 16|16@1- (0.001,0) [-20|20] "rad/s" B
 SG_ Torque m1 : 16|16@1- (10,0) [-50000|50000] "Nm" B
 SG_ Health m2 : 16|8@1+ (1,0) [0|255] "" B
 SG_ V : 47|16@0+ (0.01,0) [0|100] "m/s" B
"""
EXTENDED = """
BO_ 800 M: 8 B
 SG_ Mode M : 0|8@1+ (1,0) [0|255] "" B
 SG_ Sub m2M : 8|8@1+ (1,0) [0|255] "" B
 SG_ Yaw m3 : 16|16@1- (0.001,0) [-20|20] "rad/s" B
 SG_ Torque m1 : 16|16@1- (10,0) [-50000|50000] "Nm" B
SG_MUL_VAL_ 800 Sub Mode 2-2;
SG_MUL_VAL_ 800 Yaw Sub 3-5, 7-7;
SG_MUL_VAL_ 800 Torque Mode 1-1, 9-12;
"""
SOURCES = (
    Source("M", "Yaw", Quantity.YAW_RATE, (0,)),
    Source("M", "Torque", Quantity.TORQUE, (0,)),
    Source("M", "V", Quantity.SPEED, (0,)),
)


@pytest.fixture(scope="module")
def simple() -> Database:
    return database(SIMPLE)


def frame(mode: int, value: int, speed: int = 2500, counter: int = 0, stamp_us: int = 0) -> Frame:
    data = bytes([0, mode << 4]) + value.to_bytes(2, "little", signed=True) + b"\0" + speed.to_bytes(2, "big") + b"\0"
    return Frame(stamp_us, 800, protect(data, 800, counter))


def test_frame_carries_the_signals_of_its_multiplexer_value(simple: Database) -> None:
    r = Receiver(simple, SOURCES, {"M": 800})
    assert r.read(frame(0, -1000, counter=0)) == [Sample(0, -1.0), Sample(2, 25.0)]
    assert r.read(frame(1, 300, counter=1)) == [Sample(1, 3000.0), Sample(2, 25.0)]
    assert r.read(frame(7, 300, counter=2)) == [Sample(2, 25.0)]


def test_frame_without_a_mapped_signal_is_no_rejection_and_its_counter_counts(simple: Database) -> None:
    r = Receiver(simple, SOURCES[:1], {"M": 800})
    assert r.read(frame(1, 300, counter=0)) == []
    assert r.read(frame(0, 300, counter=5)) is Reason.COUNTER
    assert r.read(frame(1, 300, counter=1)) == []
    assert r.read(frame(0, 300, counter=2)) == [Sample(0, 0.3)]


def test_rejection_concerns_the_signals_that_the_frame_carries(simple: Database) -> None:
    r = Receiver(simple, SOURCES, {"M": 800})
    beyond = frame(1, 300, speed=60_000)
    garbled = replace(beyond, data=b"\0" + beyond.data[1:])
    for bad, reason, concerned in ((beyond, Reason.RANGE, [1, 2]), (garbled, Reason.CRC, [0, 1, 2])):
        (found,), values = r.read_all(FrameBatch.of([bad]))
        assert REASONS[found] is reason
        assert values["input"].tolist() == concerned
        assert np.isnan(values["value"]).all()


def test_of_two_senders_every_signal_is_refused(simple: Database) -> None:
    """Whichever of them a frame carries."""
    counters = (0, 7, 1, 8, 2, 9)
    reasons, values = Receiver(simple, SOURCES, {"M": 800}).read_all(
        FrameBatch.of([frame(1, 3, 0, c) for c in counters])
    )
    assert REASONS[reasons[-1]] is Reason.TWO_SENDERS
    assert values["input"][values["frame"] == len(counters) - 1].tolist() == [0, 1, 2]


def test_multiplexed_status_is_kept_for_the_other_frames(simple: Database) -> None:
    rule = StatusRule("M", "Health", frozenset({1}), frozenset({2}), timeout_us=30_000)
    r = Receiver(simple, [Source("M", "Yaw", Quantity.YAW_RATE, (0,), statuses=(rule,))], {"M": 800})
    assert r.read(frame(0, 300, counter=0)) is Reason.STATUS
    assert r.read(frame(2, 2, counter=1)) == []
    assert r.read(frame(0, 300, counter=2, stamp_us=30_000)) == [Sample(0, 0.3, degraded=True)]
    assert r.read(frame(0, 300, counter=3, stamp_us=30_001)) is Reason.STATUS


def test_extended_multiplexing_is_read_as_by_cantools() -> None:
    dbc = database(EXTENDED)
    message = find_message(dbc, "M")
    r = Receiver(dbc, SOURCES[:2])
    seen = set()
    for mode, sub in itertools.product(range(14), range(9)):
        data = bytes([mode, sub, 0x34, 0x02, 0, 0, 0, 0])
        try:
            there = message.decode(data, scaling=False)
        except Exception:  # no signals for this value
            there = {}
        expected = [s.signal for s in SOURCES[:2] if isinstance(there, dict) and s.signal in there]
        got = r.read(Frame(0, 800, data))
        assert isinstance(got, list)
        assert [SOURCES[s.source].signal for s in got] == expected
        seen.update(expected or ["nothing"])
    assert seen == {"Yaw", "Torque", "nothing"}
