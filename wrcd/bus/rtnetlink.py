"""Whether an interface is there and up, reported by the kernel at once: rtnetlink's link messages (man 7 rtnetlink)."""

import errno
import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from enum import Enum, auto

_MESSAGE = struct.Struct("=IHHII")  # struct nlmsghdr: length, type, flags, sequence, port
_LINK = struct.Struct("=BxHiII")  # struct ifinfomsg: family, type, index, flags, change
_ATTRIBUTE = struct.Struct("=HH")  # struct rtattr: length, type
RTMGRP_LINK = 1
NLMSG_ERROR, RTM_NEWLINK, RTM_DELLINK, RTM_GETLINK = 2, 16, 17, 18
NLM_F_REQUEST = 1
IFLA_IFNAME = 3
IFF_UP = 1
BUFFER = 1 << 16  # bytes; one message has some 1500
MAX_READS = 64  # at a time, so that nobody who sets interfaces up and down keeps the loop from its tick


class LinkEvent(Enum):
    """What has become of the interface."""

    GONE = auto()
    DOWN = auto()
    UP = auto()


class LinkEvents:
    """The events of one interface, by its name, in the order in which they happened."""

    def __init__(self, name: str) -> None:
        """Ask how it is now, too: that is the first event. Raises OSError where there is no rtnetlink, or it is
        forbidden."""
        self._name = name.encode()
        self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
        try:
            self._socket.setblocking(False)
            self._socket.bind((0, RTMGRP_LINK))
            self._ask()
        except OSError:
            self._socket.close()
            raise

    def _ask(self) -> None:
        """Have the kernel say how the interface is: as if it had just become so."""
        name = self._name + b"\0"
        attribute = _ATTRIBUTE.pack(_ATTRIBUTE.size + len(name), IFLA_IFNAME) + name + bytes(-len(name) % 4)
        body = _LINK.pack(socket.AF_UNSPEC, 0, 0, 0, 0) + attribute
        self._socket.send(_MESSAGE.pack(_MESSAGE.size + len(body), RTM_GETLINK, NLM_F_REQUEST, 0, 0) + body)

    def read(self) -> list[LinkEvent]:
        """What has happened since the last look. Where the kernel had no room to say all, it is asked how things are:
        the next look has the answer."""
        events: list[LinkEvent] = []
        lost = False
        for _ in range(MAX_READS):
            try:
                data, (port, _) = self._socket.recvfrom(BUFFER)
            except BlockingIOError:
                break
            except OSError as e:
                lost |= e.errno == errno.ENOBUFS
                continue
            if port == 0:  # the kernel's
                events += parse_events(data, self._name)
        if lost:  # there is room for the answer now
            with suppress(OSError):
                self._ask()
        return events

    def close(self) -> None:
        """Let go of the socket."""
        self._socket.close()


def open_events(name: str) -> LinkEvents | None:
    """The events of an interface, None where they are not to be had."""
    try:
        return LinkEvents(name)
    except OSError:
        return None


def parse_events(data: bytes, name: bytes) -> Iterator[LinkEvent]:
    """The events of one interface in a datagram of rtnetlink's. Damaged ones end at the damage."""
    at = 0
    while at + _MESSAGE.size <= len(data):
        length, kind, *_ = _MESSAGE.unpack_from(data, at)
        if not _MESSAGE.size <= length <= len(data) - at:
            return
        body = data[at + _MESSAGE.size : at + length]
        if kind == NLMSG_ERROR and len(body) >= 4 and int.from_bytes(body[:4], "little", signed=True) == -errno.ENODEV:
            yield LinkEvent.GONE  # the answer to what was asked
        elif kind in (RTM_NEWLINK, RTM_DELLINK) and len(body) >= _LINK.size and _name(body[_LINK.size :]) == name:
            up = _LINK.unpack_from(body)[3] & IFF_UP
            yield LinkEvent.GONE if kind == RTM_DELLINK else LinkEvent.UP if up else LinkEvent.DOWN
        at += length + (-length % 4)


def _name(attributes: bytes) -> bytes:
    """The interface's name among a message's attributes, empty if it is not there."""
    at = 0
    while at + _ATTRIBUTE.size <= len(attributes):
        length, kind = _ATTRIBUTE.unpack_from(attributes, at)
        if not _ATTRIBUTE.size <= length <= len(attributes) - at:
            break
        if kind == IFLA_IFNAME:
            return attributes[at + _ATTRIBUTE.size : at + length].rstrip(b"\0")
        at += length + (-length % 4)
    return b""
