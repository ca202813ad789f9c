"""Logs of python-can's formats, whole, cut and damaged: what is lost is told, and after which frame."""

import gzip
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from tests.support.can_ids import YAW_RATE_A1
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.logs.damage import Damage
from wrcd.logs.reader import log_suffix, read_log

FRAMES = 400
START_S = 1_700_000_000
TEXT = (".asc", ".trc", ".csv")


def write(path: Path, count: int = FRAMES, channel: int = 0) -> Path:
    with can.Logger(path) as logger:
        for k in range(count):
            logger.on_message_received(
                can.Message(
                    timestamp=START_S + k * 0.005, arbitration_id=YAW_RATE_A1 if k % 2 else 0x18FF0102,
                    data=bytes((k * 7 + i) % 256 for i in range(8)), is_extended_id=not k % 2, channel=channel,
                )
            )  # fmt: skip
    return path


def read(path: Path) -> tuple[list[Frame], Damage]:
    damage = Damage()
    return [f for f, _ in read_log(path, damage)], damage


def write_blf(path: Path, compression: int) -> bytes:
    """With many small containers."""
    with can.BLFWriter(path, compression_level=compression) as logger:
        logger.max_container_size = 1024
        for k in range(FRAMES):
            logger.on_message_received(can.Message(timestamp=START_S + k * 0.005, arbitration_id=k, data=bytes(8)))
    return path.read_bytes()


@pytest.mark.parametrize("suffix", [*TEXT, ".blf"])
def test_whole_log_is_read_without_a_word(suffix: str, tmp_path: Path) -> None:
    log = write(tmp_path / f"a{suffix}")
    found, damage = read(log)
    assert [f.data[0] for f in found] == [k * 7 % 256 for k in range(FRAMES)]
    assert [f.extended for f in found] == [not k % 2 for k in range(FRAMES)]
    assert damage.whole
    assert damage.warnings(log) == []


