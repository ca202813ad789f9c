"""The daemon's own SocketCAN link on a real kernel: every event of the bus, handled and counted."""

import errno
import os
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from sim_ecu.play.slcan import Slcan
from tests.support.can_ids import ADHESION, ADHESION_A1, EXTENDED, YAW_RATE_A1, YAW_RATE_A2
from wrcd.bus.controller import MAX_ERRORS
from wrcd.bus.frame import Frame
from wrcd.bus.link import MAX_FRAMES
from wrcd.bus.socketcan import REOPEN_US, SocketCanLink
from wrcd.errors import BusError

FRAME = struct.Struct("=IB3x8s")
ERROR = 0x20000000


def now_us() -> int:
    return time.time_ns() // 1000


def told(link: SocketCanLink) -> str:
    return link.health.state


def ip(*words: str) -> None:
    subprocess.run(["ip", "link", *words], timeout=10, check=True)


@pytest.fixture
def bus() -> Iterator[str]:
    """A vcan of this test's own."""
    ip("add", "vcan9", "mtu", "72", "type", "vcan")
    ip("set", "vcan9", "up")
    yield "vcan9"
    subprocess.run(["ip", "link", "del", "vcan9"], timeout=10, check=False, capture_output=True)


class Node:
    """Somebody else on the bus."""

    def __init__(self, channel: str) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.bind((channel,))
        self._socket.settimeout(2.0)

    def send(self, word: int, data: bytes = b"\x01\x02") -> None:
        self._socket.send(FRAME.pack(word, len(data), data.ljust(8, b"\0")))

    def receive(self) -> tuple[int, bytes]:
        word, length, data = FRAME.unpack(self._socket.recv(FRAME.size))
        return word, data[:length]

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def node(bus: str) -> Iterator[Node]:
    n = Node(bus)
    yield n
    n.close()


@pytest.fixture
def link(bus: str) -> Iterator[SocketCanLink]:
    made = SocketCanLink(bus, (YAW_RATE_A1, EXTENDED))
    yield made
    made.close()


def test_only_mapped_ids_come_with_the_kernels_stamps(link: SocketCanLink, node: Node) -> None:
    before = now_us()
    for word in (YAW_RATE_A1, YAW_RATE_A2, 0x80000101, 0x98FF0001, 0x40000101, YAW_RATE_A1):
        node.send(word)
    after = now_us()
    frames = link.receive(0)
    assert [(f.can_id, f.extended, f.remote, f.data) for f in frames] == [
        (YAW_RATE_A1, False, False, b"\x01\x02"),
        (EXTENDED, True, False, b"\x01\x02"),
        (YAW_RATE_A1, False, True, b"\x01\x02"),
        (YAW_RATE_A1, False, False, b"\x01\x02"),
    ]
    assert all(before <= f.stamp_us <= after for f in frames)
    assert sorted(f.stamp_us for f in frames) == [f.stamp_us for f in frames]
    assert link.receive(0) == []
    link.narrow((YAW_RATE_A2,))
    node.send(YAW_RATE_A1)
    node.send(YAW_RATE_A2)
    assert [f.can_id for f in link.receive(0)] == [YAW_RATE_A2]


def test_a_full_receive_buffer_is_counted_frame_by_frame(link: SocketCanLink, node: Node) -> None:
    sent = 20_000
    for k in range(sent):
        node.send(YAW_RATE_A1, k.to_bytes(4, "little"))
    got = 0
    while frames := link.receive(0):
        got += len(frames)
    node.send(YAW_RATE_A1)  # what was lost is told with the next frame
    got += len(link.receive(0))
    assert link.health.drops > 0
    assert got + link.health.drops == sent + 1
    for _ in range(10):
        node.send(YAW_RATE_A1)
    link.receive(0)
    assert got + link.health.drops == sent + 1


def test_unmapped_frames_never_fill_the_buffer(link: SocketCanLink, node: Node) -> None:
    for k in range(20_000):
        node.send(0x300 + k % 0x100)
        if k % 1000 == 0:
            node.send(YAW_RATE_A1)
    assert len(link.receive(0)) == 20
    assert link.health.drops == 0


