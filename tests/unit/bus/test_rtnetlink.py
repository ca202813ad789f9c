"""What the kernel says of an interface: a real rtnetlink where the test runs, and datagrams as they may be damaged."""

import errno
import socket
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrcd.bus.rtnetlink import LinkEvent, LinkEvents, open_events, parse_events

NEW, DEL, ERROR = 16, 17, 2


def attribute(kind: int, value: bytes) -> bytes:
    return struct.pack("=HH", 4 + len(value), kind) + value + bytes(-len(value) % 4)


def link(kind: int, name: bytes, flags: int = 0) -> bytes:
    """A message about a link, with an attribute before its name and one after it."""
    body = struct.pack("=BxHiII", 0, 280, 7, flags, 0xFFFFFFFF)
    body += attribute(4, b"\x48\0\0\0") + attribute(3, name + b"\0") + attribute(16, b"\6")
    return struct.pack("=IHHII", 16 + len(body), kind, 0, 0, 0) + body + bytes(-len(body) % 4)


def test_present_state_is_the_first_event() -> None:
    events = LinkEvents("lo")
    assert events.read() == [LinkEvent.UP]
    assert events.read() == []
    events.close()


class Overrun(socket.socket):
    """The kernel has had no room in it for all that it had to say."""

    said = False

    def recvfrom(self, *sizes: Any) -> Any:
        if not self.said:
            self.said = True
            raise OSError(errno.ENOBUFS, "No buffer space available")
        return super().recvfrom(*sizes)


def test_lost_messages_are_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "socket", Overrun)
    events = LinkEvents("lo")
    assert events.read() == [LinkEvent.UP]  # of the opening; and that some are lost
    assert events.read() == [LinkEvent.UP]
    assert events.read() == []
    events.close()


def test_missing_interface_is_gone() -> None:
    events = LinkEvents("none9")
    assert events.read() == [LinkEvent.GONE]
    events.close()


def test_forbidden_rtnetlink_gives_no_events(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a unit whose RestrictAddressFamilies= lacks it."""

    def refused(*_: object) -> socket.socket:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", refused)
    assert open_events("lo") is None


def test_events_of_one_interface_keep_their_order() -> None:
    other = link(NEW, b"can1", 1)
    data = link(DEL, b"can0") + other + link(NEW, b"can0") + link(DEL, b"can01") + link(NEW, b"can0", 0x10C1)
    assert list(parse_events(data, b"can0")) == [LinkEvent.GONE, LinkEvent.DOWN, LinkEvent.UP]


def test_only_enodev_means_gone() -> None:
    def answer(number: int) -> bytes:
        return struct.pack("=IHHIIi", 20, ERROR, 0, 0, 0, -number)

    assert list(parse_events(answer(errno.ENODEV), b"can0")) == [LinkEvent.GONE]
    assert list(parse_events(answer(0) + answer(errno.EPERM), b"can0")) == []


@given(st.integers(0, 200), st.integers(0, 255), st.integers(0, 200))
def test_damaged_datagram_is_parsed_without_error(at: int, byte: int, cut: int) -> None:
    data = bytearray(link(DEL, b"can0") + link(NEW, b"can0", 1))
    data[at % len(data)] = byte
    assert len(list(parse_events(bytes(data[: len(data) - cut % len(data)]), b"can0"))) <= 2
