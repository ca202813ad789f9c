"""wrcd lint: every planted fault is found with its code and line, and a sound DBC has none."""

import json
from pathlib import Path
from typing import NamedTuple

import pytest

from sim_ecu import resources as rig
from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.cli import main as cli
from wrcd.core.design import load_design
from wrcd.dbc.dbc_lines import read
from wrcd.dbc.lint.codes import CODES
from wrcd.dbc.lint.lint_file import findings

ROOT = Path(__file__).parents[3]
DESIGN = load_design(resources.DESIGN)
DATA = ROOT / "tests" / "data" / "dbc"
SOUND = DATA / "sound.dbc"
GYRO = ' SG_ GyroZ : 16|16@1- (0.005,0) [-160|160] "deg/s" Monitor'
ACCEL = ' SG_ AccY : 32|16@1- (0.0003,0) [-9.8|9.8] "g" Monitor'
TORQUE = ' SG_ Torque : 16|16@1- (0.004,0) [-130|130] "kNm" Monitor'
SPEED = ' SG_ VehicleSpeed : 16|16@1+ (0.01,0) [0|500] "km/h" Monitor,BCU'
FRICTION = ' SG_ Friction : 16|8@1+ (0.5,0) [0|100] "%" BCU'
CYCLE = 'BA_ "GenMsgCycleTime" BO_ 529 10;\n'
J1939 = ('"StandardCAN_FD","ExtendedCAN_FD";', '"J1939PG","ExtendedCAN_FD";')
FD_640 = (CYCLE, CYCLE + 'BA_ "VFrameFormat" BO_ 640 2;\n')
CURRENT_24 = ("m0 : 8|16", "m0 : 8|24")
E2E_641 = (CYCLE, CYCLE + 'BA_ "E2EProfile" BO_ 641 "P11";\nBA_ "E2EDataId" BO_ 641 641;\n')
SEND_TYPE_560 = ('BA_ "GenMsgSendType" BO_ 560 0;\n', "")
STATUS = ' SG_ Status : 12|4@1+ (1,0) [0|15] "" Monitor\n'
VALUES_560 = """VAL_ 560 Status 0 "Ok" 1 "Degraded" 14 "Error" 15 "NotAvailable" ;
VAL_ 560 VehicleSpeed 65535 "NotAvailable" ;
"""
CRC = ' SG_ Crc : 0|8@1+ (1,0) [0|255] "" BCU'
CURRENT = ' SG_ Current m0 : 8|16@1- (0.1,0) [-3000|3000] "A" TCU'


class Planted(NamedTuple):
    """A fault: the code that must be found, what is replaced in the sound DBC, and the line where it must be found, by
    what only that line has (the last such)."""

    code: str
    old: str
    new: str
    at: str
    also: tuple[str, ...] = ()  # what else follows from it
    more: tuple[str, str] = ("", "")  # a second replacement that it needs

    @property
    def name(self) -> str:
        """For a person."""
        return f"{self.code}: {self.new.strip()[:40]}"


def _changed(line: str, old: str, new: str) -> tuple[str, str]:
    assert old in line
    return line, line.replace(old, new)