def test_bus_off_and_back(link: SocketCanLink, node: Node) -> None:
    mine = Frame(now_us(), ADHESION_A1, b"\x55")
    assert link.send(mine)
    assert node.receive() == (ADHESION_A1, b"\x55")
    node.send(ERROR | 0x40, bytes(8))
    assert [(f.error, f.can_id) for f in link.receive(0)] == [(True, 0x40)]
    assert (link.health.state, link.health.bus_offs, link.health.error_frames) == ("BusOff", 1, 1)
    assert not link.health.up
    assert not link.send(mine)  # the kernel would take it, and nobody get it
    later = Frame(mine.stamp_us + 20_000, ADHESION_A1, b"\x56")
    assert not link.send(later)
    assert link.health.unsent == 2
    node.send(ERROR | 0x100, bytes(8))
    link.receive(0)
    assert link.health.state == "Up"
    assert link.send(Frame(mine.stamp_us + 40_000, ADHESION_A1, b"\x57"))
    assert node.receive() == (ADHESION_A1, b"\x57")
    # whatever arrives proves that the controller is on the bus
    node.send(ERROR | 0x40, bytes(8))
    link.receive(0)
    node.send(YAW_RATE_A1)
    link.receive(0)
    assert (link.health.state, link.health.bus_offs) == ("Up", 2)


def test_error_passive_is_told_and_goes_on(link: SocketCanLink, node: Node) -> None:
    for state, name in (
        (0x20, "ErrorPassive"),
        (0x10, "ErrorPassive"),
        (0x08, "Up"),
        (0x30, "ErrorPassive"),
        (0x40, "Up"),
    ):
        node.send(ERROR | 0x04, bytes((0, state)) + bytes(6))
        link.receive(0)
        assert link.health.state == name
        assert link.health.up
        assert link.send(Frame(now_us(), ADHESION_A1, b""))
        assert node.receive() == (ADHESION_A1, b"")
    node.send(ERROR | 0x04, bytes((0, 0x01)) + bytes(6))  # the controller itself lost a frame
    link.receive(0)
    assert link.health.drops == 1


def test_a_flood_of_error_frames_is_shut_out_but_not_what_tells_the_state(link: SocketCanLink, node: Node) -> None:
    now = now_us()
    for k in range(MAX_ERRORS + 100):
        node.send(ERROR | 0x80, bytes(8))
        if k % 100 == 0:
            node.send(YAW_RATE_A1)
    frames = link.receive(now)
    assert sum(not f.error for f in frames) == 6
    for _ in range(1000):
        node.send(ERROR | 0x80, bytes(8))
    node.send(YAW_RATE_A1)
    node.send(ERROR | 0x40, bytes(8))
    assert [(f.can_id, f.error) for f in link.receive(now + 500_000)] == [(YAW_RATE_A1, False), (0x40, True)]
    assert link.health.state == "BusOff"
    link.receive(now + 1_000_001)  # after a second all of them are let in again
    time.sleep(1.0)
    node.send(ERROR | 0x80, bytes(8))
    assert len(link.receive(now + 2_000_000)) == 1


@pytest.mark.skipif(os.environ.get("GUEST") != "uml", reason="changes the kernel's bound of receive buffers")
def test_one_look_takes_no_more_than_some_thousand(bus: str, node: Node) -> None:
    Path("/proc/sys/net/core/rmem_max").write_text("8388608")
    link = SocketCanLink(bus, (YAW_RATE_A1,))
    for _ in range(MAX_FRAMES + 10):
        node.send(YAW_RATE_A1)
    assert [len(link.receive(0)) for _ in range(3)] == [MAX_FRAMES, 10, 0]
    link.close()


def test_a_link_that_goes_down_and_comes_up(bus: str, link: SocketCanLink, node: Node) -> None:
    mine = Frame(now_us(), ADHESION_A1, b"\x07")
    ip("set", bus, "down")
    assert link.receive(0) == []
    assert told(link) == "Down"
    assert not link.send(mine)
    ip("set", bus, "up")
    node.close()
    other = Node(bus)
    assert link.send(mine)
    assert other.receive() == (ADHESION_A1, b"\x07")
    assert link.health.state == "Up"
    other.send(YAW_RATE_A1)
    assert len(link.receive(0)) == 1
    other.close()


