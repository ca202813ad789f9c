"""A third party's DBC on a real kernel's vcan: an extended and a standard id of one number, a CAN FD sensor, an
adhesion of eight bits."""

import os
import re
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cantools
import pytest
from cantools.database.can import Database

from tests.support.metronome import BEFORE_US, SLOT_US, Machine, calm, cycle, metronome, mostly, within
from tests.support.processes import BIN, ROOT, running, stopped, wait_for
from tests.support.rig_frames import ticks_of
from tests.support.vcan import CANDUMP, Node, allow_large_buffers, now_us
from wrcd.bus.frame import Frame
from wrcd.bus.socketcan import SocketCanLink
from wrcd.config.config import load_config
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

CONFIG = ROOT / "tests/data/dbc/third-party.toml"
SECONDS, LEAD_S = 6.0, 0.2
IMU, GYRO, SPEED, CLIMATE = 0x101, 0x18F10201, 0x18F30101, 0x101
WSP = {1: 0x18F40101, 2: 0x18F40201}
IMU_TIMEOUT_US = 15_000  # three cycles of 5 ms, where neither DBC nor mapping says another
EXTENDED = 1 << 31


class Bus:
    """Sends frames of either kind."""

    def __init__(self, channel: str) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")  # hears nothing
        self._socket.bind((channel,))

    def send(self, *packed: bytes) -> None:
        for one in packed:
            self._socket.send(one)

    def close(self) -> None:
        self._socket.close()


def packed(f: Frame) -> bytes:
    """struct can_frame, or struct canfd_frame."""
    word, size = f.can_id | (EXTENDED if f.extended else 0), 64 if f.fd else 8
    return word.to_bytes(4, "little") + bytes([len(f.data), 0, 0, 0]) + f.data.ljust(size, b"\0")


@dataclass
class Recorded:
    """What candump saw, and what the daemon said."""

    log: Path
    frames: list[Frame]
    daemon_says: str
    machine: Machine


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """The train's sensors in real time, and the air conditioning's frames under the standard id of one of them."""
    folder = tmp_path_factory.mktemp("own")
    log = folder / "candump.log"
    climate = packed(Frame(0, CLIMATE, b"\x7f\x03"))
    ticks = ticks_of(load_config(CONFIG), SECONDS)
    sent = [[*map(packed, tick), climate] for tick in ticks]
    bus = Bus("vcan0")
    allow_large_buffers()
    with metronome(0) as machine, running(*CANDUMP, "vcan0", output=log):
        command = (BIN / "wrcd", "run", "--config", CONFIG, "-i", "socketcan", "-c", "vcan0")
        with running(*command) as daemon:
            wait_for("the daemon's first frame", 30, lambda: log.exists() and log.stat().st_size > 0)
            # a train's sensors do not wait for the daemon's processor, as in test_vcan.py
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
            try:
                begin = time.monotonic() + LEAD_S
                for number, tick in enumerate(sent):
                    time.sleep(max(0.0, begin + 0.005 * number - time.monotonic()))
                    bus.send(*tick)
            finally:
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            time.sleep(0.3)
            says = stopped(daemon)
        time.sleep(0.5)
    bus.close()
    return Recorded(log, [f for f, _ in read_log(log, Damage())], says, machine)


def test_only_the_mapped_one_of_two_ids_with_one_number_is_read(recorded: Recorded) -> None:
    sensors = {(IMU, True), (GYRO, True), (0x18F10202, True), (0x18F20101, True), (SPEED, True)}
    mapped = sum((f.can_id, f.extended) in sensors for f in recorded.frames)
    (stopped,) = [line for line in recorded.daemon_says.splitlines() if "stopped;" in line]
    print(recorded.daemon_says)
    assert re.search(r"(\d+) frames accepted, rejected: none", stopped)
    assert f"stopped; {mapped} frames accepted" in stopped


