"""wrcd init: what it proposes for a DBC, what it leaves open, and that `wrcd check` takes it."""

import re
import tomllib
from collections.abc import Mapping
from difflib import ndiff
from pathlib import Path
from typing import Any

import pytest

from tests.support.snapshots import assert_kept
from wrcd import resources
from wrcd.bus.units import Quantity
from wrcd.cli import main as cli
from wrcd.config.config import load_config, load_packaged
from wrcd.core.configuration import Config, Input
from wrcd.core.design import load_design
from wrcd.dbc.dbc_lines import read
from wrcd.dbc.init.proposal import Proposal
from wrcd.dbc.init.propose import propose
from wrcd.errors import InputError, InputErrors

ROOT = Path(__file__).parents[3]
DESIGN = load_design(resources.DESIGN)
DATA = ROOT / "tests" / "data" / "dbc"
EXAMPLE = ROOT / "examples" / "own-dbc"
WHEELSET = ("# wheelset = ", "wheelset = ")  # the edit that every proposal needs
GYRO = '"deg/s" [-160|160] 0.005 16'
ACCEL = '"g" [-9.8|9.8] 0.0003 16'
TORQUE = '"kNm" [-130|130] 0.004 16'
SPEED = '"km/h" [0|500] 0.01 16'


def written(dbc: Path, folder: Path) -> Path:
    """The configuration that init writes."""
    out = folder / "my.toml"
    assert cli.main(["init", str(dbc), "-o", str(out)]) == 0
    return out


def edited(file: Path, *edits: tuple[str, str]) -> Path:
    """A configuration after somebody's edits, each of one place."""
    text = file.read_text(encoding="utf-8")
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    return file


def mapped(config: Config) -> dict[tuple[Quantity, tuple[int, ...]], tuple[object, ...]]:
    """What a configuration maps, without time-outs."""

    def one(i: Input) -> tuple[object, ...]:
        s = i.source
        return s.message, s.signal, s.factor, s.low, s.high, s.statuses

    return {(i.source.quantity, i.source.axles): one(i) for i in config.inputs}


# --- whole files


def test_third_party_dbc_is_accepted_after_three_edits(tmp_path: Path) -> None:
    file = written(DATA / "third-party.dbc", tmp_path)
    with pytest.raises(InputError) as e:
        load_config(file)
    assert "wheelset" in str(e.value)
    assert "axle[2].lateral_acceleration: is missing" in str(e.value)
    edited(
        file,
        WHEELSET,
        ("# lateral_acceleration = {", "lateral_acceleration = {"),
        ('unit = "m/s2"', 'unit = "m/s2", sign = -1'),
    )
    assert cli.main(["check", "--config", str(file)]) == 0
    by_hand = load_config(DATA / "third-party.toml")
    config = load_config(file)
    assert mapped(config) == mapped(by_hand)
    for ours, theirs in zip(config.axles, by_hand.axles, strict=True):
        assert ours.number == theirs.number
        assert ours.adhesion.message == theirs.adhesion.message
        assert {**theirs.adhesion.signals} == {**ours.adhesion.signals} | {
            "Confidence": theirs.adhesion.signals["Confidence"]
        }


def test_example_is_mapped_as_by_hand(tmp_path: Path) -> None:
    file = edited(written(EXAMPLE / "train.dbc", tmp_path), WHEELSET)
    assert mapped(load_config(file)) == mapped(load_config(EXAMPLE / "train.toml"))
    assert load_config(file).axles == load_config(EXAMPLE / "train.toml").axles


def test_packaged_dbc_is_mapped_as_packaged(tmp_path: Path) -> None:
    config = load_config(edited(written(resources.DBC, tmp_path), WHEELSET))
    packaged = load_packaged(8)
    assert config.inputs == packaged.inputs
    assert config.axles == packaged.axles
    assert config.torque_is_total