@pytest.mark.parametrize("suffix", [".asc", ".trc", ".blf", ".csv", ".log"])
def test_half_a_log_is_told_with_its_last_frame_and_exit_1(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = write(tmp_path / f"whole{suffix}").read_bytes()
    log = tmp_path / f"half{suffix}"
    log.write_bytes(whole[: len(whole) // 2 + 3])
    found, damage = read(log)
    assert not damage.whole
    assert FRAMES // 3 < len(found) < 2 * FRAMES // 3
    (warning,) = damage.warnings(log)
    assert re.search(rf"frame {len(found)}\b", warning)
    assert main(["dump", str(log)]) == 1
    assert f"wrcd: warning: {warning}" in capsys.readouterr().err
    assert main(["replay", str(log), "--csv", str(tmp_path / "a.csv")]) == 3  # none of them passes its checks
    assert f"wrcd: warning: {warning}" in capsys.readouterr().err


def test_asc_cut_between_two_lines_is_told(tmp_path: Path) -> None:
    lines = write(tmp_path / "whole.asc").read_bytes().splitlines(keepends=True)
    log = tmp_path / "half.asc"
    log.write_bytes(b"".join(lines[: len(lines) // 2]))
    found, damage = read(log)
    assert damage.warnings(log) == [f"{log}: read up to frame {len(found)} only: its trigger block has no end: cut off"]


@pytest.mark.parametrize("suffix", TEXT)
@pytest.mark.parametrize(
    "change",
    [
        lambda line: line[: len(line) // 2].rstrip() + b"\n",
        lambda line: line.replace(b"8", b"\xff").replace(b"R", b"?"),
        lambda _: b"\x00\x01\x02\x03\n",
        lambda _: b"rubbish\n",
    ],
)
def test_damaged_lines_of_a_text_are_left_out_and_named(
    suffix: str, change: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    log = write(tmp_path / f"a{suffix}")
    lines = log.read_bytes().splitlines(keepends=True)
    first = 101
    for k in (first, first + 50):
        lines[k] = change(lines[k])
    log.write_bytes(b"".join(lines))
    found, damage = read(log)
    assert damage.lines == [first + 1, first + 51]
    assert len(found) == FRAMES - 2
    assert 50 < damage.after < 101
    assert not damage.whole


def test_asc_events_that_are_no_frames_are_no_damage(tmp_path: Path) -> None:
    log = tmp_path / "a.asc"
    log.write_bytes(
        "date Mit Mär 6 10:21:44 2024\nbase hex  timestamps absolute\ninternal events logged\n// version 13.0.0\n"
        "Begin Triggerblock Mit Mär 6 10:21:44 2024\n   0.000000 Start of measurement\n"
        "   0.001000 CAN 1 Status:chip status error active\n"
        "   0.002000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n"
        "   0.003000 1  ErrorFrame\n   0.004000 1  101             Rx   d 2 0A 0B  Length = 0 BitCount = 0 ID = 257\n"
        "   0.005000 SV: 1 0 1 ::Sys::Value = 1\n   0.006000 2  18FF0102x       Rx   r\n"
        "   0.007000 log trigger event\n\nEnd TriggerBlock\n".encode("latin-1")
    )
    found, damage = read(log)
    assert damage.warnings(log) == []
    assert [(f.stamp_us, f.data.hex(), f.error, f.remote) for f in found] == [
        (3000, "", True, False), (4000, "0a0b", False, False), (6000, "", False, True)
    ]  # fmt: skip


def test_damaged_place_of_a_blf_ends_the_reading_with_its_frame(tmp_path: Path) -> None:
    whole = bytearray(write_blf(tmp_path / "whole.blf", -1))
    whole[len(whole) // 2] ^= 0xFF
    log = tmp_path / "a.blf"
    log.write_bytes(whole)
    found, damage = read(log)
    assert not damage.whole
    assert 150 < len(found) < 250
    assert damage.warnings(log)[0].startswith(f"{log}: read up to frame {len(found)} only: ")


@pytest.mark.parametrize("size", [b"\xff\xff\xff\x00", b"\x00\x00\x00\x00", b"\x11\x00\x00\x00"])
def test_wrong_size_of_an_object_in_a_blf_is_told(size: bytes, tmp_path: Path) -> None:
    whole = bytearray(write_blf(tmp_path / "whole.blf", 0))
    objects = [m.start() for m in re.finditer(b"LOBJ", whole)]
    whole[objects[200] + 8 : objects[200] + 12] = size
    log = tmp_path / "a.blf"
    log.write_bytes(whole)
    found, damage = read(log)
    assert not damage.whole
    assert 190 <= len(found) <= 201
    assert f"frame {len(found)} only" in damage.warnings(log)[0]


@pytest.mark.parametrize(
    ("name", "suffix"),
    [("x.log.blf", ".blf"), ("x.blf.log", ".log"), ("X.ASC.gz", ".asc"), ("x.log.gz", ".log"), ("x.v1.2.trc", ".trc")],
)
def test_last_suffix_tells_the_format(name: str, suffix: str, tmp_path: Path) -> None:
    assert log_suffix(Path(name)) == suffix
    whole = write(tmp_path / f"plain{suffix}")
    log = tmp_path / name
    if name.endswith(".gz"):
        log.write_bytes(gzip.compress(whole.read_bytes()))
    else:
        shutil.copy(whole, log)
    found, damage = read(log)
    assert len(found) == FRAMES
    assert damage.whole


def test_truncated_gzip_is_told_with_its_last_frame(tmp_path: Path) -> None:
    whole = gzip.compress(write(tmp_path / "whole.asc").read_bytes())
    log = tmp_path / "a.asc.gz"
    log.write_bytes(whole[: len(whole) // 2])
    found, damage = read(log)
    assert found
    assert f"{log}: read up to frame {len(found)} only: damaged there" in damage.warnings(log)[-1]


@pytest.mark.parametrize("stamp", ["1e300", "1e12", "-1e12"])
def test_stamp_beyond_all_calendars_is_a_damaged_line(tmp_path: Path, stamp: str) -> None:
    log = tmp_path / "x.csv"
    rows = [f"{s},0x100,0,0,0,1,AA==" for s in ("1.0", stamp, "1.1")]
    log.write_text("\n".join(["timestamp,arbitration_id,extended,remote,error,dlc,data", *rows, ""]))
    frames, damage = read(log)
    assert [f.stamp_us for f in frames] == [1_000_000, 1_100_000]
    assert (damage.bad, damage.lines) == (1, [3])
