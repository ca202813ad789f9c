"""The SocketCAN link on a real kernel: frames are sent within their slot, or dropped and counted."""

from tests.support.can_ids import ADHESION, ADHESION_A1, AXLES, YAW_RATE_A1
from tests.support.slcan import Slcan
from tests.support.vcan import BUS_OFF, ERROR, FaultySocket, Node, ip, now_us
from wrcd.bus.frame import Frame
from wrcd.bus.socketcan import SocketCanLink


def test_full_send_queue_drops_and_counts() -> None:
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


def test_frames_wait_in_the_kernel_for_one_slot_only(
    sockets: list[FaultySocket], link: SocketCanLink, node: Node
) -> None:
    """A real controller without an acknowledgement keeps what it was given: it must not be given more."""
    stamp = now_us() // 20_000 * 20_000
    for axle in AXLES:
        assert link.send(Frame(stamp, ADHESION[axle], b"\x01"))
    assert link._unconfirmed == 4
    assert link.send(Frame(stamp + 20_000, ADHESION_A1, b"\x02"))  # vcan says at once that they have left
    assert [node.receive()[1] for _ in range(5)] == [b"\x01"] * 4 + [b"\x02"]
    assert link.receive(0) == []  # our own are not received
    assert link._unconfirmed == 0
    sockets[-1].holds_frames = True  # nothing tells from here on that a frame has left
    for axle in AXLES:
        assert link.send(Frame(stamp + 40_000, ADHESION[axle], b"\x03"))
    assert link._unconfirmed == 4
    for slot in range(3, 41):
        assert not link.send(Frame(stamp + slot * 20_000, ADHESION_A1, b"\x04"))
    assert link.health.unsent == 38
    assert link.send(Frame(stamp + 1_040_000, ADHESION_A1, b"\x05"))  # one slot a second is tried
    sockets[-1].holds_frames = False
    assert link.send(Frame(stamp + 1_060_000, ADHESION_A1, b"\x06"))  # and has left
    assert [node.receive()[1] for _ in range(6)] == [b"\x03"] * 4 + [b"\x05", b"\x06"]


def test_slots_frames_are_sent_together_and_each_is_counted(link: SocketCanLink, node: Node) -> None:
    stamp = now_us() // 20_000 * 20_000
    assert link.send_all([]) == []
    slots = [[Frame(stamp + k, ADHESION[axle], bytes([k, axle])) for axle in AXLES] for k in range(2)]
    assert [link.send_all(slot) for slot in slots] == [[True] * 4] * 2
    assert [node.receive() for _ in range(8)] == [(f.can_id, f.data) for slot in slots for f in slot]
    assert (link.receive(0), link._unconfirmed, link.health.unsent) == ([], 0, 0)


def test_slots_frames_go_out_after_a_latched_error(bus: str, link: SocketCanLink) -> None:
    """The interface was down and is up again: the kernel tells the first that is sent."""
    link.close_events()  # nobody else tells
    ip("set", bus, "down")
    ip("set", bus, "up")
    other = Node(bus)
    frames = [Frame(now_us(), ADHESION[axle], bytes([axle])) for axle in AXLES]
    assert link.send_all(frames) == [True] * 4
    assert [other.receive() for _ in AXLES] == [(f.can_id, f.data) for f in frames]
    ip("set", bus, "down")
    assert link.send_all(frames) == [False] * 4
    assert (link.health.state, link.health.unsent) == ("Down", 4)
    other.close()


def test_slots_frames_that_the_queue_does_not_take_are_counted() -> None:
    """An slcan interface whose line nobody reads: real ENOBUFS in the middle of a slot."""
    peer = Slcan("can7")
    try:
        link = SocketCanLink("can7", None, confirm=False)
        stamp, sent = now_us(), [True]
        while all(sent):
            sent = link.send_all([Frame(stamp, ADHESION_A1, bytes(8))] * 100)
        first = sent.index(False)
        assert 0 < first < 99
        assert link.health.unsent == sent.count(False)
        assert link.health.state == "Up"
        link.close()
    finally:
        peer.shutdown()


def test_link_that_asks_for_no_confirmation_does_not_wait_for_earlier_frames(
    sockets: list[FaultySocket], bus: str, node: Node
) -> None:
    """A rig's sensors: what an earlier sample has left in the queue holds nothing of the next one back."""
    link = SocketCanLink(bus, (YAW_RATE_A1,), confirm=False)
    stamp = now_us()
    assert link.send(Frame(stamp, ADHESION_A1, b"\x01"))
    sockets[-1].holds_frames = True
    for sample in range(1, 4):
        assert link.send(Frame(stamp + sample * 5_000, ADHESION_A1, b"\x02"))
    sockets[-1].holds_frames = False
    assert [node.receive()[1] for _ in range(4)] == [b"\x01"] + [b"\x02"] * 3
    assert link.receive(0) == []  # nothing comes back of what is sent
    link.close()


def test_bus_off_tries_one_slot_a_second(link: SocketCanLink, node: Node) -> None:
    """Should the frame that tells of the restart have been lost, and nobody else send."""
    stamp = now_us()
    assert link.send(Frame(stamp, ADHESION_A1, b""))
    node.send(ERROR | BUS_OFF, bytes(8))
    link.receive(0)
    sent = [link.send(Frame(stamp + slot * 20_000, ADHESION_A1, b"")) for slot in range(1, 200)]
    assert sent.count(True) == 3