def test_of_two_signals_that_could_be_the_sample_age_the_first_is_taken(tmp_path: Path) -> None:
    text = (DATA / "third-party.dbc").read_text(encoding="cp1252")
    age = ' SG_ Age : 23|8@0+ (1,0) [0|255] "ms" WSPU\n'
    assert text.count(age) == 2
    file = tmp_path / "two-ages.dbc"
    file.write_text(text.replace(age, age + age.replace("Age : 23", "Age2 : 47")), encoding="cp1252")
    proposed = propose(read(file), tmp_path, DESIGN).text()
    assert [axle["adhesion"]["sample_age"] for axle in tomllib.loads(proposed)["axle"]] == ["Age", "Age"]
    assert "Age is taken for the sample age; there is Age2, too" in proposed


MESSAGE_OF_OURS = """BO_ 200 Adhesion_A1: 8 Monitor
 SG_ Validity : 0|4@1+ (1,0) [0|3] "" TCU
 SG_ MuAvailable : 8|8@1+ (0.4,0) [0|102] "%" TCU

"""
WORDS_OF_OURS = 'VAL_ 200 Validity 0 "NotAvailable" 1 "Valid" 2 "Degraded" 3 "Error" ;\nVAL_ 103 State'
OURS = (("BO_ 103", MESSAGE_OF_OURS + "BO_ 103"), ("VAL_ 103 State", WORDS_OF_OURS))
# What is odd in a DBC, and what `wrcd check` then refuses besides its wheelset.
ODD = {
    "no word for not available": (OURS, 'has no word for "not available"'),
    "too coarse": ((("(0.5,0) [0|100]", "(5,0) [0|100]"),), "has steps of 5 %"),
    "range that shuts out": ((("[-160|160]", "[-1|1]"),), "shuts out 99 %"),
    "empty range": ((("[-160|160]", "[160|-160]"),), "is empty"),
    "cycle that there is not": ((("Time\" 5;", 'Time" 5;\nBA_ "GenMsgCycleTime" BO_ 102 70000;'),), "must lie within"),
    "unknown protection": (
        (("BA_DEF_ BO_", 'BA_DEF_ BO_ "E2EProfile" STRING ;\nBA_DEF_DEF_ "E2EProfile" "P5";\nBA_DEF_ BO_'),),
        "axle[1].yaw_rate: is missing",
    ),
    "start value beyond its field": ((("BA_DEF_ BO_", 'BA_DEF_ SG_ "GenSigStartValue" INT 0 9999;\nBA_DEF_ BO_'),
        ("Time\" 5;", 'Time" 5;\nBA_ "GenSigStartValue" SG_ 103 State 9;')), "has a start value"),
}  # fmt: skip


@pytest.mark.parametrize(
    "dbc", [*sorted(DATA.glob("*.dbc")), EXAMPLE / "train.dbc", resources.DBC], ids=lambda file: file.stem
)
def test_each_refusal_of_a_proposal_is_an_open_point(dbc: Path, tmp_path: Path) -> None:
    assert_refusals_are_open(dbc, tmp_path)


@pytest.mark.parametrize("odd", ODD)
def test_each_refusal_of_an_odd_dbc_is_an_open_point(odd: str, tmp_path: Path) -> None:
    edits, refused = ODD[odd]
    proposal(tmp_path, USUAL | {"Adhesion": ADHESION}, f"{STATES}\n{NO_VALUE}")
    dbc = edited(tmp_path / "own.dbc", *edits)
    assert refused in assert_refusals_are_open(dbc, tmp_path)


