from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrcd.bus.candump import format_line, parse_line
from wrcd.bus.frame import Frame
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

GOOD = [
    "(1700000000.000001) can0 091#0011223344556677",
    "(1700000000.010000) can0 12345678#",
    "(1700000000.020000) vcan1 101#R",
]
frames = st.builds(
    lambda stamp, extended, number, data: Frame(stamp, number if extended else number & 0x7FF, data, extended=extended),
    st.integers(-10_000_000_000_000_000, 10_000_000_000_000_000),
    st.booleans(),
    st.integers(0, 0x1FFFFFFF),
    st.binary(max_size=8),
)


def read(path: Path) -> tuple[list[Frame], Damage]:
    damage = Damage()
    return [f for f, _ in read_log(path, damage)], damage


@given(frames)
def test_written_line_is_read_as_the_same_frame(frame: Frame) -> None:
    assert parse_line(format_line(frame, "can0").encode()) == (frame, "can0")


@given(st.binary(max_size=80))
def test_line_of_any_bytes_is_a_frame_or_none(line: bytes) -> None:
    found = parse_line(line)
    assert found is None or len(found[0].data) <= 64


def test_fd_error_and_direction_lines_are_read() -> None:
    fd = parse_line(b"(1700000000.000001) can0 091##100112233445566778899AABB")
    assert fd is not None
    assert fd[0].fd
    error = parse_line(b"(1700000000.000001) can0 20000040#0000000000000000")
    assert error is not None
    assert error[0].error
    assert error[0].can_id == 0x40
    with_direction = parse_line(b"(1700000000.000001) can0 091#00 T")
    assert with_direction is not None
    assert with_direction[0].data == b"\0"
    # three digits, but more than the eleven bits of a standard id
    assert parse_line(b"(1700000000.000001) can0 800#00") is None


@pytest.mark.parametrize(
    ("line", "data", "extra"),
    [
        ("091#0011223344556677_9", bytes.fromhex("0011223344556677"), 9),
        ("091#0011223344556677_F", bytes.fromhex("0011223344556677"), 15),
        ("091#R", b"", 0),
        ("091#R8", b"", 8),
        ("12345678#R5", b"", 5),
        ("091#R8_C", b"", 12),
        ("091##0AABB", b"\xaa\xbb", 0),
        ("091##5AABB", b"\xaa\xbb", 5),
        ("091##7" + "11" * 64, b"\x11" * 64, 7),
    ],
)
@pytest.mark.parametrize("tail", ["", " R", " T"])
@pytest.mark.parametrize(("stamp", "us"), [("1700000000.123456", 123456), ("1700000000.123456999", 123456)])
@pytest.mark.parametrize("channel", ["can0", "   can0"])
def test_newer_forms_of_candump_are_read_and_written_again(
    line: str, data: bytes, extra: int, tail: str, stamp: str, us: int, channel: str
) -> None:
    found = parse_line(f"({stamp}) {channel} {line}{tail}".encode())
    assert found is not None
    frame = found[0]
    assert (frame.stamp_us, frame.data, frame.extra) == (1_700_000_000_000_000 + us, data, extra)
    assert format_line(*found) == f"(1700000000.123456) can0 {line}"


@pytest.mark.parametrize(
    "line", ["091#0011_9", "091#R7_9", "091##000_9", "091#0011223344556677_8", "091##0R", "091#R9"]
)
def test_forms_that_candump_never_writes_are_no_frames(line: str) -> None:
    assert parse_line(f"(1700000000.123456) can0 {line}".encode()) is None


def test_frames_that_candump_itself_lost_are_told_and_no_damage(tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    dropped = [f"DROPCOUNT: dropped {n} CAN frame{s} on 'can0' socket (total drops 9)" for n, s in ((8, "s"), (1, ""))]
    log.write_text("\n".join([GOOD[0], *dropped, GOOD[1]]) + "\n")
    found, damage = read(log)
    assert len(found) == 2
    assert damage.whole
    assert damage.warnings(log) == [f"{log}: its recorder says that it lost 9 frames"]


@pytest.mark.parametrize("name", ["nowhere.log", "nowhere.asc", "nowhere.db", "nowhere.mf4.gz"])
def test_missing_log_is_an_error_and_is_not_made(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such log"):
        read(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_file_of_which_nothing_can_be_read_is_an_error(tmp_path: Path) -> None:
    log = tmp_path / "a.blf"
    log.write_text("this is no BLF file at all")
    with pytest.raises(InputError, match=rf"{log}: cannot be read: "):
        read(log)


def test_stamp_before_1970_has_a_sign() -> None:
    for stamp_us, text in (
        (-2_480_000, "(-0000000002.480000)"),
        (-1, "(-0000000000.000001)"),
        (0, "(0000000000.000000)"),
    ):
        line = format_line(Frame(stamp_us, 0x101, b""), "can0")
        assert line == f"{text} can0 101#"
        found = parse_line(line.encode())
        assert found is not None
        assert found[0].stamp_us == stamp_us
