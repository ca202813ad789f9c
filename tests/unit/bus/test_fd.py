"""CAN FD: frames of up to 64 bytes, from the socket to the sample."""

import random
import struct
from collections.abc import Iterator
from typing import Any

import can
import e2e.p11
import pytest

from tests.support.can_socket import CHANNEL, CanBus
from tests.support.dbc import database
from wrcd.bus import socketcan
from wrcd.bus.batch import FrameBatch, joined
from wrcd.bus.candump import format_line
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.opening import open_link
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source
from wrcd.bus.units import Quantity
from wrcd.core.reading import Receiver, Sample
from wrcd.core.terms import MAX_SIGNALS

IMU_ID = 0x18FF0001
FD_DBC = f"""
BO_ {1 << 31 | IMU_ID} Imu: 62 B
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" B
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" B
 SG_ Yaw : 135|24@0- (0.00001,0) [-80|80] "rad/s" B
 SG_ Lat : 455|32@0- (1,0) [-200|200] "m/s2" B
 SG_ Force : 160|64@1- (0.5,0) [0|0] "N" B
 SG_ Behind : 224|8@1+ (1,0) [0|255] "" B
BO_ 801 Short: 4 B
 SG_ V : 0|16@1+ (0.01,0) [0|100] "m/s" B
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ {1 << 31 | IMU_ID} 4;
BA_ "VFrameFormat" BO_ 801 3;
SIG_VALTYPE_ {1 << 31 | IMU_ID} Lat : 1;
"""
SOURCES = (
    Source("Imu", "Yaw", Quantity.YAW_RATE, (0,)),
    Source("Imu", "Lat", Quantity.LAT_ACCEL, (0,)),
    Source("Imu", "Force", Quantity.AXLE_LOAD, (0,)),
    Source("Short", "V", Quantity.SPEED, (0,)),
)
DBC = database(FD_DBC)
WIRE_BYTES = 64  # 62 filled up to the next length that a DLC can say


def receiver() -> Receiver:
    return Receiver(DBC, SOURCES, {"Imu": 513, "Short": None})


def imu(yaw: float, lat: float, force: float, counter: int) -> bytes:
    """By cantools and autosar-e2e."""
    values = {"Crc": 0, "Counter": counter, "Yaw": yaw, "Lat": lat, "Force": force, "Behind": 255}
    data = bytearray(find_message(DBC, "Imu").encode(values).ljust(WIRE_BYTES, b"\0"))
    e2e.p11.e2e_p11_protect(data, 513, increment_counter=False)
    return bytes(data)


def test_long_frame_is_read_as_cantools_wrote_it() -> None:
    chance, r = random.Random(1), receiver()
    for counter in range(15):
        yaw, force = round(chance.uniform(-80, 80), 5), 0.5 * chance.randrange(1, 2_000_000)
        lat = struct.unpack("<f", struct.pack("<f", chance.uniform(-190, 190)))[0]
        got = r.read(Frame(0, IMU_ID, imu(yaw, lat, force, counter), extended=True, fd=True))
        assert isinstance(got, Reason) == (abs(yaw) > 20)
        if isinstance(got, list):
            assert [s.value for s in got] == pytest.approx([yaw, lat, force])
    assert r.mapped.fd


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (Frame(0, 801, b"\xc4\x09\0\0"), Reason.KIND),
        (Frame(0, IMU_ID, bytes(8), extended=True), Reason.KIND),
        (Frame(0, 801, b"\xc4\x09\0\0\0", fd=True), Reason.LENGTH),
        (Frame(0, IMU_ID, imu(1, 2, 3, 0)[:62], extended=True, fd=True), Reason.LENGTH),
        (Frame(0, IMU_ID, imu(1, 2, 3, 0)[:-1] + b"\1", extended=True, fd=True), Reason.CRC),
    ],
    ids=lambda x: str(x) if isinstance(x, Reason) else "",
)
def test_frame_of_another_kind_or_length_is_rejected(frame: Frame, reason: Reason) -> None:
    assert receiver().read(frame) is reason