def assert_refusals_are_open(dbc: Path, folder: Path) -> str:
    """Each refusal of what is proposed for a DBC has its open point, in the list and beside its key. Returns them."""
    file = written(dbc, folder)
    text = file.read_text(encoding="utf-8")
    with pytest.raises(InputError) as e:  # its wheelset is always open
        load_config(file)
    points = re.findall(r"(?m)^#   TODO (\d+): ((?:.*\n#      )*.*)", text)
    assert [number for number, _ in points] == [str(n) for n in range(1, len(points) + 1)]
    said = [" ".join(point.replace("\n#", " ").split()) for _, point in points]
    for error in e.value.errors if isinstance(e.value, InputErrors) else (e.value,):
        table, _, key = error.key.partition(".")
        place = re.fullmatch(r"axle\[(\d+)\]", table)
        number = tomllib.loads(text)["axle"][int(place[1]) - 1]["number"] if place else None
        spoken = table if number is None else f"axle {number}"
        about = (f"{error.key}: ", f"{spoken}, {key.partition('.')[0]}: ", *["wheelset: "][: error.key == "dbc.file"])
        assert any(point.startswith(about) for point in said), error
    for number, _ in points:
        assert len(re.findall(rf"(?m)^# TODO {number}: ", text)) == 1
    return str(e.value)


def test_file_that_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "my.toml"
    out.write_text("mine", encoding="utf-8")
    assert cli.main(["init", str(DATA / "sound.dbc"), "-o", str(out)]) == 2
    assert f"{out}: " in capsys.readouterr().err
    assert out.read_text(encoding="utf-8") == "mine"
    assert cli.main(["init", str(DATA / "sound.dbc"), "-o", str(out), "--force"]) == 0
    assert out.read_text(encoding="utf-8") != "mine"


def test_without_output_the_file_goes_to_stdout_and_open_points_to_stderr(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(DATA)
    assert cli.main(["init", "third-party.dbc"]) == 0
    out, err = capsys.readouterr()
    assert tomllib.loads(out)["dbc"] == {"file": "third-party.dbc"}
    assert [line.partition(":")[0] for line in err.splitlines()][:3] == ["TODO 1", "TODO 2", "unsure"]


# --- one thing each


def proposal(folder: Path, messages: Mapping[str, Mapping[str, str]], rest: str = "") -> Proposal:
    """What is proposed for messages with ids from 100, {"Name": {"Signal": '"unit" [min|max] factor bits'}}."""
    lines = ['VERSION ""', "", "BS_:", "", "BU_: TCU Monitor", ""]
    for number, (name, signals) in enumerate(messages.items(), 100):
        lines.append(f"BO_ {number} {name}: 8 {'Monitor' if 'Adhesion' in name else 'TCU'}")
        start = 0
        for signal, text in signals.items():
            unit, limits, factor, bits = text.rsplit(" ", 3)
            sign = "-" if "-" in limits else "+"
            lines.append(f" SG_ {signal} : {start}|{bits}@1{sign} ({factor},0) {limits} {unit} TCU")
            start += int(bits)
        lines.append("")
    lines += [
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;',
        'BA_DEF_DEF_ "GenMsgCycleTime" 5;',
        *([rest] if rest else []),
        "",
    ]
    file = folder / "own.dbc"
    file.write_text("\n".join(lines), encoding="utf-8")
    return propose(read(file), folder, DESIGN)


def tables(draft: Proposal) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """[vehicle] and [[axle]], as they stand."""
    top = tomllib.loads(draft.text())
    return top["vehicle"], top["axle"]


USUAL = {"Imu": {"YawRate": GYRO, "LatAcc": ACCEL}, "Tcu": {"Torque": TORQUE}, "Train": {"Speed": SPEED}}


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (("Imu_A1", "Imu_A2"), [1, 2]),
        (("Axle1Imu", "Axle2Imu"), [1, 2]),
        (("RS1_Sensorik", "RS2_Sensorik"), [1, 2]),
        (("ImuWheelset3", "ImuWheelset4"), [3, 4]),
        (("Bogie1", "Bogie2"), [1, 2]),
        (("Imu1", "Imu2"), [1, 2]),
        (("Bogie1_Axle1", "Bogie1_Axle2", "Bogie2_Axle1", "Bogie2_Axle2"), [1, 2, 3, 4]),
        (("ImuFront", "ImuRear"), [1, 2]),
        (("Imu11", "Imu12", "Imu21"), [1, 2, 3]),
    ],
)
def test_axles_are_numbered_by_names(names: tuple[str, ...], numbers: list[int], tmp_path: Path) -> None:
    draft = proposal(tmp_path, {name: {"YawRate": GYRO, "LatAcc": ACCEL} for name in names})
    _, axles = tables(draft)
    assert [a["number"] for a in axles] == numbers
    assert [a["yaw_rate"] for a in axles] == [f"{name}.YawRate" for name in names]


