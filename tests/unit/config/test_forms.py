"""Every form in which the configuration says something of a signal, as the record that it becomes."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import pytest

from tests.unit.config.support import (
    BASE,
    DBC,
    SECOND,
    TORQUE,
    YAW,
    after,
    of_adhesion,
    of_torque,
    of_yaw_rate,
    written,
)
from wrcd import resources
from wrcd.bus.dbc import Database, load_dbc
from wrcd.bus.signals import OutputSignal, StatusRule
from wrcd.bus.units import G, Quantity
from wrcd.config import declared
from wrcd.config.config import load_config
from wrcd.config.describe import describe
from wrcd.config.outputs import STATUS_KEYS, STATUS_MESSAGES, usual_messages
from wrcd.core.configuration import AXLE_OUTPUTS, Config, Input
from wrcd.core.vocabulary import MESSAGES
from wrcd.errors import InputError

THIRD_PARTY = DBC.parent / "third-party.toml"
DEGREES = 0.017453292519943295


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(DBC, tmp_path)
    return tmp_path


def one(config: Config, quantity: Quantity) -> Input:
    (found,) = (i for i in config.inputs if i.source.quantity is quantity)
    return found


def test_short_form_says_nothing_but_the_signal(folder: Path) -> None:
    config = load_config(written(folder, []))
    source = one(config, Quantity.YAW_RATE).source
    assert (source.message, source.signal, source.axles, source.part) == ("Imu1", "Gyro", (0,), 0)
    assert {source.scale, source.offset, source.factor, source.low, source.high, source.reverse} == {None}
    assert (source.invalid, source.statuses) == (frozenset(), ())
    assert config.data_ids == {"Imu1": None, "Tcu": None, "Drive": None}
    assert config.warnings == ()


@pytest.mark.parametrize(
    ("keys", "fields"),
    [
        ("sign = -1", {"factor": -DEGREES}),
        ('unit = "rad/s"', {"factor": 1.0}),
        ("scale = 0.02", {"scale": 0.02, "low": -600.0, "high": 600.0}),
        ("scale = -0.01", {"scale": -0.01, "low": -300.0, "high": 300.0}),
        ("offset = 5", {"offset": 5.0, "low": -295.0, "high": 305.0}),
        ("range = [-20, 30]", {"low": -20.0, "high": 30.0}),
        ("invalid = [0x8000, 7]", {"invalid": frozenset({-32768, 7})}),
    ],
)
def test_table_overrides_the_dbc(folder: Path, keys: str, fields: dict[str, Any]) -> None:
    short = one(load_config(written(folder, [])), Quantity.YAW_RATE).source
    source = one(load_config(written(folder, [of_yaw_rate(keys)])), Quantity.YAW_RATE).source
    expected = replace(short, **fields)  # fields of a Source by name
    assert replace(source, factor=expected.factor, low=expected.low, high=expected.high) == expected
    for got, want in zip(
        (source.factor, source.low, source.high), (expected.factor, expected.low, expected.high), strict=True
    ):
        assert got == (None if want is None else pytest.approx(want))


def test_time_out_is_the_configurations(folder: Path) -> None:
    text = 'speed = { signal = "Drive.V", timeout_ms = 80 }'
    config = load_config(written(folder, [('speed = "Drive.V"', text), of_yaw_rate("timeout_ms = 10")]))
    assert one(config, Quantity.SPEED).timeout_us == 80_000
    assert one(config, Quantity.YAW_RATE).timeout_us == 10_000


@pytest.mark.parametrize(
    ("keys", "ok", "degraded"),
    [
        ('status = "Imu1.Mode", ok = ["On"], degraded = ["Off"]', {1}, {0}),
        ('status = "Imu1.Mode", ok = [1, 5], degraded = [0, "Ok"]', {1, 5}, {0, 2}),
        ('status = "Imu1.Mode", ok = ["on"]', {1}, set()),
        ('status = "Imu1.Mode"', {2}, set()),
    ],
)
def test_status_by_value_and_by_name(folder: Path, keys: str, ok: set[int], degraded: set[int]) -> None:
    config = load_config(written(folder, [of_yaw_rate(keys)]))
    rule = StatusRule("Imu1", "Mode", frozenset(ok), frozenset(degraded))
    assert one(config, Quantity.YAW_RATE).source.statuses == (rule,)
    # a frame is accepted whole or not at all: what one input says of its message holds for all of them
    assert one(config, Quantity.LAT_ACCEL).source.statuses == (rule,)


def test_status_of_another_message_has_a_time_out(folder: Path) -> None:
    config = load_config(written(folder, [of_yaw_rate('status = "StatusImu.SensorState", ok = ["Run"]')]))
    rule = StatusRule("StatusImu", "SensorState", frozenset({0}), frozenset(), 15_000)
    assert one(config, Quantity.YAW_RATE).source.statuses == (rule,)
    assert config.data_ids["StatusImu"] is None


def test_status_that_is_not_to_count_does_not(folder: Path) -> None:
    (edit,) = [(YAW, 'yaw_rate = { signal = "StatusImu.Gyro", status = false }')]
    assert one(load_config(written(folder, [edit])), Quantity.YAW_RATE).source.statuses == ()


def test_torque_at_the_motor_and_brake_add_up(folder: Path) -> None:
    motor = '{ signal = "Tcu.Motor", at = "motor", gear_ratio = 4.6, share = 0.5 }'
    parts = f'{motor}, {{ signal = "Protected.Brake", sign = -1 }}'
    config = load_config(written(folder, [(TORQUE, f"torque = [ {parts} ]")]))
    first, second = (i.source for i in config.inputs if i.source.quantity is Quantity.TORQUE)
    assert (first.part, second.part) == (0, 1)
    assert first.factor == pytest.approx(2.3)
    assert second.factor == pytest.approx(-1000.0)
    assert config.data_ids["Protected"] == 273


def test_force_at_the_rim_is_times_the_wheel_radius(folder: Path) -> None:
    config = load_config(written(folder, [of_torque('signal = "Tcu.Force", at = "rim"')]))
    assert one(config, Quantity.TORQUE).source.factor == pytest.approx(1000 * config.design.r_0)


@pytest.mark.parametrize(("reverse", "raws"), [('["Cab B"]', {1}), ("[0, 3]", {0, 3})])
def test_words_of_direction(folder: Path, reverse: str, raws: set[int]) -> None:
    line = f'speed = "Drive.V"\ndirection = {{ signal = "Drive.Dir", reverse = {reverse} }}'
    config = load_config(written(folder, [('speed = "Drive.V"', line)]))
    assert one(config, Quantity.DIRECTION).source.reverse == frozenset(raws)


@pytest.mark.parametrize(("keys", "identity"), [('e2e = "P11", data_id = 513', 513), ('e2e = "none"', None)])
def test_protection_is_the_configurations(folder: Path, keys: str, identity: int | None) -> None:
    config = load_config(written(folder, [of_torque(f'signal = "Protected.Brake", {keys}')]))
    assert config.data_ids["Protected"] == identity


def test_names_and_words_of_what_is_sent(folder: Path) -> None:
    edit = of_adhesion(
        'message = "Adhesion_A2", cycle_ms = 50, validity = { signal = "Validity", degraded = 0, error = 3 }, '
        'mu_available = { signal = "Kelvin", unit = "%", range = [0, 90], not_available = "NotAvailable" }, '
        'sample_age = { signal = "Age", unit = "s", range = [0, 1] }'
    )
    with pytest.raises(InputError, match=r"adhesion\.sample_age"):
        load_config(written(folder, [edit]))
    edit = (edit[0], edit[1].replace(', sample_age = { signal = "Age", unit = "s", range = [0, 1] }', ""))
    output = load_config(written(folder, [edit])).axles[0].adhesion
    assert (output.message, output.cycle_us, output.data_id) == ("Adhesion_A2", 50_000, None)
    assert output.signals == {
        "Validity": OutputSignal("Validity", words={"NotAvailable": 0, "Valid": 1, "Degraded": 0, "Error": 3}),
        "MuAvailable": OutputSignal("Kelvin", not_available=255, round_down=True, low=0.0, high=90.0),
    }


def test_share_of_one_is_a_unit_of_adhesion(folder: Path) -> None:
    keys = 'signal = "Unnamed", unit = "1", range = [0, 1], not_available = 65535'
    output = load_config(written(folder, [of_adhesion(f"mu_available = {{ {keys} }}")])).axles[0].adhesion
    assert output.signals["MuAvailable"].factor == pytest.approx(0.01)


def test_axles_may_have_cycles_of_their_own(folder: Path) -> None:
    second = after(SECOND + 'adhesion = { message = "Adhesion_A2", cycle_ms = 100 }')
    assert [a.adhesion.cycle_us for a in load_config(written(folder, [second])).axles] == [20_000, 100_000]


def test_tables_may_stand_below_their_axle(folder: Path) -> None:
    text = BASE.replace(YAW, "") + '[axle.yaw_rate]\nsignal = "Imu1.Gyro"\nsgn = -1\n'
    path = folder / "train.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"train.toml:{text.count(chr(10))}: axle\[1\].yaw_rate.sgn: "):
        load_config(path)


def test_third_party_train_is_mapped() -> None:
    config = load_config(THIRD_PARTY)
    assert [a.adhesion.cycle_us for a in config.axles] == [20_000, 50_000]
    (second,) = (i.source for i in config.inputs if i.source.quantity is Quantity.LAT_ACCEL and i.source.axles == (1,))
    assert second.factor == -1.0
    first = next(i.source for i in config.inputs if i.source.quantity is Quantity.LAT_ACCEL)
    assert (first.factor, G) == (None, 9.80665)
    lines = "\n".join(describe(config))
    assert "0x00000101 RS1_Sensorik.Drehrate (deg/s), stale after 15 ms" in lines
    assert "if RS1_Sensorik.Zustand is 1 (Messbetrieb), degraded if 2 (eingeschränkt)" in lines
    assert "RS2_Beschl.Querbeschl (no unit in the DBC), times -1 to m/s2" in lines
    assert "MuAvailable in Friction: not available 255" in lines


def test_two_messages_of_one_identity_are_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A DBC that says so is refused as a file; other formats are not looked through."""

    def doubled(path: Path, encoding: str | None = None) -> Database:
        database = load_dbc(path, encoding=encoding)
        database.get_message_by_name("Drive").frame_id = 256
        return database

    with monkeypatch.context() as patched:
        patched.setattr("wrcd.config.config.load_dbc", doubled)
        with pytest.raises(InputError, match=r"speed: .*0x100.*Imu1"):
            load_config(written(folder, []))
    with_extended = after('axle_load = "Extended.Load"')  # 0x100, too
    assert len(load_config(written(folder, [with_extended])).inputs) == 5


def test_interfaces_are_python_cans_own() -> None:
    own = {name for name, (module, _) in can.interfaces.BACKENDS.items() if module.startswith("can.")}
    assert set(declared.INTERFACES) == own


def test_what_is_told_is_what_the_packaged_dbc_has() -> None:
    packaged = load_dbc(resources.DBC)
    usual = dict(zip(AXLE_OUTPUTS, usual_messages(3), strict=True))
    for kind, name in {**usual, **dict(zip(STATUS_KEYS, STATUS_MESSAGES, strict=True))}.items():
        signals = {s.name for s in packaged.get_message_by_name(name).signals} - {"Crc", "Counter"}
        assert signals == set(MESSAGES[kind]), name
