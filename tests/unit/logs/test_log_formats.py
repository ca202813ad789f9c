"""Logs of python-can's formats: read as they were written; where its readers fail, what came before is used."""

import gzip
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from tests.support.can_ids import YAW_RATE_A1
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.reader import _errors, log_suffix, read_log, read_stretches
from wrcd.logs.time_order import frames_of

FRAMES = 400
START_S = 1_700_000_000
FORMATS = (".asc", ".blf", ".trc", ".csv", ".db", ".mf4")
WRITTEN = [
    (YAW_RATE_A1 if k % 2 else 0x18FF0102, not k % 2, bytes((k * 7 + i) % 256 for i in range(8))) for k in range(FRAMES)
]
HEAD = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"


def messages() -> list[can.Message]:
    return [
        can.Message(
            timestamp=START_S + k * 0.005, arbitration_id=number, data=data, is_extended_id=extended, channel=0
        )
        for k, (number, extended, data) in enumerate(WRITTEN)
    ]  # fmt: skip


def write(path: Path) -> Path:
    """By python-can's own writers; a .blf with many small containers."""
    with can.BLFWriter(path) if path.suffix == ".blf" else can.Logger(path) as logger:
        if isinstance(logger, can.BLFWriter):
            logger.max_container_size = 1024
        for message in messages():
            logger.on_message_received(message)
        while isinstance(logger, can.SqliteWriter) and logger.num_frames < FRAMES:
            time.sleep(0.01)  # what its thread has not written is lost when it stops
    return path


def write_candump(path: Path) -> Path:
    lines = (f"({m.timestamp:.6f}) can0 {m.arbitration_id:03X}#{m.data.hex()}\n" for m in messages())
    path.write_text("".join(lines))
    return path


def read(path: Path) -> tuple[list[Frame], Damage]:
    damage = Damage()
    return [f for f, _ in read_log(path, damage)], damage


def content(frames: list[Frame]) -> list[tuple[int, bool, bytes]]:
    return [(f.can_id, f.extended, f.data) for f in frames]


@pytest.mark.parametrize("suffix", [*FORMATS, ".asc.gz", ".blf.gz", ".mf4.gz"])
def test_frames_of_a_format_are_those_that_were_written(suffix: str, tmp_path: Path) -> None:
    log = write(tmp_path / f"a{suffix.removesuffix('.gz')}")
    if suffix.endswith(".gz"):
        packed = tmp_path / f"a.b{suffix}"
        packed.write_bytes(gzip.compress(log.read_bytes()))
        log = packed
    found, damage = read(log)
    assert content(found) == WRITTEN
    assert [w for w in damage.warnings(log) if "local time" not in w] == []
    begin_us = 0 if suffix.startswith(".asc") else START_S * 1_000_000
    assert max(abs(f.stamp_us - begin_us - 5000 * k) for k, f in enumerate(found)) <= 1


def garbled(whole: bytes) -> bytes:
    """The end of a line in the middle is no data."""
    lines = whole.splitlines(keepends=True)
    k = len(lines) // 2
    return b"".join((*lines[:k], lines[k].rstrip()[:-2] + b"??\n", *lines[k + 1 :]))


def overwritten(whole: bytes) -> bytes:
    middle = len(whole) // 2
    return whole[:middle] + b"?" * 64 + whole[middle + 64 :]


