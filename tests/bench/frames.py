"""Frames in and out, over a pair of datagram sockets that carry struct can_frame, against python-can and cantools.

The kernel's part of a raw CAN socket is left out; what remains is the same system calls, with the same time stamps.
"""

import socket
import time
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice
from typing import Any

import can
import cantools
from can.interfaces.socketcan import SocketcanBus
from cantools.database.can import Database

from tests.bench.timing import Case, Goal, Row, in_turn, show
from tests.bench.workload import LENGTH_US, TICK_US, frames
from wrcd import resources
from wrcd.bus.codec import Receiver, Sample, Value, Writer
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.rawcan import FRAME
from wrcd.bus.reasons import Reason
from wrcd.bus.socketcan import SocketCanLink
from wrcd.config.config import load_config
from wrcd.core.inputs import Inputs

BATCH = 8  # frames of a turn: yaw rates and lateral accelerations of four axles; a datagram pair holds ten
BATCHES = 40  # of a block
SPEED_ID = 0x130
ADHESION: dict[str, Value] = {
    "Validity": "Valid", "MuAvailable": 23.4, "MuUsed": 5.67, "SampleAge": 5.0, "Surface": "Dry",
    "ContactState": "Adhering", "Confidence": "Within3pp",
}  # fmt: skip


def pair() -> tuple[socket.socket, socket.socket]:
    """Both ends; what is read from either carries the kernel's time stamp."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)


class PairLink(SocketCanLink):
    """The daemon's own link, with one end of a pair in the place of the raw CAN socket."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        super().__init__("lo", None)  # rtnetlink tells of an interface that is up

    def _open(self) -> socket.socket:
        self._end.setblocking(False)
        self._stamp(self._end)
        return self._end

    def _set(self, option: int, value: int | bytes | None, now_us: int) -> None:
        """A datagram socket has no option of a raw CAN socket."""


class PairBus(SocketcanBus):
    """python-can's own bus, with one end of a pair in the place of its socket. What it reads and sends is its own."""

    def __init__(self, end: socket.socket) -> None:
        self.socket = end
        self.socket.setsockopt(socket.SOL_SOCKET, 35, 1)  # SO_TIMESTAMPNS
        self.channel, self.channel_info = "bench0", "socketcan channel 'bench0'"
        self._bcm_sockets: dict[str, socket.socket] = {}
        can.BusABC.__init__(self, channel=self.channel)

    def _apply_filters(self, filters: Any) -> None:
        self._is_filtered = True  # as where the kernel filters


class Ours:
    """Bytes to checked samples: the link's receive, then CRC, counter, status, range, plausibility."""

    def __init__(self, end: socket.socket) -> None:
        config = load_config(None)
        self._link = PairLink(end)
        self._receiver = Receiver(config.database, [i.source for i in config.inputs])
        self._inputs = Inputs(config)
        self.rejected = 0
        # the train moves: whether a sensor stands still is looked at
        speed = next(f for f in frames() if f.can_id == SPEED_ID)
        samples = self._receiver.read(speed)
        assert isinstance(samples, list)
        self._inputs.accept(samples[0], 0)

    def take(self, stamp_us: int) -> list[Sample]:
        """Samples of what the socket holds. Frames are judged as if they came at stamp_us: a bench has no patience."""
        out: list[Sample] = []
        for frame in self._link.receive(stamp_us):
            got = self._receiver.read(frame)
            if isinstance(got, Reason) or got is None or self._inputs.check(got, stamp_us):
                self.rejected += 1
            else:
                out += got
        return out

    def close(self) -> None:
        self._link.close()


class Peer:
    """python-can's recv, then cantools' decode_message: no E2E, no range, no plausibility."""

    def __init__(self, end: socket.socket, database: Database) -> None:
        self._bus, self._database = PairBus(end), database

    def take(self, count: int) -> list[dict[str, Any]]:
        """Decoded signals of so many frames."""
        out: list[dict[str, Any]] = []
        for _ in range(count):
            m = self._bus.recv(0.0)
            assert m is not None
            # a bytearray is no bytes to the types, and a conversion would be the bench's own cost
            out.append(self._database.decode_message(m.arbitration_id, m.data, decode_choices=False))  # type: ignore[arg-type]
        return out

    def close(self) -> None:
        self._bus.shutdown()


def packed(frame: Frame) -> bytes:
    """struct can_frame."""
    return FRAME.pack(frame.can_id, len(frame.data), frame.data.ljust(8, b"\0"))