NO_ROOM = _changed(FRICTION, "(0.5,0) [0|100]", "(0.4,0) [0|102]")
PLANTED = [
    # the text
    Planted("byte-order-mark", 'VERSION ""', '\ufeffVERSION ""', "VERSION"),
    Planted("non-ascii-unit", *_changed(GYRO, "deg/s", "°/s"), "SG_ GyroZ"),
    Planted("non-ascii-unit", *_changed(TORQUE, "kNm", "kN·m"), "SG_ Torque"),
    Planted("unknown-reference", "VAL_ 513 AccY", 'VAL_ 514 AccY 1 "One" ;\nVAL_ 513 AccY', "VAL_ 514"),
    Planted("unknown-reference", "VAL_ 513 AccY", 'VAL_ 513 AccX 1 "One" ;\nVAL_ 513 AccY', "VAL_ 513 AccX"),
    # the layout
    Planted("duplicate-id", "BO_ 640 D", "BO_ 640 Other: 1 BCU\n\nBO_ 640 D", "Diagnosis"),
    Planted("duplicate-message", "BO_ 640 D", "BO_ 641 Diagnosis: 1 BCU\n\nBO_ 640 D", "BO_ 640"),
    Planted("duplicate-signal", CURRENT, CURRENT + "\n" + CURRENT.replace("m0", "m2"), "Current m2"),
    Planted("impossible-id", "BO_ 640 D", "BO_ 2048 Far: 1 BCU\n\nBO_ 640 D", "Far"),
    Planted("impossible-id", "BO_ 640 D", "BO_ 3221225471 Far: 1 BCU\n\nBO_ 640 D", "Far"),
    Planted("undeclared-sender", "BO_ 640 Diagnosis: 4 BCU", "BO_ 640 Diagnosis: 4 BCU2", "BO_ 640"),
    Planted("undeclared-receiver", *_changed(CURRENT, "TCU", "TCU,TCU2"), "Current"),
    Planted("signal-outside-message", *_changed(CURRENT, "8|16", "24|16"), "Current"),
    Planted("signal-outside-message", *_changed(CURRENT, "8|16@1", "31|16@0"), "Current"),
    Planted("signals-overlap", *_changed(ACCEL, "32|16", "31|16"), "SG_ AccY"),
    Planted("signals-overlap", *_changed(CURRENT, "m0 : 8|16", "m1 : 8|16"), "Voltage"),
    Planted("no-bits", *_changed(CURRENT, "8|16", "8|0"), "Current"),
    Planted("too-long", "BO_ 640 Diagnosis: 4 BCU", "BO_ 640 Diagnosis: 12 BCU", "BO_ 640"),
    Planted("fd-length", "BO_ 640 Diagnosis: 4 BCU", "BO_ 640 Diagnosis: 9 BCU", "BO_ 640 D", more=FD_640),
    Planted("fd-input", CYCLE, CYCLE + 'BA_ "VFrameFormat" BO_ 529 2;\n', "SG_ Torque"),
    Planted("j1939-id", CYCLE, CYCLE + 'BA_ "VFrameFormat" BO_ 529 2;\n', "BO_ 529 Tcu1", more=J1939),
    Planted("multiplexed-input", *_changed(TORQUE, "Torque :", "Torque m2 :"), "SG_ Torque"),
    # numbers
    Planted("factor-zero", *_changed(CURRENT, "(0.1,0)", "(0,0)"), "Current"),
    Planted("range-reversed", *_changed(CURRENT, "[-3000|3000]", "[3000|-3000]"), "Current"),
    Planted("range-beyond-field", *_changed(CURRENT, "[-3000|3000]", "[-3000|4000]"), "Current"),
    Planted("range-beyond-field", *_changed(CURRENT, "@1-", "@1+"), "Current"),
    Planted("no-range", *_changed(GYRO, "[-160|160]", "[0|0]"), "SG_ GyroZ"),
    Planted("start-value-out-of-range", "SG_ 769 Friction 255;", "SG_ 769 Friction 201;", "SG_ 769 Friction 201"),
    Planted("start-value-out-of-range", "SG_ 769 Friction 255;", "SG_ 769 Friction 256;", "SG_ 769 Friction 256"),
    Planted("float-width", CYCLE, CYCLE + "SIG_VALTYPE_ 640 Current : 1;\n", "SG_ Current", more=CURRENT_24),
    # words
    Planted("value-beyond-width", "VAL_ 769 State 0", 'VAL_ 769 State 4 "Off" 0', "VAL_ 769 State"),
    Planted("value-beyond-width", 'AccY -32768 "', 'AccY 32768 "', "VAL_ 513 AccY"),
    Planted("value-named-twice", "VAL_ 769 State 0", 'VAL_ 769 State 3 "Off" 0', "VAL_ 769 State"),
    Planted("sentinel-in-range", 'AccY -32768 "', 'AccY -32000 "', "VAL_ 513 AccY"),
    Planted("sentinel-in-range", 'VehicleSpeed 65535 "N', 'VehicleSpeed 0 "N', "VAL_ 560 VehicleSpeed"),
    Planted("status-words-unknown", 'VAL_ 529 Status 0 "Ok"', 'VAL_ 529 Status 0 "Messbetrieb"', "VAL_ 529 Status"),
    Planted("no-room-for-not-available", *NO_ROOM, "SG_ Friction", ("sentinel-in-range",)),
    Planted("no-way-to-fail", VALUES_560, "", "SG_ VehicleSpeed", more=(STATUS + SPEED, SPEED)),
    # times
    Planted("cyclic-without-cycle", 'BA_ "GenMsgCycleTime" BO_ 769 20;\n', "", '"GenMsgSendType" BO_ 769'),
    Planted("cycle-no-time", "BO_ 769 20;", "BO_ 769 70000;", "BO_ 769 70000"),
    Planted("no-timeout", 'BA_ "GenSigTimeoutTime" SG_ 529 Torque 30;\n', "", "SG_ Torque"),
    Planted("timeout-below-cycle", "SG_ 529 Torque 30;", "SG_ 529 Torque 8;", "SG_ 529 Torque 8"),
    Planted("cycle-above-tick", "BO_ 513 5;", "BO_ 513 20;", "BO_ 513 20"),
    Planted("no-cycle", 'BA_ "GenMsgCycleTime" BO_ 560 20;\n', "", "BO_ 560 S", more=SEND_TYPE_560),
    # E2E
    Planted("e2e-unknown-profile", 'BO_ 529 "P11"', 'BO_ 529 "P1A"', 'BO_ 529 "P1A"'),
    Planted("e2e-no-data-id", 'BA_ "E2EDataId" BO_ 529 529;\n', "", "BO_ 529 Tcu1"),
    Planted("e2e-no-data-id", "BO_ 529 529;", "BO_ 529 70000;", "BO_ 529 70000"),
    Planted("e2e-data-id-twice", "BO_ 529 529;", "BO_ 529 513;", "BO_ 529 513"),
    Planted("e2e-overlap", *_changed(CRC, "Crc", "Surface"), "Surface"),
    Planted("e2e-too-short", "BO_ 640 D", "BO_ 641 Short: 1 BCU\n\nBO_ 640 D", "Short", more=E2E_641),
    Planted("e2e-partly", 'BA_ "E2EProfile" BO_ 529 "P11";\n', "", "BO_ 529 Tcu1"),
    # what is in the file, and for the estimator
    Planted("ground-truth", "BO_ 640 Diagnosis", "BO_ 640 SimTruth_A1", "SimTruth_A1"),
    Planted("ground-truth", "BO_ 640 Diagnosis", "BO_ 1953 Diagnosis", "BO_ 1953"),
    Planted("unit-missing", *_changed(ACCEL, '"g"', '""'), "SG_ AccY"),
    Planted("unit-unknown", *_changed(GYRO, "deg/s", "deg/min"), "SG_ GyroZ"),
    Planted("one-sided", *_changed(TORQUE, "[-130|130]", "[0|130]"), "SG_ Torque"),
    Planted("resolution-too-coarse", *_changed(GYRO, "(0.005,0)", "(0.02,0)"), "SG_ GyroZ"),
    Planted("resolution-too-coarse", *_changed(ACCEL, "(0.0003,0)", "(0.002,0)"), "SG_ AccY"),
    Planted("range-too-small", *_changed(GYRO, "[-160|160]", "[-10|10]"), "SG_ GyroZ"),
    Planted("range-too-small", *_changed(ACCEL, "[-9.8|9.8]", "[-1|1]"), "SG_ AccY"),
]  # fmt: skip