def cut(whole: bytes) -> bytes:
    return whole[: len(whole) // 2]


@pytest.mark.parametrize(
    ("suffix", "change", "said"),
    [
        (".asc", garbled, r"invalid literal for int\(\) with base 16"),
        (".trc", garbled, "non-hexadecimal number found"),
        (".csv", garbled, "Incorrect padding"),
        (".blf", overwritten, "while decompressing data"),
        (".db", overwritten, "database disk image is malformed"),
        (".csv", cut, "not enough values to unpack"),
        (".asc.gz", cut, "Compressed file ended before"),
    ],
)
def test_damage_that_python_can_notices_ends_the_reading_with_its_words_and_exit_1(
    suffix: str, change: Callable[[bytes], bytes], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write(tmp_path / f"a{suffix}")
    log.write_bytes(change(log.read_bytes()))
    found, damage = read(log)
    assert FRAMES // 8 < len(found) < FRAMES
    assert content(found) == WRITTEN[: len(found)]
    (warning,) = damage.warnings(log)
    assert re.match(rf"{log}: .*frame {len(found)} .*{said}", warning)
    assert main(["dump", str(log)]) == 1
    assert capsys.readouterr().err == f"wrcd: warning: {warning}\n"
    assert main(["replay", str(log), "--csv", str(tmp_path / "b.csv")]) == 3  # none of them passes its checks
    assert f"wrcd: warning: {warning}" in capsys.readouterr().err


def run_dump(log: Path) -> "subprocess.CompletedProcess[str]":
    """In a process of its own: asammdf leaves an exception to the garbage collector."""
    command = [sys.executable, "-m", "wrcd.cli", "dump", str(log)]
    env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH" or log.suffix != ".mf4"}
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=env)


def test_object_of_length_0_ends_the_reading_of_a_blf(tmp_path: Path) -> None:
    """python-can's own reader never ends there."""
    log = tmp_path / "a.blf"
    with can.BLFWriter(log, compression_level=0) as logger:
        for message in messages():
            logger.on_message_received(message)
    whole = bytearray(log.read_bytes())
    places = [m.start() for m in re.finditer(b"LOBJ", whole)]
    whole[places[301] + 8 : places[301] + 12] = bytes(4)  # the first is the container
    log.write_bytes(whole)
    done = run_dump(log)
    assert done.returncode == 1
    assert len(done.stdout.splitlines()) == 300
    assert "an object of length 0" in done.stderr


@pytest.mark.parametrize(
    ("suffix", "said"), [(".db", "database disk image is malformed"), (".mf4", "unpack requires a buffer of")]
)
def test_log_that_python_can_cannot_open_is_refused_with_its_words(suffix: str, said: str, tmp_path: Path) -> None:
    log = write(tmp_path / f"a{suffix}")
    log.write_bytes(cut(log.read_bytes()))
    done = run_dump(log)
    assert done.returncode == 2
    assert f"wrcd: error: {log}: cannot be read: {said}" in done.stderr
    assert done.stdout == ""


def test_line_of_a_trc_that_python_can_skips_is_damage(tmp_path: Path) -> None:
    """It only logs it, and goes on."""
    log = write(tmp_path / "a.trc")
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join((*lines[:-2], b"rubbish\n", *lines[-2:])))
    done = run_dump(log)
    assert done.returncode == 1
    assert len(done.stdout.splitlines()) == FRAMES
    assert done.stderr == f"wrcd: warning: {log}: 1 damaged line left out, after frame {FRAMES - 2}\n"


@pytest.mark.parametrize(
    "row",
    [
        "1700000000.1,0x800,0,0,0,1,AA==",
        "1700000000.1,0x101,0,0,0,9,AAAAAAAAAAAA",
        "1e300,0x101,0,0,0,1,AA==",
        "1e12,0x101,0,0,0,1,AA==",
        "nan,0x101,0,0,0,1,AA==",
    ],
)
def test_frame_that_there_cannot_be_ends_the_reading(row: str, tmp_path: Path) -> None:
    log = tmp_path / "a.csv"
    good = "1700000000.0,0x101,0,0,0,1,AA==\n"
    log.write_text(f"{HEAD}{good}{row}\n{good}")
    found, damage = read(log)
    assert [f.stamp_us for f in found] == [START_S * 1_000_000]
    (warning,) = damage.warnings(log)
    assert f"{log}: read up to frame 1 only" in warning
    log.write_text(f"{HEAD}{row}\n")
    with pytest.raises(InputError, match=re.escape(str(log))):
        read(log)


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


