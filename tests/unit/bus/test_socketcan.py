"""SocketCanLink on a stand-in for its socket: what it asks of the kernel, and what it does when the kernel refuses.

What a real kernel's interfaces do is recorded and judged in tests/hil.
"""

import errno
from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace

import pytest

from tests.support.can_ids import ADHESION, ADHESION_A1, AXLES, EXTENDED, EXTENDED_KEY, YAW_RATE_A1, YAW_RATE_A2
from tests.support.can_socket import CanBus
from wrcd.bus import opening_hints, socketcan
from wrcd.bus.frame import Frame
from wrcd.bus.rawcan import MAX_ERRORS
from wrcd.bus.rtnetlink import LinkEvent
from wrcd.bus.socketcan import REOPEN_US, SocketCanLink
from wrcd.errors import BusError

NOW = 1_700_000_000_000_000
SLOT_US = 20_000
BUS_ERROR = Frame(NOW, 0x80, bytes(8), error=True)
BUS_OFF = Frame(NOW, 0x40, bytes(8), error=True)
YAW = Frame(NOW, YAW_RATE_A1, b"\x01\x02")


class Bus(CanBus):
    """And what rtnetlink says of its interface."""

    def __init__(self) -> None:
        super().__init__()
        self.events: list[LinkEvent] = []

    def said(self) -> list[LinkEvent]:
        said, self.events = self.events, []
        return said


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bus]:
    made = Bus()
    monkeypatch.setattr(socketcan, "socket", made.module)
    monkeypatch.setattr(socketcan, "library", lambda: made.library)
    monkeypatch.setattr(socketcan, "open_events", lambda _: SimpleNamespace(read=made.said, close=lambda: None))
    yield made
    made.close()


@pytest.fixture
def link(bus: Bus) -> SocketCanLink:
    return SocketCanLink("can7", (YAW_RATE_A1, EXTENDED_KEY))


def adhesion(slot: int, data: bytes = b"\x01", axle: int = 1) -> Frame:
    return Frame(NOW + slot * SLOT_US, ADHESION[axle], data)


def ids(frames: list[Frame]) -> list[int]:
    return [f.can_id for f in frames]


def assert_frames_pass(bus: Bus, link: SocketCanLink) -> None:
    bus.sent()
    bus.send(YAW)
    assert ids(link.receive(NOW)) == [YAW_RATE_A1]
    assert link.send(adhesion(10_000))
    assert bus.sent() == [(ADHESION_A1, b"\x01")]
    assert link.health.state == "Up"


# --- what is received


def test_only_wanted_ids_in_their_own_length_are_let_in(bus: Bus, link: SocketCanLink) -> None:
    other = Frame(NOW, YAW_RATE_A2, b"")
    bus.send(YAW, other, Frame(NOW, YAW_RATE_A1, b"", extended=True), Frame(NOW, EXTENDED, b"", extended=True))
    assert [(f.can_id, f.extended) for f in link.receive(NOW)] == [(YAW_RATE_A1, False), (EXTENDED, True)]
    link.narrow((YAW_RATE_A2,))
    bus.send(YAW, other)
    assert ids(link.receive(NOW)) == [YAW_RATE_A2]


def test_fd_frames_may_be_wanted_later(bus: Bus, link: SocketCanLink) -> None:
    long = Frame(NOW, YAW_RATE_A1, bytes(12), fd=True)
    bus.send(long)
    assert link.receive(NOW) == []
    link.narrow((YAW_RATE_A1,), fd=True)
    bus.send(long, YAW)
    assert [(f.fd, f.data) for f in link.receive(NOW)] == [(True, bytes(12)), (False, YAW.data)]


def test_receive_returns_at_most_max_frames(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socketcan, "MAX_FRAMES", 20)
    link = SocketCanLink("can7", None)
    bus.send(*[YAW] * 30)
    assert [len(link.receive(NOW)) for _ in range(3)] == [20, 10, 0]


