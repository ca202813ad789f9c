"""The ring of frames that the recorder keeps, as the process that writes a dump reads it."""

import pytest

from tests.support.can_ids import UNMAPPED, YAW_RATE_A1
from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.recorder.ring import CLASSICAL_BYTES, FD_BYTES, RECEIVED, SENT, Overwritten, Ring, read_ring

KINDS = [
    Frame(0, UNMAPPED, b""),
    Frame(1, 0x1FFFFFFF, b"12345678", extended=True),
    Frame(2, 0x40, bytes(8), error=True),
    Frame(3, YAW_RATE_A1, b"", remote=True),
]
FD = [Frame(4, YAW_RATE_A1, b"1234", fd=True), Frame(5, 0x18FF0001, bytes(range(60)), extended=True, fd=True)]


def read(ring: Ring, first: int) -> list[tuple[int, Frame]]:
    return list(read_ring(ring.fd, ring.data_bytes, first, ring.end))


@pytest.mark.parametrize(("data_bytes", "frames"), [(CLASSICAL_BYTES, KINDS), (FD_BYTES, KINDS + FD)])
def test_every_kind_of_frame_comes_back_over_the_rings_end_too(data_bytes: int, frames: list[Frame]) -> None:
    ring = Ring(10, data_bytes)
    for _ in range(5):
        ring.put_frame(SENT, frames[0])
        ring.put_frames(RECEIVED, frames)
        expected = [(SENT, frames[0]), *((RECEIVED, f) for f in frames)]
        assert read(ring, ring.end - len(expected)) == expected
    assert read(ring, ring.end) == []


def test_batch_is_kept_as_its_frames_and_what_is_overwritten_is_told() -> None:
    ring = Ring(10)
    frames = [Frame(k, k, bytes([k])) for k in range(25)]
    ring.put_frames(RECEIVED, FrameBatch.of(frames[:4]))
    ring.put_frames(RECEIVED, FrameBatch.of(frames[4:]))  # more than it holds
    assert ring.stamp_us(15) == 15
    assert read(ring, 15) == [(RECEIVED, f) for f in frames[15:]]
    copied = read_ring(ring.fd, CLASSICAL_BYTES, 15, 25)
    ring.put_frame(RECEIVED, frames[0])
    assert list(copied) == [(RECEIVED, f) for f in frames[15:]]
    with pytest.raises(Overwritten):
        read(ring, 15)