@pytest.mark.parametrize("kind", ["relative", "Relative"])
def test_asc_with_stamps_from_line_to_line_is_refused(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write(tmp_path / "a.asc")
    text = log.read_text()
    log.write_text(text.replace("timestamps absolute", f"timestamps {kind}"))
    assert log.read_text() != text
    assert main(["replay", str(log), "--csv", str(tmp_path / "a.csv")]) == 2
    assert f"wrcd: error: {log}: " in capsys.readouterr().err
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.parametrize(
    ("name", "suffix"),
    [("x.log.blf", ".blf"), ("x.blf.log", ".log"), ("X.ASC.gz", ".asc"), ("x.log.gz", ".log"), ("x.v1.2.trc", ".trc")],
)
def test_last_suffix_tells_the_format(name: str, suffix: str, tmp_path: Path) -> None:
    assert log_suffix(Path(name)) == suffix
    whole = (write_candump if suffix == ".log" else write)(tmp_path / f"plain{suffix}").read_bytes()
    log = tmp_path / name
    log.write_bytes(gzip.compress(whole) if name.endswith(".gz") else whole)
    found, damage = read(log)
    assert content(found) == WRITTEN
    assert damage.whole


@pytest.mark.parametrize("suffix", [*FORMATS, ".log"])
def test_log_named_as_another_format_gives_no_frame(suffix: str, tmp_path: Path) -> None:
    whole = (write_candump if suffix == ".log" else write)(tmp_path / f"plain{suffix}").read_bytes()
    packed = gzip.compress(whole)
    named = {"": whole, ".txt": whole, suffix: packed, f"{suffix}.gz": whole}
    named |= {name: held for name in (*FORMATS, ".log") if name != suffix for held in (packed, whole)}
    for name, held in named.items():
        if name.startswith(".mf4"):
            continue
        log = tmp_path / f"a{name}"
        log.write_bytes(held)
        for reader in (read_log, read_stretches):
            with pytest.raises(InputError, match=re.escape(str(log))):
                list(reader(log, Damage()))


def test_log_of_another_format_named_mf4_is_refused(tmp_path: Path) -> None:
    log = write_candump(tmp_path / "a.mf4")
    done = run_dump(log)
    assert done.returncode == 2
    assert f"wrcd: error: {log}: cannot be read: " in done.stderr


def test_file_that_fails_asks_for_rights_and_what_finds_no_memory_is_not_damage() -> None:
    with pytest.raises(InputError, match="check the path and your rights"), _errors(Path("a.asc"), Damage(), Exception):
        raise PermissionError(13, "Permission denied")
    with pytest.raises(MemoryError), _errors(Path("a.asc"), Damage(), Exception):
        raise MemoryError


ASC_HEAD = (
    "date Thu Apr 16 01:59:01.000 pm 2020\nbase hex  timestamps absolute\ninternal events logged\n// version 11.0.0\n"
    "Begin TriggerBlock Thu Apr 16 01:59:01.000 pm 2020\n"
)
ASC_FRAMES = "".join(f"   {k / 1000:.6f} 1  101             Rx   d 2 0A {k:02X}\n" for k in range(1, 6))
ASC_HEADS = {
    "start": ASC_HEAD + "   0.000000 Start of measurement\n",
    "FD start (python-can #1786)": ASC_HEAD + "   0.000000 CANFD   Start of measurement\n",
    "German start": ASC_HEAD + "   0.000000 Start der Messung\n",
    # BUSMASTER's (can-utils #348)
    "short": "date Mon Dec 6 11:21:13 am 2021\nbase hex  no internal events logged\n// version 7.1.0\n",
    "no events": "date Mon Dec 6 11:21:13 am 2021\nbase hex  timestamps absolute\nno internal events logged\n",
    "nothing": "",
}


@pytest.mark.parametrize("mark", ["", "\ufeff"], ids=["", "byte order mark"])
@pytest.mark.parametrize("head", ASC_HEADS)
def test_every_frame_of_an_asc_is_read_whatever_its_head(head: str, mark: str, tmp_path: Path) -> None:
    log = tmp_path / "a.asc"
    log.write_text(mark + ASC_HEADS[head] + ASC_FRAMES, encoding="utf-8")
    found, damage = read(log)
    assert [f.data[1] for f in found] == [1, 2, 3, 4, 5]
    assert damage.warnings(log) == []


@pytest.mark.parametrize("suffix", [".log", ".log.gz", ".trc", ".csv"])
def test_byte_order_mark_costs_no_frame(suffix: str, tmp_path: Path) -> None:
    plain = tmp_path / f"plain{suffix.removesuffix('.gz')}"
    whole = (write_candump(plain) if suffix.startswith(".log") else write(plain)).read_bytes()
    log = tmp_path / f"a{suffix}"
    marked = b"\xef\xbb\xbf" + whole
    log.write_bytes(gzip.compress(marked) if suffix.endswith(".gz") else marked)
    found, damage = read(log)
    assert content(found) == WRITTEN
    assert damage.warnings(log) == []
    at_once = [f for item in read_stretches(log, Damage()) for f, _ in frames_of(item)]
    assert content(at_once) == WRITTEN


def test_the_datas_own_length_counts_where_the_dlc_is_a_code(tmp_path: Path) -> None:
    """DLC 9 … 15 of classical frames (eight bytes) and of PEAK's FD logs (12 … 64), python-can #1245, #1299, #1824."""
    lengths = (12, 16, 20, 24, 32, 48, 64)
    fd = [f"{k + 1:7d} {k:13.3f} FD 1      0300 Rx -  {9 + k}   {'5A ' * n}" for k, n in enumerate(lengths)]
    trc = tmp_path / "a.trc"
    trc.write_text(";$FILEVERSION=2.1\n;$STARTTIME=46062.4524670150\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n" + "\n".join(fd))
    found, damage = read(trc)
    assert [(f.fd, f.data) for f in found] == [(True, b"\x5a" * n) for n in lengths]
    assert damage.whole
    asc = tmp_path / "a.asc"
    classical = [f"   1.0000{k:02d} 1  221  Rx   d {k:X} 00 11 22 33 44 55 66 77\n" for k in range(9, 16)]
    asc.write_text(ASC_HEADS["start"] + "".join(classical))
    candump = tmp_path / "a.log"
    candump.write_text("".join(f"(1.{k:06d}) can0 221#0011223344556677_{k:X}\n" for k in range(9, 16)))
    for log in (asc, candump):
        found, damage = read(log)
        assert [(f.fd, f.data.hex()) for f in found] == [(False, "0011223344556677")] * 7
        assert damage.whole


def test_stamps_before_the_begin_of_a_blf_are_read_with_their_sign(tmp_path: Path) -> None:
    """The part before a trigger: python-can reads it as the year 2608 (PR 2101)."""
    log = tmp_path / "a.blf"
    with can.BLFWriter(log, compression_level=0) as logger:
        for message in messages()[:6]:
            logger.on_message_received(message)
    whole = bytearray(log.read_bytes())
    for k, place in enumerate([m.start() for m in re.finditer(b"LOBJ", whole)][1:4]):
        whole[place + 24 : place + 32] = (2**64 - 1_000_000_000 + k * 5_000_000).to_bytes(8, "little")
    log.write_bytes(whole)
    found, _ = read(log)
    expected = [START_S * 1_000_000 + us for us in (-1_000_000, -995_000, -990_000, 15_000, 20_000, 25_000)]
    assert [f.stamp_us for f in found] == pytest.approx(expected, abs=5)


def test_group_of_error_frames_that_nobody_can_read_costs_no_data_frame(tmp_path: Path) -> None:
    """python-can #1913: it lacks the parts that an error frame has."""
    from asammdf import MDF, Signal
    from asammdf.blocks.v4_blocks import SourceInformation

    log, odd = write(tmp_path / "a.mf4"), tmp_path / "odd.mf4"
    with MDF(log) as mdf:
        source = SourceInformation(source_type=2, bus_type=2)
        kind = np.dtype([("CAN_ErrorFrame.ID", "S3")])
        samples = np.array([(b"abc",)] * 3, kind)
        mdf.append(Signal(samples, np.array([0.1, 0.2, 0.3]), name="CAN_ErrorFrame", source=source))
        group: Any = mdf.groups[-1]
        group.channel_group.flags |= 2  # a bus event
        mdf.save(odd, overwrite=True)
    found, damage = read(odd)
    assert content(found) == WRITTEN
    warning, _ = damage.warnings(odd)
    assert "left out a group of error frames" in warning


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("a.log", "a .log is read as candump -l or -L writes it: (1700000000.000000) can0 101#0011"),
        ("a.asc", "a .asc is read as Vector's text, by python-can; the suffix tells the format"),
        ("a.trc.gz", "a .trc is read as PEAK's text, by python-can; the suffix tells the format"),
        ("a.docx", "the suffix tells the format: .log, .asc, .blf, .trc, .csv, .db, .mf4"),
    ],
)
def test_hint_is_of_the_format_that_the_suffix_tells(name: str, hint: str, tmp_path: Path) -> None:
    log = tmp_path / name
    log.write_bytes(gzip.compress(b"nothing\n") if name.endswith(".gz") else b"nothing\n")
    with pytest.raises(InputError, match=re.escape(hint)):
        read(log)


