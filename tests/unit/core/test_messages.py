"""What is sent in a train's own messages: names, words, units, ids, cycles."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import cantools
import pytest
from cantools.database.can import Database

from tests.support.dbc import database
from tests.support.sensor_simulator import SensorSimulator
from tests.support.told_stages import level_of, packed
from wrcd import resources
from wrcd.bus.dbc import find_message, find_signal
from wrcd.bus.frame import Frame
from wrcd.bus.signals import Output, OutputSignal
from wrcd.bus.writers import SignalWriter, Value, Writer
from wrcd.config.config import load_config
from wrcd.core.reports import Outgoing
from wrcd.core.vocabulary import snake

OWN_ID = 0x18FF0601
OWN = f"""
BO_ {1 << 31 | OWN_ID} WSP_Adhesion1: 4 Controller
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" Controller
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" Controller
 SG_ Friction : 23|8@0+ (0.5,0) [0|100] "%" Controller
 SG_ State : 13|2@0+ (1,0) [0|3] "" Controller
BO_ 1633 WSP_Adhesion2: 2 Controller
 SG_ Friction : 0|8@1+ (0.005,0) [0|1] "" Controller
 SG_ State : 8|8@1+ (1,0) [0|255] "" Controller
VAL_ {1 << 31 | OWN_ID} State 0 "Init" 1 "Good" 2 "Poor" 3 "Err" ;
"""
WORDS = "valid = {}, degraded = {}, not_available = {}"
CONFIG = f"""
[dbc]
file = "own.dbc"
[wheelset]
name = "multiple-unit"
[vehicle]
speed = "VehicleSpeed.Speed"
[[axle]]
number = 1
yaw_rate = "YawRate_A1.YawRate"
lateral_acceleration = "LatAccel_A1.LatAccel"
torque = "Torque_A1.Torque"
[axle.adhesion]
message = "WSP_Adhesion1"
cycle_ms = 50
e2e = "P11"
data_id = 0x301
mu_available = {{ signal = "Friction", not_available = 255 }}
validity = {{ signal = "State", {WORDS.format('"Good"', '"Poor"', '"Init"')} }}
[[axle]]
number = 2
yaw_rate = "YawRate_A2.YawRate"
lateral_acceleration = "LatAccel_A2.LatAccel"
torque = "Torque_A2.Torque"
[axle.adhesion]
message = "WSP_Adhesion2"
cycle_ms = 30
mu_available = {{ signal = "Friction", unit = "1", not_available = 255 }}
validity = {{ signal = "State", {WORDS.format(7, 8, 9)} }}
"""


def of(out: Sequence[Outgoing], can_id: int) -> list[Frame]:
    return [o.frame for o in out if o.frame.can_id == can_id]


def test_own_messages_are_sent_with_their_names_words_and_cycles(tmp_path: Path) -> None:
    text = resources.DBC.read_text("cp1252")
    assert "\nCM_ " in text
    (tmp_path / "own.dbc").write_text(text.replace("\nCM_ ", f"{OWN}\nCM_ ", 1), "cp1252")
    (tmp_path / "train.toml").write_text(CONFIG)
    sim = SensorSimulator(load_config(tmp_path / "train.toml"))
    sim.run(3000)
    database = cantools.database.load_file(tmp_path / "own.dbc")
    assert isinstance(database, Database)
    first, second = of(sim.out, OWN_ID), of(sim.out, 1633)
    assert all(f.extended for f in first)
    assert not any(f.extended for f in second)
    for frames, cycle_us in ((first, 50_000), (second, 30_000)):
        assert {b.stamp_us - a.stamp_us for a, b in pairwise(frames)} == {cycle_us}
        assert {o.cycle_us for o in sim.out if o.frame in frames} == {cycle_us}
    assert {f.data[1] & 0x0F for f in first} == set(range(15))
    assert [f.data[1] & 0x0F for f in first] == [f.stamp_us // 50_000 % 15 for f in first]
    last = database.get_message_by_name("WSP_Adhesion1").decode(first[-1].data)
    assert isinstance(last, dict)
    assert str(last["State"]) == "Good"
    (report, absent) = sim.core.reports
    assert report.mu_available_pct is not None
    assert float(str(last["Friction"])) == report.mu_available_pct // 0.5 * 0.5  # rounded down
    assert absent.mu_available_pct is None
    assert second[-1].data == bytes([255, 9])
    # the last ones have each message's own next counter
    by_id = {f.can_id: f for f in sim.core.shutdown_frames(sim.t)}
    assert by_id[OWN_ID].data[1] & 0x0F == (sim.t // 50_000 + 1) % 15
    assert by_id[OWN_ID].data[2:] == bytes([255, 0])
    assert by_id[1633].data == bytes([255, 9])


def field(sent: OutputSignal, extra: str = "") -> SignalWriter:
    dbc = database(f'BO_ 800 M: 2 B\n SG_ X : 0|8@1+ (0.5,10) [10|137] "%" B\n{extra}')
    return SignalWriter(find_signal(find_message(dbc, "M"), "X"), 2, sent)


@pytest.mark.parametrize(
    ("sent", "value", "raw"),
    [
        (OutputSignal("X"), 20.0, 20),
        (OutputSignal("X"), 20.4, 21),
        (OutputSignal("X", round_down=True), 20.4, 20),
        (OutputSignal("X", factor=-1.0), -20.4, 21),
        (OutputSignal("X", factor=-1.0, round_down=True), -20.4, 21),  # the smaller of ours
        (OutputSignal("X"), 3.0, 0),
        (OutputSignal("X", round_down=True, not_available=200), 3.0, 200),  # 10 would be more than it is
        (OutputSignal("X", low=30.0), 3.0, 40),
        (OutputSignal("X", high=30.0), 90.0, 40),
        (OutputSignal("X", not_available=255, high=1e9), 500.0, 254),
        (OutputSignal("X", not_available=0, low=-1e9), 3.0, 1),
        (OutputSignal("X", not_available=200), None, 200),
        (OutputSignal("X", not_available=200), float("nan"), 200),
        (OutputSignal("X"), None, 255),
        (OutputSignal("X", not_available=200), "NoSuchWord", 200),
        (OutputSignal("X"), "NoSuchWord", 255),
        (OutputSignal("X", words={"Good": 3, "NotAvailable": 4}), "Good", 3),
        (OutputSignal("X", words={"Good": 3, "NotAvailable": 4}), "Bad", 4),
    ],
)
def test_value_is_sent_as_its_raw_one(sent: OutputSignal, value: Value, raw: int) -> None:
    assert field(sent).raw(value) == raw
    if not isinstance(value, str):
        assert packed([field(sent)], bytes(2), [value]) == bytes([raw, 0])


def test_word_that_the_dbc_lacks_goes_out_as_not_available() -> None:
    table = 'VAL_ 800 X 1 "Good" 9 "NotAvailable" ;\n'
    assert field(OutputSignal("X"), table).raw("Better") == 9
    message = find_message(database(f'BO_ 800 M: 1 B\n SG_ X : 0|8@1+ (1,0) [0|255] "" B\n{table}'), "M")
    assert Writer(message, Output("M", 1, None, {"Ours": OutputSignal("X")})).frame(0, 0, {"Ours": "x"}).data == b"\x09"


def test_every_report_of_the_default_configuration_has_its_word() -> None:
    """None of ours goes out as not available by a typing error."""
    config = load_config(None)
    sim = SensorSimulator(config)
    sim.run(200)
    output = config.axles[0].adhesion
    assert {snake(name) for name in sim.core.reports[0].values()} == {snake(name) for name in output.signals}


@pytest.mark.parametrize(
    ("half_width_pp", "before", "level"),
    [
        (0.95, "None", "Within1pp"), (0.95, "Within1pp", "Within1pp"), (0.95, "Within2pp", "Within2pp"),
        (0.95, "Within3pp", "Within2pp"), (0.89, "Within3pp", "Within1pp"), (2.9, "Wider", "Within5pp"),
        (2.9, "Within2pp", "Within3pp"), (11.0, "Within12pp", "Within12pp"), (11.0, "Wider", "Wider"),
        (40.0, "Within1pp", "Wider"), (None, "Within1pp", "None"),
    ],
)  # fmt: skip
def test_level_is_left_for_a_narrower_one_with_a_tenth_of_room_alone(
    half_width_pp: float | None, before: str, level: str, sim: SensorSimulator
) -> None:
    sim.run(1500)
    assert level_of(sim, half_width_pp, before) == level
