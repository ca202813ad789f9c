"""The ring of frames that the recorder keeps."""

import pytest

from tests.support.can_ids import UNMAPPED, YAW_RATE_A1
from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.recorder.ring import ADVANCED, CLASSICAL_BYTES, FD_BYTES, RECEIVED, SENT, Overwritten, Ring


def test_ring_overwrites_its_oldest_frames() -> None:
    ring = Ring(100)
    for i in range(250):
        ring.put_frame(SENT if i % 2 else RECEIVED, Frame(10**15 + i, i, bytes([i % 256]) * (i % 9)))
    assert not ring.holds(149)
    assert ring.holds(150)
    assert not ring.holds(150, 1)
    with pytest.raises(Overwritten):
        next(ring.since(149))
    assert [(k, f.can_id, f.stamp_us - 10**15, f.data) for k, f in ring.since(150)] == [
        (i % 2, i, i, bytes([i % 256]) * (i % 9)) for i in range(150, 250)
    ]


@pytest.mark.parametrize("data_bytes", [CLASSICAL_BYTES, FD_BYTES])
def test_batch_is_kept_as_its_frames_one_by_one(data_bytes: int) -> None:
    """At the ring's end, too, and where one is longer than the ring."""
    kinds = [Frame(5, 0x40, bytes(8), error=True), Frame(6, 0x1FFFFFFF, b"123", extended=True), Frame(7, 0x101, b"")]
    at_once, one_by_one = Ring(10, data_bytes), Ring(10, data_bytes)
    for frames in (kinds, kinds * 2, kinds, kinds * 9, []):
        at_once.put(ADVANCED, 1)
        one_by_one.put(ADVANCED, 1)
        at_once.put_frames(RECEIVED, FrameBatch.of(frames))
        one_by_one.put_frames(RECEIVED, frames)
        begin = max(0, one_by_one.end - 10)
        assert at_once.end == one_by_one.end
        assert list(at_once.since(begin)) == list(one_by_one.since(begin))


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0, UNMAPPED, b""),
        Frame(1, 0x1FFFFFFF, b"12345678", extended=True),
        Frame(2, 0x40, bytes(8), error=True),
        Frame(3, YAW_RATE_A1, b"", remote=True),
        Frame(4, YAW_RATE_A1, b"1234", fd=True),
    ],
)
def test_ring_keeps_every_frame_type(frame: Frame) -> None:
    ring = Ring(2)
    ring.put_frame(RECEIVED, frame)
    assert list(ring.since(0)) == [(RECEIVED, frame)]


def test_ring_keeps_whole_fd_frames_where_one_is_mapped() -> None:
    ring = Ring(3, FD_BYTES)
    frames = [Frame(k, 0x18FF0001, bytes(range(k, k + 60)), extended=True, fd=True) for k in range(5)]
    for frame in frames:
        ring.put_frame(RECEIVED, frame)
    assert [f for _, f in ring.since(2)] == frames[2:]