def possible(f: Frame, cycle_us: int, machine: Machine) -> range:
    """The slots that a frame without a counter may have been made for. One that was held up between the daemon's look
    at the clock and the bus is of the slot before, or of one as long ago as the machine may have held it up."""
    held_us = max(cycle_us, BEFORE_US if machine.excuses(f.stamp_us // SLOT_US) else 0)
    return range((f.stamp_us - held_us) // cycle_us, f.stamp_us // cycle_us + 1)


def slots_of(frames: Sequence[Frame], cycle_us: int, machine: Machine) -> list[int]:
    """The slot of each frame, as late as can be. Raises AssertionError where there are more frames than slots."""
    slots: list[int] = []
    for f in reversed(frames):
        may = possible(f, cycle_us, machine)
        slot = min(may[-1], slots[-1] - 1) if slots else may[-1]
        assert slot in may, "a slot was sent twice"
        slots.append(slot)
    return slots[::-1]


def overruns(recorded: Recorded) -> int:
    """What the daemon says that it left out."""
    told = re.search(r"(\d+) overruns", recorded.daemon_says)
    assert told is not None
    return int(told[1])


@pytest.mark.parametrize(("axle", "cycle_us"), [(1, 20_000), (2, 50_000)])
def test_eight_bit_adhesion_is_sent_at_its_own_cycle(recorded: Recorded, axle: int, cycle_us: int) -> None:
    database = cantools.database.load_file(ROOT / "tests/data/dbc/third-party.dbc", encoding="cp1252")
    assert isinstance(database, Database)
    message = database.get_message_by_name(f"WSP_Adhesion{axle}")
    frames = [f for f in recorded.frames if f.extended and f.can_id == message.frame_id == WSP[axle]]
    imu = [f.stamp_us for f in recorded.frames if f.extended and f.can_id == IMU]
    slots = slots_of(frames[:-1], cycle_us, recorded.machine)
    kept = cycle(slots, imu[0], imu[-1], recorded.machine, cycle_us)
    values: list[Any] = [message.decode(f.data) for f in frames]
    good = [v for v in values if str(v["State"]) == "Good"]
    sound = calm(imu, IMU_TIMEOUT_US)
    judged = [str(v["State"]) == "Good" for f, v in zip(frames, values, strict=True) if within(f.stamp_us, sound)]
    print(f"axle {axle}: {kept}; {len(good)} of {len(values)} Good, {sum(judged)} of {len(judged)} undisturbed ones")
    assert len(kept.missing) <= overruns(recorded)
    assert mostly(judged, 0.8, imu[0], imu[-1], recorded.machine)
    assert all(5 < float(v["Friction"]) < 60 for v in good)
    assert all(str(v["Friction"]) == "not available" for v in values if str(v["State"]) == "None")
    assert str(values[-1]["State"]) == "None"


def test_replay_of_candumps_log_gives_what_was_sent(recorded: Recorded, tmp_path: Path) -> None:
    out = tmp_path / "out.log"
    command: list[str | Path] = [BIN / "wrcd", "replay", recorded.log, "--config", CONFIG, "-o", out]
    subprocess.run(command, timeout=300, check=True, capture_output=True)
    made = {(f.can_id, f.stamp_us): f.data for f, _ in read_log(out, Damage())}
    fd = [f.stamp_us for f in recorded.frames if f.fd]
    different: list[tuple[int, Frame, list[bytes | None]]] = []
    compared, settled_us, last_us = 0, min(fd) + 2_500_000, max(fd)
    for axle, cycle_us in ((1, 20_000), (2, 50_000)):
        slots = {stamp // cycle_us: data for (can_id, stamp), data in made.items() if can_id == WSP[axle]}
        of_axle = [f for f in recorded.frames if f.extended and f.can_id == WSP[axle] and f.stamp_us < last_us]
        # the Good ones, and from where they would be in a guest that is not held up, all
        for f in (f for f in of_axle if f.data[1] >> 6 == 1 or f.stamp_us > settled_us):
            made_for = [slots.get(s) for s in possible(f, cycle_us, recorded.machine)]
            if f.data not in made_for:
                different.append((axle, f, made_for))
            compared += 1
    print(f"{compared} frames compared, {overruns(recorded)} left out")
    assert different == []
    assert compared > max(0, 200 - overruns(recorded))  # 245 in 3.5 s


@pytest.fixture
def fd_bus(bus: str) -> Iterator[Bus]:
    made = Bus(bus)
    yield made
    made.close()


def test_link_receives_fd_frames_where_they_are_wanted(bus: str, fd_bus: Bus, node: Node) -> None:
    keys = (0x101 | EXTENDED, 0x102)
    with_fd, without = SocketCanLink(bus, keys, fd=True), SocketCanLink(bus, keys)
    later = SocketCanLink(bus, None)
    before = now_us()
    fd_bus.send(packed(Frame(0, 0x102, bytes(range(48)), fd=True)))
    fd_bus.send(packed(Frame(0, 0x101, bytes(range(64)), extended=True, fd=True)))
    fd_bus.send(packed(Frame(0, 0x101, bytes(range(64)), fd=True)))
    node.send(0x102)
    node.send(0x101)
    got = with_fd.receive(0)
    assert [(f.can_id, f.extended, f.fd, f.data) for f in got] == [
        (0x102, False, True, bytes(range(48))),
        (0x101, True, True, bytes(range(64))),
        (0x102, False, False, b"\x01\x02"),
    ]
    assert all(before <= f.stamp_us <= now_us() for f in got)
    assert [(f.can_id, f.fd) for f in without.receive(0)] == [(0x102, False)]
    assert [f.can_id for f in later.receive(0)] == [0x102, 0x101]
    later.narrow(keys, fd=True)
    fd_bus.send(packed(Frame(0, 0x102, bytes(12), fd=True)))
    node.send(0x101)
    node.send(0x102)
    assert [(f.can_id, len(f.data), f.fd) for f in later.receive(0)] == [(0x102, 12, True), (0x102, 2, False)]
    for link in (with_fd, without, later):
        link.close()