@pytest.mark.parametrize("kind", ["CAN_DataFrame", "CAN_RemoteFrame"])
def test_bit_31_tells_long_ids_of_an_mf4_without_ide(kind: str, tmp_path: Path) -> None:
    """asammdf #905: Vector's tools write no such member, and python-can drops the bit."""
    from asammdf import MDF, Signal
    from asammdf.blocks.v4_blocks import SourceInformation

    fields: list[Any] = [(f"{kind}.ID", "<u4"), (f"{kind}.DLC", "u1"), (f"{kind}.DataLength", "u1")]
    samples = np.zeros(
        2500, np.dtype([*fields, (f"{kind}.DataBytes", "u1", (8,))])
    )  # more than python-can takes at once
    samples[f"{kind}.ID"] = [0x101 | (k % 2) << 31 for k in range(len(samples))]
    log = tmp_path / "a.mf4"
    with MDF(version="4.10") as mdf:
        source = SourceInformation(source_type=2, bus_type=2)
        mdf.append(Signal(samples, np.arange(len(samples)) * 0.001, name=kind, source=source))
        group: Any = mdf.groups[-1]
        group.channel_group.flags |= 2  # a bus event
        mdf.save(log, overwrite=True)
    found, _ = read(log)
    assert [(f.can_id, f.extended) for f in found] == [(0x101, bool(k % 2)) for k in range(len(samples))]


