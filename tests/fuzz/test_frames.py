"""Whatever bytes come from the bus, the codec takes them or refuses them with a reason."""

import math
from collections.abc import Sequence
from pathlib import Path

import e2e.p11
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.fuzz.strategies import any_frames, damaged, near_frames
from tests.support.can_ids import UNMAPPED, YAW_RATE_A1
from tests.support.dbc import DIRECTION_AND_LOAD_DBC, TRAIN_DBC
from wrcd.bus.batch import FrameBatch
from wrcd.bus.candump import format_line, parse_line
from wrcd.bus.dbc import Database, load_dbc
from wrcd.bus.e2e import COUNTER_MODULO, crc, protect
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.bus.positions import message_key
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity
from wrcd.config.config import load_config
from wrcd.core.reading import Checker, Receiver

CONFIG = load_config(None)
SOURCES = [i.source for i in CONFIG.inputs]
LENGTHS = {
    m.frame_id: m.length
    for m in CONFIG.database.messages
    if m.frame_id in Receiver(CONFIG.database, SOURCES).mapped.keys
}
TRAIN_SOURCES = (
    Source("Bogie1", "Gyro", Quantity.YAW_RATE, (0,)),
    Source("Bogie1", "Side", Quantity.LAT_ACCEL, (0,)),
    Source("Bogie1", "Tractive", Quantity.TORQUE, (0,)),
    Source("Drive", "V", Quantity.SPEED, (0, 1)),
)
DIRECTION_AND_LOAD_SOURCES = (
    Source("State", "Dir", Quantity.DIRECTION, (0,)),
    Source("State", "Load", Quantity.AXLE_LOAD, (0,)),
)


def judge(receiver: Receiver, sources: Sequence[Source], frame: Frame) -> None:
    """What the rest of the daemon relies on."""
    got = receiver.read(frame)
    mapped = frame.key in receiver.mapped.keys and not frame.error
    assert (got is not None) == mapped
    if isinstance(got, list):
        assert got
        assert frame.plain
        for s in got:
            assert math.isfinite(s.value)
            quantity = sources[s.source].quantity
            assert abs(s.value) <= quantity.limit
            assert quantity not in (Quantity.AXLE_LOAD, Quantity.WHEEL_RADIUS) or s.value > 0
    elif got is not None:
        assert isinstance(got, Reason)


@given(st.lists(any_frames(sorted(LENGTHS)) | near_frames(LENGTHS), max_size=30))
def test_any_frame_is_accepted_or_rejected(frames: list[Frame]) -> None:
    receiver = Receiver(CONFIG.database, SOURCES)
    for frame in frames:
        judge(receiver, SOURCES, frame)


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Database, tuple[Source, ...]]]:
    folder = tmp_path_factory.mktemp("dbc")
    out: list[tuple[Database, tuple[Source, ...]]] = []
    for name, text, sources in (
        ("a", TRAIN_DBC, TRAIN_SOURCES),
        ("b", DIRECTION_AND_LOAD_DBC, DIRECTION_AND_LOAD_SOURCES),
    ):
        (folder / f"{name}.dbc").write_text(text)
        out.append((load_dbc(folder / f"{name}.dbc"), sources))
    return out


@given(data=st.data())
def test_any_frame_of_an_own_dbc_is_accepted_or_rejected(
    foreign: list[tuple[Database, tuple[Source, ...]]], data: st.DataObject
) -> None:
    for database, sources in foreign:
        receiver = Receiver(database, sources)
        lengths = {m.frame_id: m.length for m in database.messages}
        for frame in data.draw(
            st.lists(
                near_frames(lengths, protected=False) | any_frames([key & ~EXTENDED for key in receiver.mapped.keys]),
                max_size=15,
            )
        ):
            judge(receiver, sources, frame)


THIRD_PARTY = load_config(Path(__file__).parents[1] / "data/dbc/third-party.toml")
# CAN FD, multiplexed signals of own factors, a status in another message
ODD_SOURCES = (
    *(i.source for i in THIRD_PARTY.inputs),
    Source("ASG_Diagnose", "Strom", Quantity.TORQUE, (0,), factor=3.0, part=1),
    Source(
        "ASG_Diagnose", "Spannung", Quantity.BRAKE_TORQUE, (0,), factor=-5.0, invalid=frozenset({7}),
        statuses=(StatusRule("Klima_Ist", "Zustand", frozenset({0, 1}), frozenset({2}), 1_000_000),),
    ),
)  # fmt: skip
ODD_LENGTHS = {message_key(m): (m.length, m.is_fd) for m in THIRD_PARTY.database.messages}