def test_short_fd_frame_is_read() -> None:
    assert receiver().read(Frame(0, 801, b"\xc4\x09\0\0", fd=True)) == [Sample(3, 25.0)]


def test_batches_are_joined_whatever_they_hold() -> None:
    classical, long = Frame(1, 0x101, b"12345"), Frame(2, 0x321, bytes(range(12)), fd=True)
    for first in (classical, long):
        for second in (classical, long):
            both = [(f.stamp_us, f.data) for f in joined(FrameBatch.of([first]), FrameBatch.of([second]))]
            assert both == [(f.stamp_us, f.data) for f in (first, second)]


@pytest.mark.parametrize("signals", [64, MAX_SIGNALS])
def test_message_of_many_signals_is_read(signals: int) -> None:
    lines = [f' SG_ S{k} : {4 * k}|4@1+ (1,0) [0|15] "m/s" B\n' for k in range(128)]
    attribute = (
        'BA_DEF_ BO_ "VFrameFormat" INT 0 15;\nBA_DEF_DEF_ "VFrameFormat" "0";\nBA_ "VFrameFormat" BO_ 801 14;\n'
    )
    dbc = database(f"BO_ 801 Long: 64 B\n{''.join(lines)}{attribute}")
    sources = [Source("Long", f"S{k % 128}", Quantity.SPEED, (0,)) for k in range(signals)]
    got = Receiver(dbc, sources).read(Frame(0, 801, bytes(range(64)), fd=True))
    assert isinstance(got, list)
    assert [s.value for s in got] == [(k // 2 >> 4 * (k % 2)) % 16 for k in range(signals)]


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[CanBus]:
    made = CanBus()
    monkeypatch.setattr(socketcan, "socket", made.module)
    yield made
    made.close()


@pytest.mark.parametrize("fd", [True, False])
def test_link_takes_fd_frames_among_classical_ones_where_they_are_wanted(bus: CanBus, fd: bool) -> None:
    link = socketcan.SocketCanLink(CHANNEL, None, fd)
    data = imu(1, 2, 3, 0)
    classical = Frame(0, 0x101, b"12345")
    long = [Frame(0, IMU_ID, data, extended=True, fd=True), Frame(0, 0x321, bytes(range(12)), fd=True)]
    bus.send(*2 * [classical, *long])
    frames = link.receive(1)
    kinds = [(f.can_id, f.data, f.extended, f.fd) for f in frames]
    expected = [(f.can_id, f.data, f.extended, f.fd) for f in [classical, *(long if fd else [])]]
    assert kinds == 2 * expected
    assert all(f.stamp_us > 1_600_000_000_000_000 for f in frames)
    link.close()


def test_link_keeps_the_bits_of_fd_frames_and_the_length_of_remote_ones(bus: CanBus) -> None:
    link = socketcan.SocketCanLink(CHANNEL, None, True)
    bus.send(Frame(0, 0x321, bytes(range(12)), fd=True, extra=0b101), Frame(0, 0x123, b"", remote=True, extra=4))
    lines = [format_line(f, "can0").split(" ", 2)[2] for f in link.receive(1)]
    assert lines == ["321##1000102030405060708090A0B", "123#R4"]
    link.close()


def test_python_can_is_opened_for_fd_where_it_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []
    made = can.Bus

    def bus(**options: Any) -> can.BusABC:
        asked.append(options)
        return made(**options)

    monkeypatch.setattr(can, "Bus", bus)
    r = receiver()
    link = open_link("virtual", "fd-test", r.mapped.keys, fd=r.mapped.fd)
    open_link("virtual", "fd-test", r.mapped.keys).close()
    assert [options.get("fd") for options in asked] == [True, None]
    with made(interface="virtual", channel="fd-test") as other:
        data = imu(1, 2, 3, 0)
        other.send(can.Message(arbitration_id=IMU_ID, is_extended_id=True, is_fd=True, data=data, dlc=64))
        frames = link.receive(0)
    assert [(f.can_id, f.data, f.fd) for f in frames] == [(IMU_ID, data, True)]
    assert isinstance(r.read(frames[0]), list)
    link.close()