def test_a_link_that_is_set_down_and_up_is_known_at_once(bus: str, link: SocketCanLink) -> None:
    """Without a frame that comes or goes."""
    for state, name in (("down", "Down"), ("up", "Up"), ("down", "Down"), ("up", "Up")):
        ip("set", bus, state)
        link.receive(0)
        assert told(link) == name
    ip("set", bus, "down")
    ip("set", bus, "up")
    link.receive(0)
    assert told(link) == "Up"


def add(bus: str) -> None:
    ip("add", bus, "mtu", "72", "type", "vcan")


def exchange(bus: str, link: SocketCanLink) -> None:
    """A frame each way."""
    other = Node(bus)
    other.send(YAW_RATE_A1)
    assert [f.can_id for f in link.receive(0)] == [YAW_RATE_A1]
    assert link.send(Frame(now_us(), ADHESION_A1, b"\x01"))
    assert other.receive() == (ADHESION_A1, b"\x01")
    other.close()


def test_a_device_that_comes_back_is_opened_at_once(bus: str, link: SocketCanLink) -> None:
    """The clock stands still: nothing here waits."""
    for reopens in (1, 2):
        ip("del", bus)
        assert link.receive(0) == []
        assert told(link) == "Gone"
        assert not link.send(Frame(0, ADHESION_A1, b""))
        add(bus)
        link.receive(0)
        assert (link.health.state, link.health.reopens) == ("Down", reopens)
        ip("set", bus, "up")
        link.receive(0)
        assert told(link) == "Up"
        exchange(bus, link)


def test_a_device_that_is_made_anew_between_two_looks_is_opened_anew(bus: str, link: SocketCanLink) -> None:
    ip("del", bus)
    add(bus)
    ip("set", bus, "up")
    link.receive(0)
    assert (link.health.state, link.health.reopens) == ("Up", 1)
    exchange(bus, link)


def test_without_rtnetlink_a_device_that_has_gone_is_tried_every_50_ms(
    bus: str, link: SocketCanLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    link.close_events()
    now = now_us()
    ip("del", bus)
    assert link.receive(now) == []
    assert told(link) == "Gone"
    opened = []
    tries = link._open

    def counted() -> socket.socket:
        opened.append(at)
        return tries()

    monkeypatch.setattr(link, "_open", counted)
    for at in range(now, now + 10_000_000, 5_000):
        link.receive(at)
    assert {b - a for a, b in pairwise([now, *opened])} == {REOPEN_US}
    # a clock that steps back by an hour does not keep it closed
    add(bus)
    ip("set", bus, "up")
    at = now - 3_600_000_000
    link.receive(at)
    assert (link.health.state, link.health.reopens) == ("Up", 1)
    exchange(bus, link)


def test_what_the_kernel_had_no_room_to_say_is_asked_for(bus: str, link: SocketCanLink) -> None:
    events = link._events
    assert events is not None
    link.receive(0)
    ip("set", bus, "down")
    link.receive(0)
    events._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)  # the kernel makes it room for one or two
    for length in range(100, 110):
        ip("set", bus, "txqueuelen", str(length))  # each says that it is down
    ip("set", bus, "up")
    link.receive(0)  # learns that some are lost
    link.receive(0)
    assert told(link) == "Up"


class Leaving(socket.socket):
    """A raw socket whose device is just being taken away: options can't be set, and reading says so a moment later."""

    def setsockopt(self, *_: object) -> None:
        raise OSError(errno.ENODEV, "No such device")


def leave(link: SocketCanLink) -> None:
    assert link._socket is not None
    link._socket = Leaving(fileno=link._socket.detach())


def test_options_of_a_device_that_goes_are_no_reason_to_stop(bus: str, link: SocketCanLink, node: Node) -> None:
    def set_filters() -> None:
        link.narrow((YAW_RATE_A1,))

    def send_a_new_id() -> None:
        assert not link.send(Frame(now_us(), 0x0B7, b""))

    def shut_out_a_flood() -> None:
        for _ in range(MAX_ERRORS + 1):
            node.send(ERROR | 0x80, bytes(8))
        link.receive(now_us())

    for reopens, happens in enumerate((set_filters, send_a_new_id, shut_out_a_flood), 1):
        leave(link)
        happens()
        assert link._socket is None
        link.receive(now_us() + REOPEN_US)
        assert link.health.reopens == reopens
        exchange(bus, link)
        assert told(link) == "Up"


