"""The SocketCAN link on a real kernel: bus-off, error frames, link down, device gone and back."""

import errno
import socket
import time
from itertools import pairwise

import pytest

from tests.support.can_ids import ADHESION_A1, YAW_RATE_A1
from tests.support.slcan import Slcan
from tests.support.vcan import (
    BUS_ERROR,
    BUS_OFF,
    CONTROLLER,
    ERROR,
    RESTARTED,
    FaultySocket,
    Node,
    add,
    assert_frames_pass,
    ip,
    now_us,
)
from wrcd.bus import opening_hints
from wrcd.bus.frame import Frame
from wrcd.bus.rawcan import MAX_ERRORS
from wrcd.bus.socketcan import REOPEN_US, SocketCanLink
from wrcd.errors import BusError


def link_state(link: SocketCanLink) -> str:
    return link.health.state


def test_bus_off_stops_sending_until_the_restart(link: SocketCanLink, node: Node) -> None:
    mine = Frame(now_us(), ADHESION_A1, b"\x55")
    assert link.send(mine)
    assert node.receive() == (ADHESION_A1, b"\x55")
    node.send(ERROR | BUS_OFF, bytes(8))
    assert [(f.error, f.can_id) for f in link.receive(0)] == [(True, BUS_OFF)]
    assert (link.health.state, link.health.bus_offs, link.health.error_frames) == ("BusOff", 1, 1)
    assert not link.health.up
    assert not link.send(mine)  # the kernel would take it, and nobody get it
    later = Frame(mine.stamp_us + 20_000, ADHESION_A1, b"\x56")
    assert not link.send(later)
    assert link.health.unsent == 2
    node.send(ERROR | RESTARTED, bytes(8))
    link.receive(0)
    assert link.health.state == "Up"
    assert link.send(Frame(mine.stamp_us + 40_000, ADHESION_A1, b"\x57"))
    assert node.receive() == (ADHESION_A1, b"\x57")
    # whatever arrives proves that the controller is on the bus
    node.send(ERROR | BUS_OFF, bytes(8))
    link.receive(0)
    node.send(YAW_RATE_A1)
    link.receive(0)
    assert (link.health.state, link.health.bus_offs) == ("Up", 2)


def test_error_passive_is_reported_and_keeps_sending(link: SocketCanLink, node: Node) -> None:
    for state, name in (
        (0x20, "ErrorPassive"),
        (0x10, "ErrorPassive"),
        (0x08, "Up"),
        (0x30, "ErrorPassive"),
        (0x40, "Up"),
    ):
        node.send(ERROR | CONTROLLER, bytes((0, state)) + bytes(6))
        link.receive(0)
        assert link.health.state == name
        assert link.health.up
        assert link.send(Frame(now_us(), ADHESION_A1, b""))
        assert node.receive() == (ADHESION_A1, b"")
    node.send(ERROR | CONTROLLER, bytes((0, 0x01)) + bytes(6))  # the controller itself lost a frame
    link.receive(0)
    assert link.health.drops == 1


def test_flood_of_error_frames_is_filtered_except_bus_off(link: SocketCanLink, node: Node) -> None:
    now = now_us()
    for k in range(MAX_ERRORS + 100):
        node.send(ERROR | BUS_ERROR, bytes(8))
        if k % 100 == 0:
            node.send(YAW_RATE_A1)
    frames = link.receive(now)
    assert sum(not f.error for f in frames) == 6
    for _ in range(1000):
        node.send(ERROR | BUS_ERROR, bytes(8))
    node.send(YAW_RATE_A1)
    node.send(ERROR | BUS_OFF, bytes(8))
    assert [(f.can_id, f.error) for f in link.receive(now + 500_000)] == [(YAW_RATE_A1, False), (BUS_OFF, True)]
    assert link.health.state == "BusOff"
    link.receive(now + 1_000_001)  # after a second all of them are let in again
    time.sleep(1.0)
    node.send(ERROR | BUS_ERROR, bytes(8))
    assert len(link.receive(now + 2_000_000)) == 1


def test_states_of_the_slcan_driver_are_reported() -> None:
    """As an slcan adapter tells them: error passive, bus-off, error active."""
    peer = Slcan("can7")
    try:
        link = SocketCanLink("can7", None)
        for text, state in ((b"sp128000\r", "ErrorPassive"), (b"sb255000\r", "BusOff"), (b"sa000000\r", "Up")):
            peer.report(text)
            time.sleep(0.2)
            link.receive(now_us())
            assert link.health.state == state
        assert link.health.bus_offs == 1
        assert link.health.error_frames >= 3
        link.close()
    finally:
        peer.shutdown()