@st.composite
def odd_frames(draw: st.DrawFn) -> Frame:
    key = draw(st.sampled_from(sorted(ODD_LENGTHS)))
    length, fd = ODD_LENGTHS[key]
    data = draw(st.binary(min_size=length, max_size=length) | st.binary(max_size=64))
    fd = fd ^ (draw(st.integers(0, 9)) == 0)
    return Frame(draw(st.integers(0, 5_000_000)), key & ~EXTENDED, data, bool(key & EXTENDED), False, False, fd)


@given(st.lists(odd_frames(), max_size=30))
def test_any_frame_of_an_odd_message_is_accepted_or_rejected(frames: list[Frame]) -> None:
    receiver, again = (Receiver(THIRD_PARTY.database, ODD_SOURCES) for _ in range(2))
    names = {m.key: m.name for m in receiver.mapped.messages}
    for frame in frames:
        got = receiver.read(frame)
        assert (got is None) == (frame.key not in names)
        _, values = again.read_all(FrameBatch.of([frame]))
        concerned = {ODD_SOURCES[number].message for number in values["input"].tolist()}
        if got is None:
            assert not concerned
            continue
        assert concerned <= {names[frame.key]}
        if isinstance(got, Reason):
            assert np.isnan(values["value"]).all()
            continue
        assert (len(frame.data), frame.fd) == ODD_LENGTHS[frame.key]
        assert values["value"].tolist() == [s.value for s in got]
        for s in got:
            assert abs(s.value) <= ODD_SOURCES[s.source].quantity.limit


@given(st.binary(min_size=2, max_size=64), st.integers(0, 0xFFFF), st.integers(0, COUNTER_MODULO - 1), st.data())
def test_protection_equals_the_autosar_packages(data: bytes, identity: int, counter: int, more: st.DataObject) -> None:
    ours = protect(data, identity, counter)
    theirs = bytearray(data[:1] + bytes((data[1] & 0xF0 | counter,)) + data[2:])
    e2e.p11.e2e_p11_protect(theirs, identity, increment_counter=False)
    assert ours == bytes(theirs)
    changed = more.draw(damaged(ours))
    if len(changed) >= 2:
        fits = changed[0] == crc(changed, identity) and changed[1] & 0x0F < COUNTER_MODULO
        assert fits == e2e.p11.e2e_p11_check(bytearray(changed), identity)


@given(
    identity=st.integers(0, 0xFFFF),
    others=st.lists(st.integers(0, 0xFFFF), max_size=3),
    moves=st.lists(st.tuples(st.integers(0, COUNTER_MODULO), st.binary(max_size=8), st.booleans()), max_size=60),
)
def test_checker_accepts_nothing_that_the_autosar_package_rejects(
    identity: int, others: list[int], moves: list[tuple[int, bytes, bool]]
) -> None:
    checker = Checker(identity, tuple(i for i in others if i != identity))
    before = b""
    for counter, payload, whole in moves:
        data = protect(bytes(2) + payload, identity, counter) if whole else payload
        good = len(data) >= 2 and e2e.p11.e2e_p11_check(bytearray(data), identity)
        reason = checker.check(data)
        if reason is None:
            assert good
            assert data != before
        elif good:
            assert reason in (Reason.REPEAT, Reason.COUNTER, Reason.TWO_SENDERS)
        before = data


FRAMES = st.builds(
    lambda frame: Frame(
        frame.stamp_us,
        frame.can_id if frame.extended or frame.error else frame.can_id & 0x7FF,
        b"" if frame.remote else frame.data if frame.fd else frame.data[:8],
        extended=frame.extended and not frame.error,
        remote=frame.remote,
        error=frame.error,
        fd=frame.fd and not frame.remote,
    ),
    any_frames([YAW_RATE_A1, UNMAPPED, 0x800, 0x1FFFFFFF]),
)


@given(FRAMES, st.from_regex(r"[a-z0-9_.-]{1,15}", fullmatch=True))
def test_candump_line_is_read_as_written(frame: Frame, channel: str) -> None:
    assert parse_line(format_line(frame, channel).encode()) == (frame, channel)


@example(b"(1700000000.000001) can0 FFF#")
@given(st.binary(max_size=120) | st.builds(format_line, FRAMES, st.just("can0")).flatmap(lambda s: damaged(s.encode())))
def test_line_of_any_bytes_is_a_possible_frame_or_none(line: bytes) -> None:
    found = parse_line(line)
    if found is not None:
        frame = found[0]
        assert 0 <= frame.can_id <= (0x1FFFFFFF if frame.extended or frame.error else 0x7FF)
        assert len(frame.data) <= (64 if frame.fd else 8)
        assert frame.stamp_us >= 0 or b"(-" in line