def test_frames_of_somebody_else_are_counted_by_key_from_the_first_own_one_on(bus: Bus, link: SocketCanLink) -> None:
    theirs = Frame(NOW, ADHESION_A1, b"\x07")
    bus.send(theirs)
    assert link.receive(NOW) == []
    assert link.send(adhesion(0))
    remote = Frame(NOW, ADHESION_A1, b"", remote=True)
    bus.send(theirs, theirs, Frame(NOW, ADHESION_A1, b"", extended=True), remote)
    assert [(f.can_id, f.remote) for f in link.receive(NOW)] == [(ADHESION_A1, False)] * 2 + [(ADHESION_A1, True)]
    assert link.health.foreign_by_key == {ADHESION_A1: 2}
    link.narrow((YAW_RATE_A2,))  # own ids stay
    bus.send(theirs)
    assert ids(link.receive(NOW)) == [ADHESION_A1]
    assert link.health.foreign_frames == 3


def test_flood_of_error_frames_is_shut_out_for_a_second_but_not_what_tells_a_state(
    bus: Bus, link: SocketCanLink
) -> None:
    every = [BUS_ERROR] * (MAX_ERRORS + 1)
    for part in (every[:200], every[200:400], every[400:]):
        bus.send(*part, YAW)
        assert ids(link.receive(NOW)) == [BUS_ERROR.can_id] * len(part) + [YAW_RATE_A1]
    bus.send(BUS_ERROR, YAW, BUS_OFF)
    assert ids(link.receive(NOW + 999_999)) == [YAW_RATE_A1, BUS_OFF.can_id]
    assert link.health.state == "BusOff"
    link.receive(NOW + 1_000_000)
    bus.send(BUS_ERROR)
    assert ids(link.receive(NOW + 1_000_001)) == [BUS_ERROR.can_id]


def test_states_of_the_controller_follow_its_error_frames(bus: Bus, link: SocketCanLink) -> None:
    def says(state: int) -> str:
        bus.send(Frame(NOW, 0x04, bytes((0, state)) + bytes(6), error=True))
        link.receive(NOW)
        assert link.health.up
        return link.health.state

    passive = "ErrorPassive"
    assert [says(s) for s in (0x20, 0x10, 0x08, 0x30, 0x40)] == [passive, passive, "Up", passive, "Up"]
    says(0x01)  # it has lost a frame
    assert link.health.drops == 1


# --- what is sent


def test_frames_wait_in_the_kernel_for_one_slot_only(bus: Bus, link: SocketCanLink) -> None:
    """A controller without an acknowledgement keeps what it was given: it must not be given more, but for one slot a
    second."""
    assert link.send_all([adhesion(0, axle=a) for a in AXLES]) == [True] * 4
    assert link.send(adhesion(1))  # those have left
    bus.newest.holds_frames = True
    sent = [slot for slot in range(2, 160) if link.send(adhesion(slot))]
    assert sent == [51, 101, 151]
    assert link.health.unsent == 158 - 3
    bus.newest.holds_frames = False
    assert link.send(adhesion(160))
    assert len(bus.sent()) == 4 + 1 + 3 + 1


def test_link_that_asks_for_no_confirmation_does_not_wait_for_earlier_frames(bus: Bus) -> None:
    """A rig's sensors: what an earlier sample has left in the queue holds nothing of the next one back."""
    link = SocketCanLink("can7", (YAW_RATE_A1,), confirm=False)
    assert all(link.send(adhesion(slot)) for slot in range(2))
    bus.newest.holds_frames = True
    assert all(link.send(adhesion(slot)) for slot in range(2, 5))
    bus.newest.holds_frames = False
    assert link.receive(NOW) == []  # nothing comes back of what is sent


def test_bus_off_tries_one_slot_a_second_until_a_frame_comes(bus: Bus, link: SocketCanLink) -> None:
    assert link.send(adhesion(0))
    bus.send(BUS_OFF)
    link.receive(NOW)
    assert [slot for slot in range(1, 200) if link.send(adhesion(slot))] == [50, 100, 150]
    bus.send(YAW)
    link.receive(NOW)
    assert link.send(adhesion(200))


@pytest.mark.parametrize("full", [errno.ENOBUFS, errno.EAGAIN])
def test_frame_that_the_queue_does_not_take_is_counted_and_the_state_stays_up(
    bus: Bus, link: SocketCanLink, full: int
) -> None:
    bus.newest.refuses.extend([0, full, 0, full])
    assert link.send_all([adhesion(0, axle=a) for a in AXLES]) == [True, False, True, False]
    assert (link.health.unsent, link.health.state) == (2, "Up")
    assert bus.sent() == [(ADHESION[a], b"\x01") for a in (1, 3)]


