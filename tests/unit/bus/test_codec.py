"""A frame is accepted whole or refused with its reason, with the packaged DBC and with a train's own."""

import math
import struct
from pathlib import Path
from typing import Any

import pytest

from tests.support.can_ids import ADHESION_A1, YAW_RATE_A1, YAW_RATE_A2
from tests.support.dbc import DIRECTION_AND_LOAD_DBC, TRAIN_DBC, database
from wrcd import resources
from wrcd.bus.dbc import Database, find_message, load_dbc
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import Mapped
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity
from wrcd.bus.writers import Value, Writer
from wrcd.core.reading import Receiver, Sample

STATUS = StatusRule("YawRate_A1", "Status", frozenset({0}), frozenset({1}))


@pytest.fixture(scope="module")
def production() -> Database:
    return load_dbc(resources.DBC)


def yaw_receiver(production: Database) -> Receiver:
    return Receiver(production, [Source("YawRate_A1", "YawRate", Quantity.YAW_RATE, (0,), statuses=(STATUS,))])


def yaw(raw: int = 1000, status: int = 0, counter: int = 0) -> bytes:
    return protect(bytes([0, status << 4]) + struct.pack("<i", raw)[:3], YAW_RATE_A1, counter)


def test_good_frame_gives_its_sample(production: Database) -> None:
    got = yaw_receiver(production).read(Frame(0, YAW_RATE_A1, yaw(-1234)))
    assert got == [Sample(0, -1234 * 1e-6, degraded=False, contested=False)]


def test_degraded_status_is_in_the_sample(production: Database) -> None:
    got = yaw_receiver(production).read(Frame(0, YAW_RATE_A1, yaw(status=1)))
    assert isinstance(got, list)
    assert got[0].degraded


def test_frame_of_the_other_id_length_is_another_message(production: Database) -> None:
    assert yaw_receiver(production).read(Frame(0, YAW_RATE_A1, yaw(), extended=True)) is None


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (Frame(0, YAW_RATE_A1, yaw()[:4]), Reason.LENGTH),
        (Frame(0, YAW_RATE_A1, yaw() + b"\0"), Reason.LENGTH),
        (Frame(0, YAW_RATE_A1, b""), Reason.LENGTH),
        (Frame(0, YAW_RATE_A1, yaw(), remote=True), Reason.KIND),
        (Frame(0, YAW_RATE_A1, b"", remote=True, extra=15), Reason.KIND),  # that a DLC asks for
        (Frame(0, YAW_RATE_A1, yaw(), fd=True), Reason.KIND),
        (Frame(0, YAW_RATE_A1, bytes([yaw()[0] ^ 1]) + yaw()[1:]), Reason.CRC),
        (Frame(0, YAW_RATE_A1, yaw(status=14)), Reason.STATUS),
        (Frame(0, YAW_RATE_A1, yaw(status=15)), Reason.STATUS),
        (Frame(0, YAW_RATE_A1, yaw(status=7)), Reason.STATUS),
        (Frame(0, YAW_RATE_A1, yaw(raw=-(1 << 23))), Reason.RANGE),
    ],
    ids=lambda x: str(x) if isinstance(x, Reason) else "",
)
def test_bad_frame_is_rejected_with_its_reason(production: Database, frame: Frame, reason: Reason) -> None:
    assert yaw_receiver(production).read(frame) is reason


def test_unmapped_frame_is_ignored(production: Database) -> None:
    receiver = yaw_receiver(production)
    assert receiver.read(Frame(0, YAW_RATE_A2, bytes(5))) is None
    # an error frame's class looks like an id
    assert receiver.read(Frame(0, YAW_RATE_A1, bytes(8), error=True)) is None


