"""Statuses that the configuration names: several, with their own words, in the same message or in another one."""

import itertools
import struct
from typing import Any

import numpy as np
import pytest

from tests.support.dbc import database
from wrcd.bus.batch import FrameBatch
from wrcd.bus.dbc import Database
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity
from wrcd.core.counts import REASONS
from wrcd.core.reading import NOT_MAPPED, Receiver, Sample

DBC = """
BO_ 800 Gyro: 4 B
 SG_ Rate : 0|16@1- (0.001,0) [-30|30] "rad/s" B
 SG_ State : 16|4@1+ (1,0) [0|15] "" B
 SG_ Health : 20|4@1- (1,0) [-8|7] "" B
BO_ 801 Unit: 3 B
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" B
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" B
 SG_ Imu : 16|8@1+ (1,0) [0|255] "" B
BO_ 802 Speed: 3 B
 SG_ V : 0|16@1+ (0.01,0) [0|100] "m/s" B
 SG_ Status : 16|8@1+ (1,0) [0|255] "" B
BO_ 803 Axle: 3 B
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" B
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" B
 SG_ Pickup : 16|8@1+ (1,0) [0|255] "" B
VAL_ 802 Status 0 "OK" 1 "Degraded" 2 "FAULT" ;
"""
KNOWN = {"Gyro": None, "Unit": 801, "Speed": None, "Axle": 803}
LOCAL = (
    StatusRule("Gyro", "State", frozenset({1, 3}), frozenset({2})),
    StatusRule("Gyro", "Health", frozenset({-1}), frozenset({0})),
)
REMOTE = StatusRule("Unit", "Imu", frozenset({5}), frozenset({6}), timeout_us=50_000)
GYRO_ID, UNIT_ID = 800, 801


@pytest.fixture(scope="module")
def dbc() -> Database:
    return database(DBC)


def receiver(dbc: Database, *rules: StatusRule) -> Receiver:
    source = Source("Gyro", "Rate", Quantity.YAW_RATE, (0,), statuses=rules)
    return Receiver(dbc, [source, Source("Speed", "V", Quantity.SPEED, (0,))], KNOWN)


def gyro(stamp_us: int = 0, state: int = 1, health: int = -1, rate: int = 1000) -> Frame:
    return Frame(stamp_us, GYRO_ID, rate.to_bytes(2, "little") + bytes([state | (health & 0xF) << 4, 0]))


def unit(stamp_us: int, imu: int, counter: int) -> Frame:
    return Frame(stamp_us, UNIT_ID, protect(bytes([0, 0, imu]), 801, counter))


@pytest.mark.parametrize(
    ("state", "health", "expected"),
    [
        (1, -1, False),
        (3, -1, False),
        (2, -1, True),
        (1, 0, True),
        (2, 0, True),
        (0, -1, Reason.STATUS),
        (1, 1, Reason.STATUS),
        (2, -2, Reason.STATUS),
    ],
)
def test_every_named_status_counts(dbc: Database, state: int, health: int, expected: bool | Reason) -> None:
    got = receiver(dbc, *LOCAL).read(gyro(state=state, health=health))
    if isinstance(expected, Reason):
        assert got is expected
    else:
        assert got == [Sample(0, 1.0, degraded=expected)]


def test_status_that_is_not_named_does_not_count(dbc: Database) -> None:
    assert receiver(dbc).read(gyro(state=15, health=7)) == [Sample(0, 1.0)]


def test_many_statuses_are_each_looked_at() -> None:
    """More ways to be good than are told at one look."""
    lines = "".join(f' SG_ S{k} : {16 + 8 * k}|8@1+ (1,0) [0|255] "" B\n' for k in range(3))
    dbc = database(f'BO_ 800 M: 5 B\n SG_ V : 0|16@1+ (1,0) [0|100] "m/s" B\n{lines}')
    rules = tuple(StatusRule("M", f"S{k}", frozenset(range(9)), frozenset({9})) for k in range(3))
    read = Receiver(dbc, [Source("M", "V", Quantity.SPEED, (0,), statuses=rules)]).read
    for words in itertools.product((0, 8, 9, 10), repeat=3):
        got = read(Frame(0, 800, bytes([7, 0, *words])))
        assert got == (Reason.STATUS if 10 in words else [Sample(0, 7.0, degraded=9 in words)])


def test_status_may_be_a_floating_point_number() -> None:
    dbc = database(
        'BO_ 800 M: 6 B\n SG_ V : 0|16@1+ (1,0) [0|100] "m/s" B\n SG_ S : 16|32@1- (1,0) [0|0] "" B\n'
        "SIG_VALTYPE_ 800 S : 1;\n"
    )
    rule = StatusRule("M", "S", frozenset({0, 3}), frozenset({-2}))
    read = Receiver(dbc, [Source("M", "V", Quantity.SPEED, (0,), statuses=(rule,))]).read
    got = {word: read(Frame(0, 800, struct.pack("<Hf", 7, word))) for word in (0.0, 3.0, -2.0, 0.5, 2.0)}
    assert got == {
        0.0: [Sample(0, 7.0)], 3.0: [Sample(0, 7.0)], -2.0: [Sample(0, 7.0, degraded=True)],
        0.5: Reason.STATUS, 2.0: Reason.STATUS,
    }  # fmt: skip