def test_frame_that_meets_a_latched_error_is_sent_again(bus: Bus, link: SocketCanLink) -> None:
    """The interface was down and is up again: the kernel says so to the first that is sent."""
    bus.newest.refuses.extend([0, errno.ENETDOWN])
    assert link.send_all([adhesion(0, axle=a) for a in AXLES]) == [True] * 4
    bus.newest.refuses.extend([errno.ENETDOWN] * 2)
    assert link.send_all([adhesion(1, axle=a) for a in (1, 2)]) == [False, True]
    bus.newest.refuses.extend([errno.ENETDOWN] * 2)
    assert not link.send(adhesion(2))
    assert (link.health.unsent, link.health.state) == (2, "Down")


# --- the interface


def test_state_is_known_without_a_frame_and_the_newest_event_counts(bus: Bus, link: SocketCanLink) -> None:
    def after(*events: LinkEvent) -> str:
        bus.events += events
        assert link.receive(NOW) == []
        return link.health.state

    down, up = LinkEvent.DOWN, LinkEvent.UP
    assert [after(*e) for e in ([down], [up], [down, up], [up, down])] == ["Down", "Up", "Up", "Down"]


def test_device_that_is_back_is_opened_at_once(bus: Bus, link: SocketCanLink) -> None:
    """The clock stands still: nothing here waits. It may have been replaced between two looks."""
    bus.is_there, bus.events = False, [LinkEvent.GONE]
    assert link.receive(NOW) == []
    assert link.health.state == "Gone"
    assert not link.send(adhesion(0))
    bus.is_there, bus.events = True, [LinkEvent.DOWN]
    link.receive(NOW)
    assert (link.health.state, link.health.reopens) == ("Down", 1)
    bus.events = [LinkEvent.UP]
    link.receive(NOW)
    assert_frames_pass(bus, link)
    bus.events = [LinkEvent.GONE, LinkEvent.DOWN, LinkEvent.UP]
    link.receive(NOW)
    assert link.health.reopens == 2
    assert_frames_pass(bus, link)


def test_gone_device_without_rtnetlink_is_tried_every_50_ms(bus: Bus, link: SocketCanLink) -> None:
    link.close_events()
    bus.newest.is_gone, bus.is_there = True, False
    link.receive(NOW)
    assert link.health.state == "Gone"
    tried: list[int] = []
    for at in range(NOW, NOW + 1_000_000, 5_000):
        before = len(bus.sockets)
        link.receive(at)
        tried += [at] * (len(bus.sockets) - before)
    assert {b - a for a, b in pairwise([NOW, *tried])} == {REOPEN_US}
    bus.is_there = True
    link.receive(NOW - 3_600_000_000)  # a clock that steps back does not keep it closed
    assert link.health.reopens == 1
    assert_frames_pass(bus, link)


def test_failing_option_of_a_leaving_device_is_survived(bus: Bus, link: SocketCanLink) -> None:
    def shut_out_a_flood() -> None:
        for _ in range(3):
            bus.send(*[BUS_ERROR] * 200)
            link.receive(NOW)

    for reopens, happens in enumerate(
        (lambda: link.narrow((YAW_RATE_A1,)), lambda: link.send(Frame(NOW, 0x0B7, b"")), shut_out_a_flood), 1
    ):
        bus.newest.is_leaving = True
        happens()
        assert link.health.reopens == reopens - 1
        link.receive(NOW + reopens * REOPEN_US)
        assert link.health.reopens == reopens
        bus.events = [LinkEvent.UP]
        link.receive(NOW)
        assert_frames_pass(bus, link)


def test_missing_device_is_a_bus_error_with_advice(bus: Bus) -> None:
    bus.is_there = False
    with pytest.raises(BusError, match=r"'vcan77' cannot be opened: No such device .*ip link add vcan77") as caught:
        SocketCanLink("vcan77", None)
    assert caught.value.status == 3


def test_forbidden_socket_is_a_bus_error_with_advice(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: int) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    bus.module.socket = refused
    monkeypatch.setattr(opening_hints, "CONTAINER_MARKS", ())
    with pytest.raises(BusError, match="a sandbox forbids it"):
        SocketCanLink("can7", None)