@pytest.mark.parametrize("zone", ["Asia/Shanghai", "America/New_York"])
def test_stamps_of_the_rigs_mf4_are_the_same_in_every_zone(zone: str, tmp_path: Path) -> None:
    """asammdf #756: a begin in local time is another moment elsewhere. python-can's own logs have one, and that is
    said."""
    log, local = tmp_path / "a.mf4", tmp_path / "local.mf4"
    code = (
        "import sys, can; from pathlib import Path; from sim_ecu.play.logs import open_logger\n"
        "frame = can.Message(timestamp=1.7e9, arbitration_id=0x101, data=bytes(8), is_extended_id=False)\n"
        "with open_logger(Path(sys.argv[1])) as log: log.on_message_received(frame)\n"
        "with can.Logger(sys.argv[2]) as log: log.on_message_received(frame)\n"
    )
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {"TZ": zone}
    subprocess.run([sys.executable, "-c", code, log, local], env=env, check=True)
    found, damage = read(log)
    assert found[0].stamp_us == pytest.approx(START_S * 1_000_000, abs=2)
    assert damage.warnings(log) == []
    _, damage = read(local)
    assert damage.warnings(local) == [f"{local}: its begin is in local time, which is taken for this computer's"]


@pytest.mark.parametrize(
    "text", ["Time Stamp,ID,Extended,Dir,Bus,LEN\n973,00000080,false,Rx,0,0\n", "1.0,0x101,0,0,0,8,\n"]
)
def test_csv_of_somebody_else_is_refused(text: str, tmp_path: Path) -> None:
    """SavvyCAN #1068: python-can skips the first line unread, and takes what follows for its own."""
    log = tmp_path / "a.csv"
    log.write_text(text)
    with pytest.raises(InputError, match="is none of python-can's, whose first line is timestamp,arbitration_id,"):
        read(log)


@pytest.mark.parametrize(
    "head",
    [
        "\ndate Mon Dec 6 11:21:13 am 2021\n\nbase dec  timestamps absolute\n",
        "; of a logger\nbase DEC  timestamps absolute\ninternal events logged\n",
        "base dec\n",
    ],
)
def test_base_of_an_asc_counts_wherever_it_stands(head: str, tmp_path: Path) -> None:
    """python-can #1169, with lines that end its header."""
    log = tmp_path / "a.asc"
    log.write_text(f"{head}   1.000000 1  257             Rx   d 2 10 255\n")
    (frame,), damage = read(log)
    assert (frame.can_id, frame.data) == (0x101, bytes([10, 255]))
    assert damage.warnings(log) == []
    log.write_text(
        log.read_text().replace("absolute", "relative").replace("base dec\n", "base dec  timestamps relative\n")
    )
    with pytest.raises(InputError, match="timestamps relative"):
        read(log)


def test_error_objects_that_python_can_leaves_out_are_counted(tmp_path: Path) -> None:
    """python-can #1586: CAN_ERROR and CAN_OVERLOAD, in containers that end within an object."""
    log = tmp_path / "a.blf"
    with can.BLFWriter(log, compression_level=0, max_container_size=1000) as logger:
        for message in messages():
            logger.on_message_received(message)
    whole = bytearray(log.read_bytes())
    places = [m.start() for m in re.finditer(b"LOBJ", whole) if whole[m.start() + 12] != 10]  # 10: a container
    changed = places[10:210:10]
    for k, place in enumerate(changed):
        whole[place + 12 : place + 16] = (2 + k % 2).to_bytes(4, "little")
    log.write_bytes(whole)
    found, damage = read(log)
    assert len(found) == FRAMES - len(changed)
    assert damage.warnings(log) == [
        f"{log}: left out 20 error or overload frames of kinds that python-can does not read"
    ]