NOT_PLANTED = {"not-loadable"}  # has a test of its own


def _plant(folder: Path, *replacements: tuple[str, str]) -> tuple[Path, list[str]]:
    text = SOUND.read_text(encoding="ascii")
    for old, new in replacements:
        if old:
            assert text.count(old) == 1, f"{old!r} is there {text.count(old)} times"
            text = text.replace(old, new)
    file = folder / "planted.dbc"
    file.write_text(text, encoding="utf-8")
    return file, file.read_text(encoding="utf-8").splitlines()


def _found(file: Path) -> list[tuple[str, int]]:
    return [(f.code, f.line) for f in findings(file, DESIGN)]


@pytest.mark.parametrize("file", [SOUND, resources.DBC, ROOT / "dbc" / "wrcd.dbc"])
def test_sound_dbc_has_no_finding(file: Path) -> None:
    assert findings(file) == []


@pytest.mark.parametrize("planted", PLANTED, ids=lambda p: p.name)
def test_planted_fault_is_found_alone_with_code_and_line(planted: Planted, tmp_path: Path) -> None:
    file, lines = _plant(tmp_path, (planted.old, planted.new), planted.more)
    [*_, line] = [number for number, text in enumerate(lines, 1) if planted.at in text]
    found = _found(file)
    assert (planted.code, line) in found
    assert {code for code, _ in found} == {planted.code, *planted.also}
    assert len(found) == 1 + len(planted.also)