def test_ninth_axle_is_an_open_point(tmp_path: Path) -> None:
    draft = proposal(tmp_path, {f"Imu_A{a}": {"YawRate": GYRO} for a in range(1, 10)})
    assert len(tables(draft)[1]) == 8
    assert any("left out: 9" in point for point in draft.open)


def test_setpoints_limits_and_other_axes_are_no_measurements(tmp_path: Path) -> None:
    others = {
        "Other": {"SpeedSetpoint": SPEED, "v_Soll": SPEED, "MaxSpeed": SPEED},
        "More": {"GyroX": GYRO, "AccZ": ACCEL, "TorqueDemand": TORQUE, "WheelSpeed": SPEED},
        "SimTruth_A1": {"YawRate": GYRO},
    }
    assert tables(proposal(tmp_path, others | USUAL)) == tables(proposal(tmp_path, USUAL))


# what stands in a DBC beside the usual train: messages and statements
IMU, STATE = {"YawRate": GYRO, "LatAcc": ACCEL}, '"" [0|3] 1 2'
ADHESION = {"Friction": '"%" [0|100] 0.5 8', "State": STATE}
USED = {"FrictionUsed": ADHESION["Friction"], "FrictionMax": ADHESION["Friction"], "State": STATE}
STATES = 'VAL_ 103 State 0 "None" 1 "Good" 2 "Poor" 3 "Err" ;'
NO_VALUE = 'VAL_ 103 Friction 255 "not available" ;'
DIRECTION = {"Tcms": {"Direction": '"" [0|1] 1 1'}}
SPEEDS = "".join(f'VAL_ 103 {s} 0 "Invalid" 1 "Valid" 2 "Degraded" ;\n' for s in ("SpeedValid", "DoorState"))
CASES: dict[str, tuple[Mapping[str, Mapping[str, str]], str]] = {
    "a second gyro": ({"Spare": {"YawRate": GYRO}}, ""),
    "a gyro by its unit": ({"Imu": {"Channel7": GYRO, "LatAcc": ACCEL}}, ""),
    "a motor's torque": ({"Tcu": {"MotorTorque": TORQUE}}, ""),
    "a torque without unit": ({"Tcu": {"Torque": TORQUE.replace("kNm", "")}}, ""),
    "a force": ({"Tcu": {"TractiveEffort": TORQUE.replace("kNm", "kN")}}, ""),
    "a status in words": ({"Imu": IMU | {"ImuState": STATE}}, 'VAL_ 100 ImuState 0 "OK" 1 "Fault" ;'),
    "a status in German": (
        {"Imu": IMU | {"Zustand": STATE}},
        'VAL_ 100 Zustand 0 "Selbsttest" 1 "Messbetrieb" 2 "eingeschraenkt" 3 "Fehler" ;',
    ),
    "a status in unknown words": ({"Imu": IMU | {"ImuState": STATE}}, 'VAL_ 100 ImuState 0 "Blau" 1 "Fehler" ;'),
    "a CRC without a profile": ({"Imu": {"Crc": '"" [0|255] 1 8', "AliveCounter": '"" [0|15] 1 4', **IMU}}, ""),
    "a sign in a comment": ({}, 'CM_ SG_ 100 LatAcc "positive to the right";'),
    "a direction": (DIRECTION, 'VAL_ 103 Direction 0 "Forward" 1 "Reverse" ;'),
    "a direction in German": (DIRECTION, 'VAL_ 103 Direction 0 "vorwaerts" 1 "rueckwaerts" ;'),
    "a direction in unknown words": (DIRECTION, 'VAL_ 103 Direction 0 "A" 1 "B" ;'),
    "a total torque": ({}, 'CM_ SG_ 101 Torque "Total torque at the axle";'),
    "a brake torque": ({"Bcu": {"BrakeTorque": TORQUE}}, 'CM_ SG_ 101 Torque "Total torque";'),
    "a brake torque without a sign": ({"Bcu": {"BrakeTorque": TORQUE.replace("[-130", "[0")}}, ""),
    "an adhesion": ({"Adhesion": ADHESION}, f"{STATES}\n{NO_VALUE}"),
    "an adhesion and what is used": (
        {"Adhesion": USED}, f'{STATES}\nVAL_ 103 FrictionUsed 255 "SNA" ;\nVAL_ 103 FrictionMax 255 "SNA" ;'
    ),
    "an adhesion without a word for none": ({"Adhesion": ADHESION}, STATES),
    "an adhesion without room for none": ({"Adhesion": ADHESION | {"Friction": '"%" [0|102] 0.4 8'}}, STATES),
    "an adhesion with unknown words": (
        {"Adhesion": ADHESION}, NO_VALUE + '\nVAL_ 103 State 0 "None" 1 "Gruen" 2 "Poor" ;'
    ),
    "an adhesion without a validity": ({"Adhesion": {"Friction": ADHESION["Friction"]}}, NO_VALUE),
    "an adhesion as a share": (
        {"AdhesionA": ADHESION | {"Friction": '"" [0|1] 0.005 8'}}, f"{STATES}\n{NO_VALUE}"
    ),
    "an adhesion in 1": ({"AdhesionA": ADHESION | {"Friction": '"1" [0|1] 0.005 8'}}, f"{STATES}\n{NO_VALUE}"),
    "no adhesion": ({"Bcu": {"FrictionBrakeShare": '"" [0|1] 0.005 8'}}, ""),
    "a status of the speed elsewhere": ({"Diag": {"SpeedValid": STATE, "DoorState": STATE}}, SPEEDS),
    "two statuses of the speed elsewhere": (
        {"Diag": {"SpeedValid": STATE}, "Diag2": {"SpeedState": STATE}},
        'VAL_ 103 SpeedValid 0 "Invalid" 1 "Valid" ;\nVAL_ 104 SpeedState 0 "Invalid" 1 "Valid" ;',
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ["the usual train", "nothing that fits", *CASES])
def test_what_is_proposed_doubted_and_open(name: str, tmp_path: Path) -> None:
    """The lines that the usual train's proposal has not, and those that it has in their place."""
    usual = proposal(tmp_path, USUAL).text().splitlines() if name in CASES else []
    messages, rest = CASES.get(name, ({"Doors": {"Open": '"" [0|1] 1 1'}} if "nothing" in name else {}, ""))
    draft = proposal(tmp_path, dict(messages) if "nothing" in name else USUAL | dict(messages), rest).text()
    tomllib.loads(draft)
    assert_kept("proposals", name, (line for line in ndiff(usual, draft.splitlines()) if line[0] in "+-"))


def test_packaged_message_that_is_copied_into_a_dbc_is_sent(tmp_path: Path) -> None:
    """The lines that the page names are all that it needs."""
    proposal(tmp_path, USUAL)
    own = (tmp_path / "own.dbc").read_text(encoding="utf-8")
    packaged = resources.DBC.read_text(encoding="utf-8")
    message = re.search(r"^BO_ 145 Adhesion_A1:.*?\n\n", packaged, re.MULTILINE | re.DOTALL)
    assert message is not None
    words = re.findall(r"^VAL_ 145 .*\n", packaged, re.MULTILINE)
    file = tmp_path / "copied.dbc"
    file.write_text(own.replace("BA_DEF_ ", message[0] + "BA_DEF_ ", 1) + "".join(words), encoding="utf-8")
    sent = load_config(edited(written(file, tmp_path), WHEELSET)).axles[0].adhesion
    assert set(sent.signals) == set(load_config(None).axles[0].adhesion.signals)


def test_torque_of_a_bogie_is_shared_by_a_person(tmp_path: Path) -> None:
    gyros = {f"Imu_A{a}": IMU for a in range(1, 5)}
    draft = proposal(tmp_path, gyros | {f"Tcu_Bogie{b}": {"Torque": TORQUE} for b in (1, 2)})
    shared = [line for line in draft.lines if line.startswith("# torque = ")]
    assert shared == [f'# torque = {{ signal = "Tcu_Bogie{b}.Torque", share = 0.5 }}' for b in (1, 1, 2, 2)]
    assert all("torque" not in axle for axle in tables(draft)[1])


MULTIPLEXED = """VERSION ""
BS_:
BU_: A
BO_ 768 Bogie: 8 A
 SG_ Wheelset M : 0|4@1+ (1,0) [0|15] "" A
 SG_ HealthWS1 m1 : 4|4@1+ (1,0) [0|15] "" A
 SG_ YawRateWS1 m1 : 8|16@1- (0.005,0) [-60|60] "deg/s" A
 SG_ LatAccWS1 m1 : 24|16@1- (0.002,0) [-60|60] "m/s2" A
 SG_ HealthWS2 m2 : 4|4@1+ (1,0) [0|15] "" A
 SG_ YawRateWS2 m2 : 8|16@1- (0.005,0) [-60|60] "deg/s" A
 SG_ LatAccWS2 m2 : 24|16@1- (0.002,0) [-60|60] "m/s2" A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 2;
VAL_ 768 HealthWS1 0 "Init" 1 "Measuring" 3 "Broken" ;
VAL_ 768 HealthWS2 0 "Init" 1 "Measuring" 3 "Broken" ;
"""


def of_text(folder: Path, text: str) -> Proposal:
    file = folder / "own.dbc"
    file.write_text(text, encoding="utf-8")
    return propose(read(file), folder, DESIGN)


@pytest.mark.parametrize("branches", ["multiplexed", "in every frame"])
def test_status_is_the_one_of_the_signal_branch_and_number(branches: str, tmp_path: Path) -> None:
    text = MULTIPLEXED
    if branches == "in every frame":
        text = re.sub(r" (M|m\d) :", " :", text)
    for axle in tables(of_text(tmp_path, text))[1]:
        for key in ("yaw_rate", "lateral_acceleration"):
            assert axle[key]["status"] == f"Bogie.HealthWS{axle['number']}"


def test_status_of_another_branch_alone_is_not_proposed(tmp_path: Path) -> None:
    text = re.sub(r".*HealthWS2.*\n", "", MULTIPLEXED)
    one, two = tables(of_text(tmp_path, text))[1]
    assert one["yaw_rate"]["status"] == "Bogie.HealthWS1"
    assert two["yaw_rate"] == "Bogie.YawRateWS2"


def test_multiplexed_gyro_that_cannot_come_in_every_tick_is_an_open_point(tmp_path: Path) -> None:
    slow = of_text(tmp_path, MULTIPLEXED.replace('Time" 2;', 'Time" 5;'))
    assert sum("in one of 2 frames, every 10 ms, the design's tick is 5 ms" in p for p in slow.open) == 4
    assert not any("in one of" in p for p in of_text(tmp_path, MULTIPLEXED).open)


def test_slow_gyro_is_an_open_point(tmp_path: Path) -> None:
    draft = proposal(tmp_path, USUAL, 'BA_ "GenMsgCycleTime" BO_ 100 20;')
    assert sum("comes every 20 ms, the design's tick is 5 ms" in p for p in draft.open) == 2


@pytest.mark.parametrize(("cycle", "limit"), [(30, None), (50, 150)])
def test_limit_reaches_to_the_longest_time_out(cycle: int, limit: int | None, tmp_path: Path) -> None:
    draft = proposal(tmp_path, USUAL, f'BA_ "GenMsgCycleTime" BO_ 102 {cycle};')
    said = tomllib.loads(draft.text()).get("limits", {})
    assert said.get("not_available_after_ms") == limit