def sensor_batches() -> list[list[Frame]]:
    """The sensors' frames of each tick of the stretch."""
    out: dict[int, list[Frame]] = {}
    first_us = None
    for f in frames():
        first_us = f.stamp_us if first_us is None else first_us
        if f.stamp_us - first_us >= LENGTH_US:
            break
        if 0x100 < f.can_id < 0x120:
            out.setdefault((f.stamp_us - first_us) // TICK_US, []).append(f)
    return [b for b in out.values() if len(b) == BATCH]


def database() -> Database:
    """As a user of cantools loads it."""
    out = cantools.database.load_file(resources.DBC)
    assert isinstance(out, Database)
    return out


def rows() -> Iterator[Row]:
    """Frame in, then frame out; times are per frame."""
    yield _frame_in()
    yield _frame_out()


def _frame_in() -> Row:
    show("frames in")
    batches = sensor_batches()
    bytes_of = [[packed(f) for f in b] for b in batches]
    ours, peer, bare = (pair() for _ in range(3))
    link = Ours(ours[0])
    reader = Peer(peer[0], database())
    bare[0].setblocking(False)
    place = {"ours": 0}

    def run_ours(count: int) -> int:
        spent = 0
        for _ in range(max(1, count // BATCH)):
            number = place["ours"] = place["ours"] + 1
            _send(ours[1], bytes_of[number % len(bytes_of)])
            begin = time.process_time_ns()
            link.take(number * TICK_US)
            spent += time.process_time_ns() - begin
        return spent

    def run_peer(count: int) -> int:
        spent = 0
        for i in range(max(1, count // BATCH)):
            _send(peer[1], bytes_of[i % len(bytes_of)])
            begin = time.process_time_ns()
            reader.take(BATCH)
            spent += time.process_time_ns() - begin
        return spent

    def run_bare(count: int) -> int:
        spent = 0
        for i in range(max(1, count // BATCH)):
            _send(bare[1], bytes_of[i % len(bytes_of)])
            begin = time.process_time_ns()
            _read_all(bare[0])
            spent += time.process_time_ns() - begin
        return spent

    count = BATCH * BATCHES
    try:
        times = in_turn(
            {
                "ours": Case(run_ours, count),
                "python-can recv + cantools": Case(run_peer, count),
                "recv_into alone": Case(run_bare, count),
            },
            6.0,
        )
    finally:
        for reads in (link, reader):
            reads.close()
        for ends in (ours, peer, bare):
            for end in ends:
                end.close()
    row = Row("frame in: bytes on a socket to a checked quantity, µs", f"{BATCH} frames a turn", times=times)
    row.note = "ours checks E2E, range and plausibility; the peers decode"
    if link.rejected:
        row.note += f"; WRONG: {link.rejected} frames rejected"
    row.compare("ours", "python-can recv + cantools", Goal("≤", 0.5))
    row.compare("ours", "recv_into alone")
    return row


def _send(end: socket.socket, batch: Sequence[bytes]) -> None:
    for data in batch:
        end.send(data)


def _read_all(end: socket.socket) -> None:
    buffer = bytearray(FRAME.size)
    try:
        while end.recv_into(buffer):
            pass
    except BlockingIOError:
        pass


class OursOut:
    """Writer (values to raw, CRC, counter), then the link's send."""

    def __init__(self, end: socket.socket) -> None:
        self._link = PairLink(end)
        self._writer = Writer(find_message(load_config(None).database, "Adhesion_A1"))

    def send(self, slot: int) -> Frame:
        frame = self._writer.frame(slot * 20_000, slot, ADHESION)
        assert self._link.send(frame)
        return frame

    def close(self) -> None:
        self._link.close()


class PeerOut:
    """cantools' encode_message, python-can's Message and send: no CRC, no counter."""

    def __init__(self, end: socket.socket, database: Database) -> None:
        self._bus, self._database = PairBus(end), database

    def send(self) -> bytes:
        # words and numbers side by side, which cantools takes and its types do not say
        data = self._database.encode_message("Adhesion_A1", {"Crc": 0, "Counter": 0, **ADHESION})  # type: ignore[dict-item]
        self._bus.send(can.Message(arbitration_id=0x091, data=data, is_extended_id=False))
        return data

    def close(self) -> None:
        self._bus.shutdown()


def _frame_out() -> Row:
    show("frames out")
    ours, peer, bare = (pair() for _ in range(3))
    for ends in (ours, peer, bare):
        ends[1].setblocking(False)
    writer, encoder = OursOut(ours[0]), PeerOut(peer[0], database())
    data = packed(next(islice(frames(), 0, 1)))
    slot = iter(range(1 << 62))

    def run(end: socket.socket, send: Any, count: int) -> int:
        spent = 0
        for _ in range(max(1, count // BATCH)):
            begin = time.process_time_ns()
            for _ in range(BATCH):
                send()
            spent += time.process_time_ns() - begin
            _read_all(end)
        return spent

    count = BATCH * BATCHES
    try:
        times = in_turn(
            {
                "ours": Case(partial(run, ours[1], lambda: writer.send(next(slot))), count),
                "cantools + python-can send": Case(partial(run, peer[1], encoder.send), count),
                "send alone": Case(partial(run, bare[1], lambda: bare[0].send(data)), count),
            },
            4.0,
        )
    finally:
        writer.close()
        encoder.close()
        for ends in (ours, peer, bare):
            for end in ends:
                end.close()
    row = Row("frame out: values to bytes on a socket, µs", "Adhesion", times=times)
    row.note = "ours writes counter and CRC, the peer does not; each of ours is a slot of its own"
    row.compare("ours", "cantools + python-can send")
    row.compare("ours", "send alone")
    return row