def test_every_code_is_planted() -> None:
    assert {p.code for p in PLANTED} | NOT_PLANTED == set(CODES)


def test_dbc_that_cannot_be_loaded_is_a_finding_beside_the_others(tmp_path: Path) -> None:
    file, _ = _plant(tmp_path, (CURRENT, CURRENT.replace("(0.1,0)", "(1e99999,0)")), _changed(ACCEL, '"g"', '""'))
    first, second = findings(file)
    assert (first.line, first.code, first.subject) == (19, "unit-missing", "Imu1.AccY")
    assert (second.line, second.code, second.subject) == (35, "not-loadable", "planted.dbc")
    assert "no message, signal or number is that large" in second.what


def test_json_has_a_record_for_each_finding(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, _ = _plant(tmp_path, _changed(CURRENT, "[-3000|3000]", "[3000|-3000]"))
    assert cli.main(["lint", "--json", str(file)]) == 1
    code = CODES["range-reversed"]
    record = {"line": 35, "code": "range-reversed", "subject": "Diagnosis.Current", "what": "[3000|-3000]"}
    assert json.loads(capsys.readouterr().out) == {
        "file": str(file),
        "findings": [{**record, "why": code.why, "mend": code.mend}],
    }
    assert cli.main(["lint", "--json", str(SOUND)]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(SOUND), "findings": []}


def test_finding_of_extended_multiplexing_is_left_to_its_ranges(tmp_path: Path) -> None:
    swapped = (CURRENT, CURRENT.replace("m0 : 8|16", "m1 : 8|16"))
    file, _ = _plant(
        tmp_path, swapped, (CYCLE, CYCLE + "SG_MUL_VAL_ 640 Current Page 0-0;\nSG_MUL_VAL_ 640 Voltage Page 1-1;\n")
    )
    assert _found(file) == []


# --- the text reader


@pytest.mark.parametrize("file", [resources.DBC, rig.TRUTH_DBC, SOUND, DATA / "third-party.dbc"], ids=lambda p: p.name)
def test_reader_agrees_with_cantools(file: Path) -> None:
    dbc, database = read(file), load_dbc(file)
    lines = file.read_text(encoding="cp1252").splitlines()
    assert len(dbc.messages) == len(database.messages) > 0
    for ours, theirs in zip(dbc.messages, database.messages, strict=True):
        assert (ours.can_id, ours.extended, ours.name) == (theirs.frame_id, theirs.is_extended_frame, theirs.name)
        assert (ours.length, dbc.is_fd(ours), [ours.sender]) == (theirs.length, theirs.is_fd, theirs.senders)
        assert (dbc.number(ours, "GenMsgCycleTime") or None) == theirs.cycle_time
        assert f" {ours.name}:" in lines[ours.line - 1]
        signals = {s.name: s for s in theirs.signals}
        for s in ours.signals:
            other = signals[s.name]
            assert f"SG_ {s.name} " in lines[s.line - 1]
            assert (s.start, s.length, s.signed) == (other.start, other.length, other.is_signed)
            assert s.big_endian == (other.byte_order == "big_endian")
            assert (s.scale, s.offset, s.low, s.high) == (other.scale, other.offset, other.minimum, other.maximum)
            assert (s.unit or None) == other.unit
            assert dict(s.words) == {r: str(w) for r, w in (other.choices or {}).items()}
            assert (s.comment or None) == other.comment
