"""`wrcd dump`: which DBC decodes a frame, and what of a frame its line keeps."""

from pathlib import Path

import pytest

from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.cli.main import main

STAMP_US = 1_700_000_000_000_000
DBC = """VERSION ""
BU_: A
BO_ 257 Theirs: 5 A
 SG_ Value : 0|8@1+ (1,0) [0|255] "bar" A
BO_ 2147483905 TheirsExtended: 5 A
 SG_ Value : 0|8@1+ (2,0) [0|510] "bar" A
BO_ 258 Same: 5 A
 SG_ A : 0|16@1+ (1,0) [0|0] "" A
 SG_ B : 8|16@1+ (1,0) [0|0] "" A
"""
SECOND = DBC.replace("Theirs", "Second").replace("BO_ 258", "BO_ 259")
FRAMES = (
    Frame(STAMP_US, 0x101, bytes([7] * 5)),
    Frame(STAMP_US, 0x101, bytes([7] * 5), extended=True),
    Frame(STAMP_US, 0x111, bytes([7] * 5), extended=True),
    Frame(STAMP_US, 0x103, bytes([7] * 5)),
    Frame(STAMP_US, 0x101, b"", remote=True, extra=5),
    Frame(STAMP_US, 0x300, bytes(12), fd=True, extra=3),
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "a.log"
    path.write_text("".join(f"{format_line(f, 'can0')}\n" for f in FRAMES))
    (tmp_path / "own.dbc").write_text(DBC)
    (tmp_path / "second.dbc").write_text(SECOND)
    return path


def test_given_dbc_wins_over_the_packaged_one_by_id_and_kind(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dbcs = [a for name in ("own.dbc", "second.dbc") for a in ("--dbc", str(log.with_name(name)))]
    assert main(["dump", str(log), *dbcs]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith(" 101#0707070707 :: Theirs(Value: 7 bar)")
    assert lines[1].endswith(" 00000101#0707070707 :: TheirsExtended(Value: 14 bar)")
    assert lines[2].endswith(" 00000111#0707070707")  # ours is of another kind
    assert ":: Same: cannot be decoded" in lines[3]  # its signals overlap


def test_line_keeps_remote_length_and_fd_flags(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dump", str(log)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert ":: YawRate_A1(" in lines[0]
    assert lines[4] == "(1700000000.000000) can0 101#R5 :: YawRate_A1: remote frame"
    assert lines[5] == f"(1700000000.000000) can0 300##3{'00' * 12}"


def test_frames_are_selected_by_axle_message_and_id(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def ids(*options: str) -> list[str]:
        assert main(["dump", str(log), *options]) == 0
        return [line.split()[2].partition("#")[0] for line in capsys.readouterr().out.splitlines()]

    assert ids("--id", "101") == ["101", "101"]
    assert ids("--id", "0x00000101") == ["00000101"]
    assert ids("--id", "111") == []  # of 11 bits: the frame's has 29
    assert ids("--id", "103", "--id", "300") == ["103", "300"]
    assert ids("--message", "YawRate_A3") == ["103"]
    assert ids("--axle", "3") == ["103"]
    assert ids("--axle", "1", "--axle", "3", "-n", "2") == ["101", "103"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--message", "YawRat_A1"], "--message: no DBC has a message YawRat_A1 — did you mean 'YawRate_A1'?"),
        (["--axle", "9"], "--axle: the configuration has no axle 9 — it has 1, 2, 3, 4"),
        (["--id", "1FFFFFFFF"], "--id: '1FFFFFFFF' is no id — hexadecimal: 101, or 18FEF1FE of 29 bits"),
        (["--id", "Yaw"], "--id: 'Yaw' is no id"),
    ],
)
def test_selection_that_there_is_not_is_refused(
    options: list[str], said: str, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["dump", str(log), *options]) == 2
    assert said in capsys.readouterr().err


def test_option_that_there_is_not_is_answered_with_the_commands_usage(
    log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["dump", str(log), "--wheel", "1"])
    said = capsys.readouterr().err
    assert said.startswith("usage: wrcd dump ")
    assert "unrecognized arguments: --wheel 1" in said
