"""Frames in and out, over a pair of datagram sockets that carry struct can_frame, against python-can and cantools.

The kernel's part of a raw CAN socket is left out; what remains is the same system calls, with the same time stamps.
"""

import socket
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count, cycle, islice
from typing import Any

import can
import cantools
from can.interfaces.socketcan import SocketcanBus
from cantools.database.can import Database

from tests.bench.on_pair import PairLink, pair
from tests.bench.timing import Case, Goal, Row, in_turn, show
from tests.bench.workload import LENGTH_US, TICK_US, frames
from wrcd import resources
from wrcd.bus.codec import Receiver, Sample, Value, Writer
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.rawcan import FRAME
from wrcd.bus.reasons import Reason
from wrcd.config.config import load_config
from wrcd.core.inputs import Inputs

BATCH = 8  # frames of a turn: yaw rates and lateral accelerations of four axles; a datagram pair holds ten
BATCHES = 40  # of a block
SPEED_ID = 0x130
ADHESION: dict[str, Value] = {
    "Validity": "Valid", "MuAvailable": 23.4, "MuUsed": 5.67, "SampleAge": 5.0, "Surface": "Dry",
    "ContactState": "Adhering", "Confidence": "Within3pp",
}  # fmt: skip
PEER_IN, PEER_OUT = "python-can recv + cantools", "cantools + python-can send"


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
    """Bytes to checked samples: the link's receive, then CRC, counter, status, range, plausibility. And values to bytes
    on the bus: to raw ones, CRC, counter, then the link's send."""

    def __init__(self, end: socket.socket) -> None:
        config = load_config(None)
        self._link = PairLink(end)
        self._receiver = Receiver(config.database, [i.source for i in config.inputs])
        self._inputs = Inputs(config, self._receiver.ends)
        self._writer = Writer(find_message(config.database, "Adhesion_A1"))
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

    def send(self, slot: int) -> Frame:
        frame = self._writer.frame(slot * 20_000, slot, ADHESION)
        assert self._link.send(frame)
        return frame

    def close(self) -> None:
        self._link.close()


class Peer:
    """python-can's recv, then cantools' decode_message: no E2E, no range, no plausibility. And cantools' encoding, then
    python-can's Message and send: no CRC, no counter."""

    def __init__(self, end: socket.socket) -> None:
        database = cantools.database.load_file(resources.DBC)  # as a user loads it
        assert isinstance(database, Database)
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

    def send(self) -> bytes:
        # words and numbers side by side, which cantools takes and its types do not say
        data = self._database.encode_message("Adhesion_A1", {"Crc": 0, "Counter": 0, **ADHESION})  # type: ignore[dict-item]
        self._bus.send(can.Message(arbitration_id=0x091, data=data, is_extended_id=False))
        return data

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


def rows() -> Iterator[Row]:
    """Frame in, then frame out; times are per frame."""
    for measured, seconds in ((_frame_in, 6.0), (_frame_out, 4.0)):
        pairs = [pair() for _ in range(3)]
        ours, peer = Ours(pairs[0][0]), Peer(pairs[1][0])
        try:
            yield measured(ours, peer, pairs, seconds)
        finally:
            ours.close()
            peer.close()
            for end in (end for ends in pairs for end in ends):
                end.close()


def _case(before: Callable[[], object], timed: Callable[[], object], after: Callable[[], object]) -> Case:
    """Batches, of each of which only the middle counts."""

    def run(frames: int) -> int:
        spent = 0
        for _ in range(max(1, frames // BATCH)):
            before()
            begin = time.process_time_ns()
            timed()
            spent += time.process_time_ns() - begin
            after()
        return spent

    return Case(run, BATCH * BATCHES)


def _frame_in(ours: Ours, peer: Peer, pairs: list[tuple[socket.socket, socket.socket]], seconds: float) -> Row:
    show("frames in")
    stamps = count(TICK_US, TICK_US)
    batches = [[packed(f) for f in b] for b in sensor_batches()]
    takes: dict[str, Callable[[], object]] = {
        "ours": lambda: ours.take(next(stamps)),
        PEER_IN: lambda: peer.take(BATCH),
        "recv_into alone": lambda: _read_all(pairs[2][0]),
    }
    pairs[2][0].setblocking(False)

    cases = {
        name: _case(partial(_send, end, cycle(batches)), take, int)
        for (name, take), (_, end) in zip(takes.items(), pairs, strict=True)
    }
    row = Row("frame in: bytes on a socket to a checked quantity, µs", f"{BATCH} frames a turn")
    row.times = in_turn(cases, seconds)
    row.note = "ours checks E2E, range and plausibility; the peers decode"
    if ours.rejected:
        row.note += f"; WRONG: {ours.rejected} frames rejected"
    row.compare("ours", PEER_IN, Goal("≤", 0.5))
    row.compare("ours", "recv_into alone")
    return row


def _send(end: socket.socket, turns: Iterator[list[bytes]]) -> None:
    for data in next(turns):
        end.send(data)


def _read_all(end: socket.socket) -> None:
    buffer = bytearray(FRAME.size)
    try:
        while end.recv_into(buffer):
            pass
    except BlockingIOError:
        pass


def _repeat(send: Callable[[], object]) -> None:
    for _ in range(BATCH):
        send()


def _frame_out(ours: Ours, peer: Peer, pairs: list[tuple[socket.socket, socket.socket]], seconds: float) -> Row:
    show("frames out")
    slots = count()
    data = packed(next(islice(frames(), 0, 1)))
    sends: dict[str, Callable[[], object]] = {
        "ours": lambda: ours.send(next(slots)),
        PEER_OUT: peer.send,
        "send alone": lambda: pairs[2][0].send(data),
    }

    cases = {}
    for (name, send), (_, end) in zip(sends.items(), pairs, strict=True):
        end.setblocking(False)
        cases[name] = _case(int, partial(_repeat, send), partial(_read_all, end))
    row = Row("frame out: values to bytes on a socket, µs", "Adhesion", times=in_turn(cases, seconds))
    row.note = "ours writes counter and CRC, the peer does not; each of ours is a slot of its own"
    row.compare("ours", PEER_OUT)
    row.compare("ours", "send alone")
    return row