def test_own_dbc_is_decoded_to_si_units(tmp_path: Path) -> None:
    (tmp_path / "own.dbc").write_text(TRAIN_DBC)
    database = load_dbc(tmp_path / "own.dbc")
    sources = [
        Source("Bogie1", "Gyro", Quantity.YAW_RATE, (0,)),
        Source("Bogie1", "Side", Quantity.LAT_ACCEL, (0,)),
        Source("Bogie1", "Tractive", Quantity.TORQUE, (0,)),
        Source("Drive", "V", Quantity.SPEED, (0, 1)),
    ]
    receiver = Receiver(database, sources)
    bogie = find_message(database, "Bogie1").frame_id
    got = receiver.read(Frame(0, bogie, struct.pack("<hhhh", 150, -100, 55, 0), extended=True))
    assert isinstance(got, list)
    assert [s.value for s in got] == pytest.approx([math.radians(1.5), -0.980665, 5500.0])
    assert [s.source for s in got] == [0, 1, 2]
    speed = receiver.read(Frame(0, 800, struct.pack(">H", 9000)))
    assert isinstance(speed, list)
    assert speed[0].value == pytest.approx(25.0)
    assert sources[speed[0].source].axles == (0, 1)
    # one signal out of range refuses the whole frame, and a value named "not available" is none
    assert receiver.read(Frame(0, bogie, struct.pack("<hhhh", 150, -100, 2000, 0), extended=True)) is Reason.RANGE
    assert receiver.read(Frame(0, 800, b"\xff\xff")) is Reason.STATUS


SENSOR_DBC = """VERSION ""
BU_: A
BO_ 1 Tight: 2 A
 SG_ S : 0|16@1- (0.01,0) [-20|20] "m/s2" A
BO_ 2 Wide: 2 A
 SG_ S : 0|16@1- (0.01,0) [-1000|1000] "m/s2" A
BO_ 3 Open: 2 A
 SG_ S : 0|16@1- (0.01,0) [0|0] "m/s2" A
BO_ 4 Float: 4 A
 SG_ S : 0|32@1- (1,0) [-20.1|20.1] "m/s2" A
BO_ 5 OneSided: 2 A
 SG_ S : 0|16@1+ (0.01,0) [0|20] "m/s2" A
VAL_ 2 S 32767 "NotAvailable" ;
SIG_VALTYPE_ 4 S : 1;
"""


@pytest.mark.parametrize(
    ("source", "last_within", "first_at"),
    [
        ({"message": "Tight"}, 19.99, 20.0),
        ({"message": "Tight", "factor": -1.0, "low": -10.0, "high": 30.0}, 9.99, 10.0),  # turned round: its lower end
        ({"message": "Wide"}, 327.65, 327.66),  # the field holds no more, and its last value is a word
        ({"message": "Open"}, 327.66, 327.67),
        ({"message": "Float"}, 20.0999, struct.unpack("<f", struct.pack("<f", 20.1))[0]),
    ],
    ids=lambda x: str(x["message"]) if isinstance(x, dict) else "",
)
def test_range_ends_at_its_last_step(
    tmp_path: Path, source: dict[str, Any], last_within: float, first_at: float
) -> None:
    (tmp_path / "own.dbc").write_text(SENSOR_DBC)
    sources = [Source(signal="S", quantity=Quantity.LAT_ACCEL, axles=(0,), **source)]
    ((_, upper),) = [s.ends for s in Mapped(load_dbc(tmp_path / "own.dbc"), sources).signals]
    assert last_within < upper <= first_at


