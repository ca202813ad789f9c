import csv
from pathlib import Path

import e2e.p11
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrcd.bus.e2e import COUNTER_MODULO, MOST_LOST, Checker, crc, protect
from wrcd.bus.reasons import Reason

VECTORS = Path(__file__).parents[1] / "data" / "e2e_profile11_vectors.csv"


@pytest.mark.parametrize("row", list(csv.DictReader(VECTORS.read_text().splitlines())), ids=lambda r: r["frame_hex"])
def test_known_good_frames(row: dict[str, str]) -> None:
    data, data_id = bytes.fromhex(row["frame_hex"]), int(row["data_id_hex"], 16)
    assert crc(data, data_id) == data[0]
    assert protect(b"\0" + data[1:], data_id, data[1] & 0x0F) == data
    assert Checker(data_id).check(data) is None


def test_a_zero_frame() -> None:
    assert protect(bytes(8), 0x123, 0).hex() == "cc00000000000000"


@given(st.binary(min_size=2, max_size=8), st.integers(0, 0xFFFF), st.integers(0, 14))
def test_agrees_with_the_autosar_package(data: bytes, data_id: int, counter: int) -> None:
    ours = protect(data, data_id, counter)
    theirs = bytearray(ours)
    e2e.p11.e2e_p11_protect(theirs, data_id, increment_counter=False)
    assert ours == bytes(theirs)


@given(st.integers(0, 63))
def test_every_flipped_bit_is_seen(bit: int) -> None:
    good = protect(bytes.fromhex("0000a1b2c3d4e5f6"), 0x91, 3)
    bad = bytearray(good)
    bad[bit // 8] ^= 1 << bit % 8
    assert Checker(0x91).check(bytes(bad)) is Reason.CRC


def test_another_messages_frame_is_refused() -> None:
    assert Checker(0x101).check(protect(bytes(5), 0x102, 0)) is Reason.CRC


@pytest.mark.parametrize("step", range(COUNTER_MODULO))
def test_the_counter(step: int) -> None:
    checker = Checker(0x91)
    assert checker.check(protect(bytes(8), 0x91, 5)) is None
    got = checker.check(protect(bytes(8), 0x91, (5 + step) % COUNTER_MODULO))
    assert got is (Reason.REPEAT if step == 0 else None if step <= MOST_LOST + 1 else Reason.COUNTER)
    # after a gap one frame is refused, the next is good again
    assert checker.check(protect(bytes(8), 0x91, (6 + step) % COUNTER_MODULO)) is None


def test_counter_fifteen_does_not_exist() -> None:
    frame = bytearray(8)
    frame[1] = 0x0F
    frame[0] = crc(frame, 0x91)
    assert Checker(0x91).check(bytes(frame)) is Reason.COUNTER