def test_a_bus_that_is_not_there_is_a_clear_error() -> None:
    with pytest.raises(BusError, match="ip link add vcan77 type vcan") as caught:
        SocketCanLink("vcan77", None)
    assert caught.value.status == 3


def test_a_full_send_queue_drops_and_counts() -> None:
    """An slcan interface whose line nobody reads: real ENOBUFS."""
    peer = Slcan("can7")
    try:
        link = SocketCanLink("can7", None)
        results = [link.send(Frame(now_us(), ADHESION_A1, bytes(8))) for _ in range(5000)]
        assert results[0]
        assert not results[-1]
        assert link.health.unsent == results.count(False)
        assert link.health.state == "Up"  # it is full, not down
        link.close()
    finally:
        peer.shutdown()


def test_frames_of_one_slot_wait_in_the_kernel_never_those_of_many(link: SocketCanLink, node: Node) -> None:
    """A real controller without an acknowledgement keeps what it was given: it must not be given more."""
    stamp = now_us() // 20_000 * 20_000
    for axle in range(1, 5):
        assert link.send(Frame(stamp, ADHESION[axle], b"\x01"))
    assert link._unconfirmed == 4
    assert link.send(Frame(stamp + 20_000, ADHESION_A1, b"\x02"))  # vcan says at once that they have left
    assert link._confirms
    assert link.receive(0) == []  # our own are not received
    link._unconfirmed = 4  # as if they had not
    for slot in range(2, 40):
        assert not link.send(Frame(stamp + slot * 20_000, ADHESION_A1, b"\x03"))
    assert link.health.unsent == 38
    assert link.send(Frame(stamp + 1_020_000, ADHESION_A1, b"\x04"))  # one slot a second is tried
    assert link.send(Frame(stamp + 1_040_000, ADHESION_A1, b"\x05"))  # and has left
    got = [node.receive()[1] for _ in range(7)]
    assert got == [b"\x01"] * 4 + [b"\x02", b"\x04", b"\x05"]


def test_off_the_bus_one_slot_a_second_is_tried(link: SocketCanLink, node: Node) -> None:
    """Should the frame that tells of the restart have been lost, and nobody else send."""
    stamp = now_us()
    assert link.send(Frame(stamp, ADHESION_A1, b""))
    node.send(ERROR | 0x40, bytes(8))
    link.receive(0)
    sent = [link.send(Frame(stamp + slot * 20_000, ADHESION_A1, b"")) for slot in range(1, 200)]
    assert sent.count(True) == 3


def test_the_states_that_a_real_driver_reports() -> None:
    """As an slcan adapter tells them: error passive, bus-off, error active."""
    peer = Slcan("can7")
    try:
        link = SocketCanLink("can7", None)
        for text, state in ((b"sp128000\r", "ErrorPassive"), (b"sb255000\r", "BusOff"), (b"sa000000\r", "Up")):
            os.write(peer._peer, text)
            time.sleep(0.2)
            link.receive(now_us())
            assert link.health.state == state
        assert link.health.bus_offs == 1
        assert link.health.error_frames >= 3
        link.close()
    finally:
        peer.shutdown()


def test_hardware_stamps_where_there_are_none_are_the_kernels(bus: str, node: Node) -> None:
    link = SocketCanLink(bus, (YAW_RATE_A1,))
    link.stamp_by_hardware()
    before = now_us()
    node.send(YAW_RATE_A1)
    frames = link.receive(0)
    assert before <= frames[0].stamp_us <= now_us()
    link.close()


def test_who_may_not_open_a_socket_is_told(monkeypatch: pytest.MonkeyPatch, bus: str) -> None:
    def refused(*_: object) -> socket.socket:
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(socket, "socket", refused)
    with pytest.raises(BusError, match="check the interface and your rights"):
        SocketCanLink(bus, None)