@pytest.mark.parametrize(
    ("field", "unit", "quantity", "cases"),
    [
        # the longest whole numbers
        ("64@1- (1,0) [0|0]", "Nm", Quantity.TORQUE, {-1: -1.0, -1000: -1000.0, 1000: 1000.0}),
        ("8@1- (1,0) [0|0]", "Nm", Quantity.TORQUE, {-128: -128.0, -1: -1.0, 64: 64.0, 127: 127.0}),
        # half a step beyond a range belongs to it
        ("16@1- (1,0) [-10.5|20.5]", "Nm", Quantity.TORQUE, {-12: None, -11: -11.0, 21: 21.0, 22: None}),
        ("64@1- (1,0) [0|0]", "N", Quantity.AXLE_LOAD, {0: None, 1_000_000: 1e6, 1_000_001: None}),
        # a load or radius is larger than nothing, however small
        ("16@1+ (0.01,0) [0|0]", "N", Quantity.AXLE_LOAD, {0: None, 1: 0.01}),
        ("16@1+ (0.01,0) [0|0]", "m", Quantity.WHEEL_RADIUS, {0: None, 1: 0.01}),
        # no words: a direction's sign
        ("16@1- (0.01,0) [0|0]", "", Quantity.DIRECTION, {-1: -1.0, 0: 1.0, 1: 1.0}),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_number_is_read_or_out_of_range(
    field: str, unit: str, quantity: Quantity, cases: dict[int, float | None]
) -> None:
    dbc = database(f'BO_ 800 M: 8 B\n SG_ S : 0|{field} "{unit}" B\n')
    for raw, value in cases.items():
        got = Receiver(dbc, [Source("M", "S", quantity, (0,))]).read(Frame(0, 800, struct.pack("<q", raw)))
        assert got == (Reason.RANGE if value is None else [Sample(0, value)])


def test_floating_point_number_of_16_bits_is_read_down_to_the_smallest() -> None:
    """Also where one of its values is a word."""
    text = 'BO_ 800 M: 8 B\n SG_ S : 0|16@1- (1,0) [0|0] "Nm" B\nSIG_VALTYPE_ 800 S : 1;\nVAL_ 800 S 512 "SNA" ;\n'
    read = Receiver(database(text), [Source("M", "S", Quantity.TORQUE, (0,))]).read
    for raw in (0x0000, 0x0001, 0x8001, 0x03FF, 0x0400, 0x3C00, 0x6001, 0x7BFF, 0xFBFF):
        data = raw.to_bytes(8, "little")
        assert read(Frame(0, 800, data)) == [Sample(0, *struct.unpack_from("<e", data))]
    assert read(Frame(0, 800, struct.pack("<e6x", 512.0))) is Reason.STATUS
    assert {read(Frame(0, 800, struct.pack("<H6x", raw))) for raw in (0x7C00, 0x7C01, 0xFC00)} == {Reason.NOT_FINITE}


@pytest.mark.parametrize(("bits", "kind", "form"), [(32, 1, "<f4x"), (64, 2, "<d")])
def test_floating_point_number_of_more_bits_is_read(bits: int, kind: int, form: str) -> None:
    dbc = database(f'BO_ 800 M: 8 B\n SG_ S : 0|{bits}@1- (1,0) [0|0] "Nm" B\nSIG_VALTYPE_ 800 S : {kind};\n')
    source = Source("M", "S", Quantity.TORQUE, (0,))
    for number in (-1234.5, 0.25, 65536.5):
        assert Receiver(dbc, [source]).read(Frame(0, 800, struct.pack(form, number))) == [Sample(0, number)]


def test_zero_is_no_end_of_a_range(tmp_path: Path) -> None:
    (tmp_path / "own.dbc").write_text(SENSOR_DBC)
    mapped = Mapped(load_dbc(tmp_path / "own.dbc"), [Source("OneSided", "S", Quantity.LAT_ACCEL, (0,))])
    ((lower, upper),) = [s.ends for s in mapped.signals]
    assert lower == -math.inf
    assert 19.99 < upper < 20.0


@pytest.mark.parametrize(
    ("payload", "expected"),
    [
        ("00e80300", [1.0, 100_000.0]),
        ("01e80300", [-1.0, 100_000.0]),
        ("03e80300", Reason.STATUS),
        ("00000000", Reason.RANGE),
    ],
)
def test_direction_and_load_are_decoded_or_rejected(
    tmp_path: Path, payload: str, expected: list[float] | Reason
) -> None:
    (tmp_path / "own.dbc").write_text(DIRECTION_AND_LOAD_DBC)
    sources = [Source("State", "Dir", Quantity.DIRECTION, (0,)), Source("State", "Load", Quantity.AXLE_LOAD, (0,))]
    got = Receiver(load_dbc(tmp_path / "own.dbc"), sources).read(Frame(0, 800, bytes.fromhex(payload)))
    if isinstance(got, list):
        assert [s.value for s in got] == pytest.approx(expected)
    else:
        assert got is expected


def test_bit_pattern_in_the_value_table_of_a_signed_signal_is_no_measurement() -> None:
    dbc = database(
        'BO_ 800 M: 3 B\n SG_ Rate : 0|16@1- (0.0001,0) [-4|4] "rad/s" B\n SG_ Dir : 16|2@1- (1,0) [-2|1] "" B\n'
        'VAL_ 800 Rate 32768 "SNA" ;\nVAL_ 800 Dir 0 "Forward" 3 "Reverse" ;\n'
    )
    rate, way = Source("M", "Rate", Quantity.YAW_RATE, (0,)), Source("M", "Dir", Quantity.DIRECTION, (0,))
    assert Receiver(dbc, [rate]).read(Frame(0, 800, b"\x00\x80\0")) is Reason.STATUS
    assert isinstance(Receiver(dbc, [rate]).read(Frame(0, 800, b"\x01\x80\0")), list)
    assert Receiver(dbc, [way]).read(Frame(0, 800, b"\0\0\x03")) == [Sample(0, -1.0)]


def test_direction_is_told_by_words_of_any_number() -> None:
    dbc = database(
        'BO_ 800 M: 1 B\n SG_ Way : 0|4@1+ (1,0) [0|15] "" B\nVAL_ 800 Way 0 "Forward" 2 "Reverse" 5 "Backward" ;\n'
    )
    for factor, sign in ((None, 1), (0.05, 1), (-0.05, -1)):
        way = Source("M", "Way", Quantity.DIRECTION, (0,), factor=factor)
        got = [Receiver(dbc, [way]).read(Frame(0, 800, bytes([raw]))) for raw in (0, 1, 2, 5)]
        assert got == [[Sample(0, sign * value)] for value in (1.0, 1.0, -1.0, -1.0)]


def test_words_that_no_field_can_say_are_none() -> None:
    """Tables of others have bit patterns of longer fields."""
    dbc = database(
        'BO_ 800 M: 8 B\n SG_ Rate : 0|8@1- (0.1,0) [-10|10] "rad/s" B\n'
        f'VAL_ 800 Rate {1 << 65} "SNA" {(1 << 64) - 1} "Error" {-(1 << 63) - 1} "Invalid" ;\n'
        'BO_ 801 W: 8 B\n SG_ Way : 0|64@1+ (1e-12,0) [0|0] "" B\n'
        f'VAL_ 801 Way {(1 << 64) - 1} "Reverse" {1 << 65} "Backward" ;\n'
    )
    rate, way = Source("M", "Rate", Quantity.YAW_RATE, (0,)), Source("W", "Way", Quantity.DIRECTION, (0,))
    assert Receiver(dbc, [rate]).read(Frame(0, 800, b"\xff" + bytes(7))) == [Sample(0, -0.1)]
    assert Receiver(dbc, [way]).read(Frame(0, 801, b"\xff" * 8)) == [Sample(0, -1.0)]
    assert Receiver(dbc, [way]).read(Frame(0, 801, bytes(8))) == [Sample(0, 1.0)]


def test_id_that_no_frame_has_is_not_one_of_fewer_bits() -> None:
    dbc = database('BO_ 800 M: 1 B\n SG_ V : 0|8@1+ (1,0) [0|255] "m/s" B\n')
    speed = Source("M", "V", Quantity.SPEED, (0,))
    assert Receiver(dbc, [speed]).read(Frame(0, 800, b"\1")) == [Sample(0, 1.0)]
    assert Receiver(dbc, [speed]).read(Frame(0, 800 + 2048, b"\1")) is None


def test_adhesion_frame_is_encoded_and_protected(production: Database) -> None:
    message = find_message(production, "Adhesion_A1")
    values: dict[str, Value] = {
        "Validity": "Valid", "MuAvailable": 38.394, "MuUsed": None, "SampleAge": 9.0, "Surface": "Dry",
        "ContactState": "Saturated", "Confidence": "Within2pp",
    }  # fmt: skip
    frame = Writer(message).frame(123, 17, values)
    decoded = message.decode(frame.data)
    assert isinstance(decoded, dict)
    assert (frame.can_id, frame.stamp_us, decoded["Counter"]) == (ADHESION_A1, 123, 2)
    assert protect(frame.data, ADHESION_A1, 2) == frame.data
    assert decoded["MuAvailable"] == pytest.approx(38.39)
    assert str(decoded["MuUsed"]) == "NotAvailable"
    assert {k: str(decoded[k]) for k in ("Validity", "Surface", "ContactState", "Confidence")} == {
        "Validity": "Valid",
        "Surface": "Dry",
        "ContactState": "Saturated",
        "Confidence": "Within2pp",
    }


@pytest.mark.parametrize(("value", "raw"), [(-1.0, 0), (1e9, 10_000), (math.nan, 0xFFFF), (math.inf, 0xFFFF)])
def test_value_beyond_its_field_is_limited_or_not_available(production: Database, value: float, raw: int) -> None:
    message = find_message(production, "Adhesion_A1")
    frame = Writer(message).frame(0, 0, {"MuAvailable": value})
    assert struct.unpack_from("<H", frame.data, 2)[0] == raw
