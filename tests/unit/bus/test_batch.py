"""Frames in one piece of memory, and the link that takes and sends many a system call, on a local socket."""

from collections.abc import Iterator
from itertools import islice

import pytest

from tests.support.can_ids import ADHESION_A1, YAW_RATE_A1
from tests.support.can_socket import CHANNEL, CanBus
from tests.support.stretch import frames
from wrcd.bus import socketcan
from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame

NOW = 1_700_000_000_000_000
KINDS = [
    Frame(NOW, YAW_RATE_A1, b"\x01\x02"),
    Frame(NOW + 1, 0x18FF0001, bytes(range(8)), extended=True),
    Frame(NOW + 2, 0x101, b"", extended=True),
    Frame(NOW + 3, YAW_RATE_A1, b"", remote=True, extra=5),
    Frame(NOW + 4, 0x18FF0001, b"", extended=True, remote=True),
    Frame(NOW + 5, 0x40, bytes(8), error=True),  # bus-off
    Frame(NOW + 6, ADHESION_A1, b"\x07"),
]


def test_batch_keeps_every_classical_frame() -> None:
    batch = FrameBatch.of(KINDS)
    assert (list(batch), len(batch)) == (KINDS, len(KINDS))
    assert list(FrameBatch.of([])) == []


@pytest.mark.parametrize("length", [0, 8, 12, 64])
def test_batch_keeps_can_fd_among_classical_frames(length: int) -> None:
    long = Frame(NOW + 7, 0x101, bytes(range(1, length + 1)), fd=True)
    extended = Frame(NOW + 8, 0x18FF0001, bytes(length), extended=True, fd=True)
    every = [*KINDS, long, *KINDS, extended]
    batch = FrameBatch.of(every)
    assert (list(batch), len(batch)) == (every, len(every))
    assert [batch.frame(k) for k in range(len(batch))] == every


class Ends(CanBus):
    """The link, and what is behind its socket."""

    is_stamped = True  # a local socket has the kernel's stamps, but none beside a controller's

    def __init__(self, fd: bool, monkeypatch: pytest.MonkeyPatch) -> None:
        super().__init__()
        monkeypatch.setattr(socketcan, "socket", self.module)
        self.link = socketcan.SocketCanLink(CHANNEL, None, fd)


@pytest.fixture(params=["classical", "CAN FD", "stamped by hardware"])
def ends(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ends]:
    made = Ends(request.param == "CAN FD", monkeypatch)
    made.is_stamped = request.param != "stamped by hardware"
    if not made.is_stamped:
        made.link.stamp_by_hardware()
    yield made
    made.link.close()
    made.close()


def test_link_hands_over_every_kind_of_frame_and_notes_what_it_tells(ends: Ends) -> None:
    link = ends.link
    assert link.send(Frame(NOW, ADHESION_A1, b"\x07"))  # from now on it is its own
    ends.send(*KINDS)
    got = link.receive_batch(NOW)
    stamps = [f.stamp_us for f in got]
    assert stamps == sorted(stamps)
    assert (stamps[0] > NOW) == ends.is_stamped
    assert [(f.can_id, f.data, f.extended, f.remote, f.error, f.extra) for f in got] == [
        (f.can_id, f.data, f.extended, f.remote, f.error, f.extra) for f in KINDS
    ]
    assert (link.health.foreign_by_key, link.health.bus_offs, link.health.error_frames) == ({ADHESION_A1: 1}, 1, 1)
    states = [state_after(ends, sent) for sent in ([], KINDS[5:6], KINDS[:1])]
    assert states == ["Up", "BusOff", "Up"]  # a frame proves that the controller is on the bus


def state_after(ends: Ends, sent: list[Frame]) -> str:
    ends.send(*sent)
    assert len(ends.link.receive_batch(NOW)) == len(sent)
    return ends.link.health.state


def test_link_takes_more_than_one_call_brings(ends: Ends) -> None:
    every = list(islice(frames(), 150))
    ends.send(*every)
    assert [(f.can_id, f.data) for f in ends.link.receive_batch(NOW)] == [(f.can_id, f.data) for f in every]
    assert list(ends.link.receive_batch(NOW)) == []


def test_frames_that_come_before_a_slot_has_left_are_handed_over_with_the_others(ends: Ends) -> None:
    link = ends.link
    assert link.send(Frame(NOW, ADHESION_A1, b"\x07"))
    ends.send(*KINDS[:2])
    assert link.send(Frame(NOW + 20_000, ADHESION_A1, b"\x07"))  # it looks whether the first has left
    ends.send(*KINDS[2:4])
    got = link.receive_batch(NOW)
    assert [(f.can_id, f.data) for f in got] == [(f.can_id, f.data) for f in KINDS[:4]]
    assert len(link.receive_batch(NOW)) == 0


def test_link_sends_a_slot_and_counts_what_the_queue_does_not_take(ends: Ends) -> None:
    slot = [Frame(NOW, ADHESION_A1 + k % 4, bytes([k % 256, k // 256])) for k in range(1_000)]
    went = ends.link.send_all(slot)
    sent = went.index(False)
    assert went == [True] * sent + [False] * (1_000 - sent)
    assert sent > 64
    assert ends.link.health.unsent == 1_000 - sent
    assert ends.link.health.state == "Up"
    assert ends.sent() == [(f.can_id, f.data) for f in slot[:sent]]
    assert ends.link.send_all(slot[:3]) == [True] * 3
    ends.far.close()
    assert ends.link.send_all(slot[:3]) == [False] * 3