def test_status_of_another_message_is_mapped_and_its_newest_counts(dbc: Database) -> None:
    r = receiver(dbc, REMOTE)
    assert r.mapped.keys == (800, 801, 802)
    assert r.read(gyro(0)) is Reason.STATUS  # not known yet
    assert r.read(unit(1_000, 5, 0)) == []
    assert r.read(gyro(2_000)) == [Sample(0, 1.0)]
    assert r.read(unit(3_000, 6, 1)) == []
    assert r.read(gyro(4_000)) == [Sample(0, 1.0, degraded=True)]
    assert r.read(unit(5_000, 7, 2)) == []
    assert r.read(gyro(6_000)) is Reason.STATUS
    assert r.read(unit(7_000, 5, 3)) == []
    assert r.read(gyro(57_000)) == [Sample(0, 1.0)]
    assert r.read(gyro(57_001)) is Reason.STATUS  # too old


def test_corrupted_status_of_another_message_is_not_taken(dbc: Database) -> None:
    r = receiver(dbc, REMOTE)
    r.read(unit(0, 5, 0))
    bad = unit(1_000, 7, 1)
    assert r.read(Frame(1_000, UNIT_ID, bad.data[:2] + b"\x05")) is Reason.CRC
    assert r.read(gyro(2_000)) == [Sample(0, 1.0)]


def test_two_senders_of_a_status_leave_it_unknown(dbc: Database) -> None:
    r = receiver(dbc, REMOTE)
    found: set[Any] = set()
    for k in range(12):
        r.read(unit(1_000 * k, 5, k % 15))
        if r.read(unit(1_000 * k, 5, (k + 7) % 15)) is Reason.TWO_SENDERS:
            got = r.read(gyro(1_000 * k))
            found.add(got if isinstance(got, Reason) else "accepted")
    assert found == {Reason.STATUS}


def test_two_senders_of_a_status_leave_the_others_known(dbc: Database) -> None:
    """Those that come in other frames, whichever is the first in the DBC."""
    pickup = StatusRule("Axle", "Pickup", frozenset({5}), frozenset({6}), timeout_us=50_000)
    for of_gyro, of_speed, twice in ((REMOTE, pickup, UNIT_ID), (pickup, REMOTE, 803)):
        sources = (
            Source("Gyro", "Rate", Quantity.YAW_RATE, (0,), statuses=(of_gyro,)),
            Source("Speed", "V", Quantity.SPEED, (0,), statuses=(of_speed,)),
        )
        r = Receiver(dbc, sources, KNOWN)
        for k in range(12):
            for can_id, counter in ((UNIT_ID, k), (803, k), (twice, k + 7)):
                r.read(Frame(0, can_id, protect(bytes([0, 0, 5]), can_id, counter % 15)))
        assert r.read(gyro(0)) is Reason.STATUS
        assert r.read(Frame(0, 802, b"\xc4\x09\0")) == [Sample(1, 25.0)]


def test_reset_forgets_a_status(dbc: Database) -> None:
    r = receiver(dbc, REMOTE)
    r.read(unit(0, 5, 0))
    r.reset()
    assert r.read(gyro(1_000)) is Reason.STATUS


@pytest.mark.parametrize("rules", [LOCAL, (REMOTE,), (*LOCAL, REMOTE)], ids=["local", "remote", "both"])
@pytest.mark.parametrize("states", [(1, 3), (1, 2, 3), (1, 0)], ids=["good", "degraded", "bad"])
def test_many_frames_at_once_are_read_as_one_after_the_other(
    dbc: Database, rules: tuple[StatusRule, ...], states: tuple[int, ...]
) -> None:
    chance = np.random.default_rng(1)
    frames = []
    for k in range(128):
        if k % 4 == 0:
            frames.append(unit(1_000 * k, int(chance.choice([5, 5, 6, 7])), k // 4 % 15))
            frames.append(Frame(1_000 * k, 0x7FF, b""))
        frames.append(gyro(1_000 * k, int(chance.choice(states)), int(chance.choice([-1, 0])), k + 1))
    one_by_one = receiver(dbc, *rules)
    expected = [one_by_one.read(f) for f in frames]
    reasons, values = receiver(dbc, *rules).read_all(FrameBatch.of(frames))
    rows = zip(*(values[x].tolist() for x in ("frame", "input", "value", "is_degraded", "is_contested")), strict=True)
    samples: dict[int, list[Sample]] = {}
    for frame, number, value, degraded, contested in rows:
        samples.setdefault(frame, []).append(Sample(number, value, degraded != 0, contested != 0))
    got = [
        samples.get(k, []) if reason == 0 else None if reason == NOT_MAPPED else REASONS[reason]
        for k, reason in enumerate(reasons.tolist())
    ]
    assert got == expected
    assert None in got
    assert (Reason.STATUS in got) is (rules != LOCAL or 0 in states)
