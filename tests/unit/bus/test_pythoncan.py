"""A bus of python-can's: its virtual one, and one on which frames come faster than anybody can read."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import can
import pytest

from tests.support.can_ids import ADHESION_A1, EXTENDED, EXTENDED_KEY, YAW_RATE_A1
from wrcd.bus.frame import Frame
from wrcd.bus.link import MAX_FRAMES
from wrcd.bus.pythoncan import PythonCanLink

KEYS = (YAW_RATE_A1, EXTENDED_KEY)


def now_us() -> int:
    return time.time_ns() // 1000


@dataclass
class Ends:
    """The daemon's end of a bus, and somebody else's."""

    link: PythonCanLink
    other: can.BusABC

    def send(self, can_id: int, **how: Any) -> None:
        self.other.send(can.Message(arbitration_id=can_id, is_extended_id=can_id > 0x7FF, **how))


@pytest.fixture
def ends() -> Iterator[Ends]:
    made = Ends(PythonCanLink("virtual", "pythoncan-test", KEYS), can.Bus("pythoncan-test", interface="virtual"))
    yield made
    made.link.close()
    made.other.shutdown()


def test_frames_pass_both_ways_with_their_time_of_reception(ends: Ends) -> None:
    before = now_us()
    ends.send(YAW_RATE_A1, data=b"\x01\x02")
    ends.send(EXTENDED, data=b"\x03")
    frames = ends.link.receive(now_us())
    assert [(f.can_id, f.extended, f.data) for f in frames] == [
        (YAW_RATE_A1, False, b"\x01\x02"),
        (EXTENDED, True, b"\x03"),
    ]
    assert all(before - 1 <= f.stamp_us <= now_us() for f in frames)
    assert ends.link.send(Frame(now_us(), ADHESION_A1, b"\x07"))
    got = ends.other.recv(1.0)
    assert got is not None
    assert (got.arbitration_id, bytes(got.data), got.is_extended_id) == (ADHESION_A1, b"\x07", False)


def test_frame_of_somebody_else_under_an_own_id_is_counted(ends: Ends) -> None:
    """From the first frame that was sent here on; it is handed over for the recorder, mapped or not."""
    ends.send(ADHESION_A1, data=b"\x01")
    assert ends.link.receive(now_us()) == []
    assert ends.link.send(Frame(now_us(), ADHESION_A1, b"\x07"))
    assert ends.link.receive(now_us()) == []  # our own is none
    for _ in range(3):
        ends.send(ADHESION_A1, data=b"\x01")
    ends.send(ADHESION_A1, is_remote_frame=True)
    ends.send(YAW_RATE_A1, data=b"\x01\x02")
    assert [f.can_id for f in ends.link.receive(now_us())] == [ADHESION_A1] * 3 + [YAW_RATE_A1]
    assert ends.link.health.foreign_frames == 3
    assert ends.link.health.foreign_by_key == {ADHESION_A1: 3}


def test_own_frame_that_comes_back_is_not_foreign() -> None:
    """Where python-can hands over what was sent here, marked as such."""
    link = PythonCanLink("virtual", "pythoncan-own", KEYS, receive_own_messages=True)
    assert link.send(Frame(now_us(), ADHESION_A1, b"\x07"))
    assert link.receive(now_us()) == []
    assert link.health.foreign_frames == 0
    link.close()


def test_own_frame_that_comes_back_unmarked_is_not_foreign_but_its_double_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """As udp_multicast hands it back; in its place is a virtual bus with a node that repeats what it hears."""
    ours, other = (can.Bus("pythoncan-echo", interface="virtual") for _ in range(2))
    with ours, other:
        monkeypatch.setattr(can, "Bus", lambda **_: ours)
        link = PythonCanLink("udp_multicast", "pythoncan-echo", KEYS)

        def comes_back(times: int) -> list[bytes]:
            assert link.send(Frame(now_us(), ADHESION_A1, b"\x07"))
            sent = other.recv(1.0)
            assert sent is not None
            for _ in range(times):
                other.send(can.Message(arbitration_id=ADHESION_A1, is_extended_id=False, data=sent.data))
            return [f.data for f in link.receive(now_us())]

        assert [comes_back(times) for times in (1, 2, 1)] == [[], [b"\x07"], []]
        assert link.health.foreign_by_key == {ADHESION_A1: 1}


def test_stamp_of_a_foreign_clock_is_replaced(ends: Ends) -> None:
    ends.send(YAW_RATE_A1)
    assert ends.link.receive(now_us() + 3_600_000_000)[0].stamp_us > now_us() + 3_500_000_000


def test_unmapped_frames_do_not_delay_mapped_ones(ends: Ends) -> None:
    """However many there are between two of the sensors': one look has all of them."""
    for k in range(1000):
        ends.send(0x300 + k % 0x100)
        if k % 250 == 0:
            ends.send(YAW_RATE_A1)
    ends.send(YAW_RATE_A1, is_error_frame=True)
    ends.other.send(can.Message(arbitration_id=YAW_RATE_A1, is_extended_id=True))
    assert [f.can_id for f in ends.link.receive(now_us())] == [YAW_RATE_A1] * 4
    assert ends.link.health.error_frames == 1


class Endless(can.BusABC):
    """There is always one more."""

    def __init__(self, message: can.Message) -> None:
        super().__init__(channel="endless")
        self.taken, self._message = 0, message

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self.taken += 1
        return self._message, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("can_id", "error", "handed_over"), [(YAW_RATE_A1, False, MAX_FRAMES), (0x300, False, 0), (YAW_RATE_A1, True, 0)],
    ids=["sensor's", "unmapped", "error frames"],
)  # fmt: skip
def test_receive_ends_after_max_frames_of_a_flood(
    monkeypatch: pytest.MonkeyPatch, can_id: int, error: bool, handed_over: int
) -> None:
    flood = Endless(can.Message(arbitration_id=can_id, is_extended_id=False, is_error_frame=error, timestamp=1.0))
    monkeypatch.setattr(can, "Bus", lambda **_: flood)
    link = PythonCanLink("virtual", "endless", KEYS)
    for look in (1, 2):
        assert len(link.receive(now_us())) == handed_over
        assert flood.taken == look * MAX_FRAMES
    assert link.health.error_frames == (2 * MAX_FRAMES if error else 0)
    link.close()


def test_closed_bus_is_down_and_counts_unsent_frames(ends: Ends) -> None:
    ends.link.close()
    assert ends.link.receive(now_us()) == []
    assert ends.link.health.state == "Down"
    assert not ends.link.send(Frame(now_us(), ADHESION_A1, b""))
    assert ends.link.health.unsent == 1
    ends.link.close()
