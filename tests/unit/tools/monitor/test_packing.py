"""Frames from the reader's process to the screen's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrcd.bus.frame import Frame
from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.packing import FRAMES, HEALTH, Unpacker, frames_message, told

EVERY_KIND = [
    Frame(1_700_000_000_000_001, 0x101, b"\1\2\3"),
    Frame(1_700_000_000_000_002, 0x18FF0001, bytes(8), extended=True),
    Frame(1_700_000_000_000_003, 0x102, b"", remote=True, extra=4),
    Frame(1_700_000_000_000_004, 0x40, bytes(8), error=True),
    Frame(1_700_000_000_000_005, 0x103, bytes(range(8)), fd=True, extra=1),
]
LONG = Frame(1_700_000_000_000_006, 0x104, bytes(range(64)), fd=True, extra=3)


@pytest.mark.parametrize("frames", [[], EVERY_KIND, [*EVERY_KIND, LONG]], ids=["none", "short", "with a long one"])
def test_packed_frames_come_back_as_they_were(frames: list[Frame]) -> None:
    ((kind, width, until_us, body),) = Unpacker().take(frames_message(frames, 17))
    assert (kind, until_us) == (FRAMES, 17)
    assert list(Batch.of_bytes(width, body).frames()) == frames


@given(st.lists(st.integers(1, 200), max_size=40))
def test_stream_cut_anywhere_gives_the_same_messages(sizes: list[int]) -> None:
    stream = frames_message(EVERY_KIND, 5) + told(HEALTH, {"drops": 3}) + frames_message([LONG], 6)
    whole = list(Unpacker().take(stream))
    unpacker, at = Unpacker(), 0
    got: list[tuple[int, int, int, bytes]] = []
    for size in [*sizes, len(stream)]:
        got += unpacker.take(stream[at : at + size])
        at += size
    assert got == whole
    assert [kind for kind, *_ in whole] == [FRAMES, HEALTH, FRAMES]


def test_batch_of_frames_has_zeros_behind_the_data() -> None:
    batch = Batch.of_frames(EVERY_KIND[:1])
    assert batch.data.tolist() == [[1, 2, 3, 0, 0, 0, 0, 0]]
    assert batch.key.dtype == np.int64
