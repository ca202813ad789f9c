"""What a configuration takes from a DBC that is odd where it is mapped."""

from pathlib import Path

import pytest

from tests.unit.config.support import DBC, SECOND, SPEED, TORQUE, YAW, Edit, after, of_yaw_rate, written
from wrcd.bus.units import Quantity
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.terms import MAX_SIGNALS
from wrcd.errors import InputError

DIRECTION = SPEED, SPEED + '\ndirection = "Drive.Dir"'


def loaded(folder: Path, edits: list[Edit], dbc: list[Edit] | None = None) -> Config:
    text = DBC.read_text()
    for old, new in dbc or []:
        assert old in text
        text = text.replace(old, new)
    (folder / DBC.name).write_text(text)
    return load_config(written(folder, edits))


def refused(folder: Path, edits: list[Edit], dbc: list[Edit] | None = None) -> str:
    with pytest.raises(InputError) as error:
        loaded(folder, edits, dbc)
    return str(error.value).removeprefix(f"{folder / 'train.toml'}:")


def test_status_in_a_message_of_an_unknown_profile_is_refused(tmp_path: Path) -> None:
    said = refused(tmp_path, [of_yaw_rate('status = "OtherProfile.Torque", ok = [1]')])
    assert said == (
        "9: axle[1].yaw_rate.status: message OtherProfile asks for E2E profile 'P5'; only P11 is known — mend the DBC"
    )


def test_torque_of_two_axles_is_not_counted_twice_at_the_second(tmp_path: Path) -> None:
    second = SECOND + 'adhesion = "Adhesion_A2"\nbrake_torque = "Tcu.Torque"'
    assert refused(tmp_path, [after(second)]) == (
        "19: axle[2].brake_torque: Tcu.Torque is counted in axle[2].torque already"
    )


def test_time_out_of_the_configuration_stands_for_an_odd_cycle(tmp_path: Path) -> None:
    odd = [("BO_ 288 20;", "BO_ 288 100000;")]
    assert 'timeout_ms = "…"' in refused(tmp_path, [], odd)
    stated = (SPEED, 'speed = { signal = "Drive.V", timeout_ms = 80 }')
    (speed,) = [i for i in loaded(tmp_path, [stated], odd).inputs if i.source.quantity is Quantity.SPEED]
    assert speed.timeout_us == 80_000


def test_direction_without_words_or_signs_needs_its_values(tmp_path: Path) -> None:
    wordless = ('VAL_ 288 Dir 0 "Cab A" 1 "Cab B" ;\n', "")
    assert refused(tmp_path, [DIRECTION], [wordless]) == (
        "7: vehicle.direction: Drive.Dir has neither words nor two signs to tell reverse by — "
        "say which of its values mean it: "
        'write in [vehicle]: direction = { signal = "Drive.Dir", reverse = ["…"] }'
    )
    loaded(tmp_path, [DIRECTION], [wordless, ("Dir : 16|2@1+", "Dir : 16|2@1-")])
    loaded(tmp_path, [(SPEED, SPEED + '\ndirection = { signal = "Drive.Dir", reverse = [1] }')], [wordless])


@pytest.mark.parametrize(
    ("name", "table"), [("GyroFault", '0 "No_Fault" 1 "Fault"'), ("Diag", '0 "No_Fault" 1 "Fault"'), ("Status", "")]
)
def test_signal_named_status_or_with_words_of_one_is_one(tmp_path: Path, name: str, table: str) -> None:
    words = [("SensorState", name), ('0 "Run" 1 "Fault"', table)]
    config = loaded(tmp_path, [(YAW, YAW.replace("Imu1", "StatusImu"))], words)
    (yaw,) = [i.source for i in config.inputs if i.source.quantity is Quantity.YAW_RATE]
    assert [(r.signal, r.ok) for r in yaw.statuses or ()] == [(name, frozenset({0}))]


def test_torque_shared_by_two_axles_is_taken(tmp_path: Path) -> None:
    assert TORQUE in SECOND
    loaded(tmp_path, [after(SECOND + 'adhesion = "Adhesion_A2"')])


def test_status_where_crc_and_counter_are_is_refused(tmp_path: Path) -> None:
    status = [of_yaw_rate('status = "Protected.Torque", ok = [1]')]
    assert refused(tmp_path, status) == (
        "9: axle[1].yaw_rate.status: Protected.Torque lies where the E2E CRC and counter of Protected are — "
        'if it is not protected, write in [[axle]]: yaw_rate = { signal = "Imu1.Gyro", status = "Protected.Torque", '
        'ok = [1], e2e = "none" }'
    )
    loaded(tmp_path, [of_yaw_rate('status = "Protected.Brake", ok = [1]')])


WIDE = """BO_ 800 Wide: 64 Train
 SG_ {which} : 0|72@1+ (1,0) [0|0] "" WRCD
 SG_ Gyro {of} : 72|16@1- (0.01,0) [-300|300] "deg/s" WRCD
"""


@pytest.mark.parametrize(
    ("which", "of", "keys", "said"),
    [
        ("State", "", ', status = "Wide.State", ok = [1]', ".status: Wide.State has 72 bits, at most 64 are read"),
        ("Page M", "m1", "", ".signal: Wide.Page has 72 bits, at most 64 are read"),
        (
            "Status", "", ", scale = 0.01",
            ".signal: Wide.Status is taken for its status and has 72 bits, at most 64 are read — write in [[axle]]: "
            'yaw_rate = { signal = "Wide.Gyro", scale = 0.01, status = false }',
        ),
    ],
)  # fmt: skip
def test_status_or_multiplexer_of_more_than_64_bits_is_refused(
    tmp_path: Path, which: str, of: str, keys: str, said: str
) -> None:
    wide = ("BO_ 256 Imu1", WIDE.format(which=which, of=of) + "\nBO_ 256 Imu1")
    assert refused(tmp_path, [(YAW, f'yaw_rate = {{ signal = "Wide.Gyro"{keys} }}')], [wide]) == (
        f"9: axle[1].yaw_rate{said}"
    )


@pytest.mark.parametrize("torques", [MAX_SIGNALS, MAX_SIGNALS + 1])
def test_message_of_more_signals_than_the_core_reads_is_refused(tmp_path: Path, torques: int) -> None:
    lines = "".join(f' SG_ T{k} : {3 * k}|3@1- (1,0) [-4|3] "kNm" WRCD\n' for k in range(torques))
    many = [("BO_ 256 Imu1", f"BO_ 800 Long: 64 Train\n{lines}\nBO_ 256 Imu1")]
    of_axle = (TORQUE, f"torque = [{', '.join(f'{chr(34)}Long.T{k}{chr(34)}' for k in range(torques))}]")
    if torques <= MAX_SIGNALS:
        assert len(loaded(tmp_path, [of_axle], many).inputs) == torques + 3
        return
    assert refused(tmp_path, [of_axle], many) == (
        "11: axle[1].torque[129]: Long is mapped to 129 inputs, at most 128 are read"
    )
