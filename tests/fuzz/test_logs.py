"""Whatever a log holds, its frames come out or an InputError says why not."""

import functools
import gzip
import itertools
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz.strategies import EDITS_OF_BYTES, damage, damaged
from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

SUFFIXES = (".asc", ".blf", ".trc", ".csv", ".db")
SENT = [
    Frame(
        1_700_000_000_000_000 + 5_000 * k,
        0x101 + k % 3 if k % 4 else 0x18FF0102,
        bytes(range(k % 9)),
        extended=k % 4 == 0,
    )
    for k in range(20)
]
CANDUMP = "".join(format_line(f, "can0") + "\n" for f in SENT).encode()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs")


@functools.cache
def written(folder: Path, suffix: str) -> bytes:
    """A small log in one of python-can's formats."""
    path = folder / f"good{suffix}"
    with can.Logger(path) as logger:
        for f in SENT:
            logger.on_message_received(
                can.Message(
                    timestamp=f.stamp_us * 1e-6, arbitration_id=f.can_id, data=f.data, is_extended_id=f.extended
                )
            )
    assert len(list(read_log(path, Damage()))) == len(SENT)
    return path.read_bytes()


def judge(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    seen = Damage()
    count = 0
    try:
        # a damaged count of frames must not keep the test for ever; a log of this size holds fewer
        for frame, channel in itertools.islice(read_log(path, seen), 10_000):
            count += 1
            assert isinstance(frame.stamp_us, int)
            assert 0 <= frame.can_id <= 0x1FFFFFFF
            assert isinstance(frame.data, bytes)
            assert len(frame.data) <= 64
            assert channel or path.suffix != ".log"
    except InputError:
        assert not count
        return
    assert 0 < count < 10_000
    assert seen.read == count
    assert all(str(path) in warning for warning in seen.warnings(path))


@given(content=damaged(CANDUMP) | st.binary(max_size=300))
def test_damaged_candump_log_is_read_or_rejected(folder: Path, content: bytes) -> None:
    judge(folder / "a.log", content)


@given(content=damaged(gzip.compress(CANDUMP, mtime=0)) | damaged(CANDUMP).map(gzip.compress) | st.binary(max_size=100))
def test_damaged_gzip_log_is_read_or_rejected(folder: Path, content: bytes) -> None:
    judge(folder / "a.log.gz", content)


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(edits=EDITS_OF_BYTES | st.binary(max_size=100))
def test_damaged_python_can_log_is_read_or_rejected(
    folder: Path, suffix: str, edits: list[tuple[str, int, bytes]] | bytes
) -> None:
    judge(folder / f"a{suffix}", edits if isinstance(edits, bytes) else damage(written(folder, suffix), edits))