def test_sending_continues_after_link_down_and_up(bus: str, link: SocketCanLink, node: Node) -> None:
    mine = Frame(now_us(), ADHESION_A1, b"\x07")
    ip("set", bus, "down")
    assert link.receive(0) == []
    assert link_state(link) == "Down"
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


def test_link_state_is_known_without_a_frame(bus: str, link: SocketCanLink) -> None:
    """Without a frame that comes or goes."""
    for state, name in (("down", "Down"), ("up", "Up"), ("down", "Down"), ("up", "Up")):
        ip("set", bus, state)
        link.receive(0)
        assert link_state(link) == name
    ip("set", bus, "down")
    ip("set", bus, "up")
    link.receive(0)
    assert link_state(link) == "Up"


def test_returned_device_is_reopened_at_once(bus: str, link: SocketCanLink) -> None:
    """The clock stands still: nothing here waits."""
    for reopens in (1, 2):
        ip("del", bus)
        assert link.receive(0) == []
        assert link_state(link) == "Gone"
        assert not link.send(Frame(0, ADHESION_A1, b""))
        add(bus)
        link.receive(0)
        assert (link.health.state, link.health.reopens) == ("Down", reopens)
        ip("set", bus, "up")
        link.receive(0)
        assert link_state(link) == "Up"
        assert_frames_pass(bus, link)


def test_device_replaced_between_two_receives_is_reopened(bus: str, link: SocketCanLink) -> None:
    ip("del", bus)
    add(bus)
    ip("set", bus, "up")
    link.receive(0)
    assert (link.health.state, link.health.reopens) == ("Up", 1)
    assert_frames_pass(bus, link)


def test_gone_device_without_rtnetlink_is_tried_every_50_ms(
    bus: str, link: SocketCanLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    link.close_events()
    now = now_us()
    ip("del", bus)
    assert link.receive(now) == []
    assert link_state(link) == "Gone"
    opened: list[int] = []
    real = socket.socket

    def counted(*args: int) -> socket.socket:
        opened.append(at)
        return real(*args)

    monkeypatch.setattr(socket, "socket", counted)
    for at in range(now, now + 10_000_000, 5_000):
        link.receive(at)
    monkeypatch.undo()
    assert {b - a for a, b in pairwise([now, *opened])} == {REOPEN_US}
    # a clock that steps back by an hour does not keep it closed
    add(bus)
    ip("set", bus, "up")
    at = now - 3_600_000_000
    link.receive(at)
    assert (link.health.state, link.health.reopens) == ("Up", 1)
    assert_frames_pass(bus, link)


def test_lost_rtnetlink_messages_are_asked_for_again(
    sockets: list[FaultySocket], bus: str, link: SocketCanLink
) -> None:
    (netlink,) = (s for s in sockets if s.family == socket.AF_NETLINK)
    link.receive(0)
    ip("set", bus, "down")
    link.receive(0)
    netlink.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)  # the kernel makes it room for one or two
    for length in range(100, 110):
        ip("set", bus, "txqueuelen", str(length))  # each says that it is down
    ip("set", bus, "up")
    link.receive(0)  # learns that some are lost
    link.receive(0)
    assert link_state(link) == "Up"


def test_failing_option_of_a_leaving_device_is_survived(
    sockets: list[FaultySocket], bus: str, link: SocketCanLink, node: Node
) -> None:
    def set_filters() -> None:
        link.narrow((YAW_RATE_A1,))

    def send_a_new_id() -> None:
        assert not link.send(Frame(now_us(), 0x0B7, b""))

    def shut_out_a_flood() -> None:
        for _ in range(MAX_ERRORS + 1):
            node.send(ERROR | BUS_ERROR, bytes(8))
        link.receive(now_us())

    for reopens, happens in enumerate((set_filters, send_a_new_id, shut_out_a_flood), 1):
        sockets[-1].is_leaving = True
        happens()
        assert link._socket is None
        link.receive(now_us() + REOPEN_US)
        assert link.health.reopens == reopens
        assert_frames_pass(bus, link)
        assert link_state(link) == "Up"


def test_missing_device_is_a_bus_error_with_advice() -> None:
    with pytest.raises(
        BusError,
        match="make it: sudo ip link add vcan77 type vcan && sudo ip link set vcan77 up; there is vcan0, vcan1",
    ) as caught:
        SocketCanLink("vcan77", None)
    assert caught.value.status == 3


def test_forbidden_socket_is_a_bus_error_with_advice(monkeypatch: pytest.MonkeyPatch, bus: str) -> None:
    def refused(*_: object) -> socket.socket:
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(socket, "socket", refused)
    monkeypatch.setattr(opening_hints, "CONTAINER_MARKS", ())
    with pytest.raises(BusError, match="no rights are needed for a CAN socket: a sandbox forbids it"):
        SocketCanLink(bus, None)
