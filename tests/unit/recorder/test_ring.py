"""The ring of frames that the recorder keeps."""

import pytest

from tests.support.can_ids import UNMAPPED, YAW_RATE_A1
from wrcd.bus.frame import Frame
from wrcd.recorder.ring import FD_BYTES, RECEIVED, SENT, Overwritten, Ring


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
