"""The SocketCAN link on a real kernel: which frames it receives, when stamped, and how lost ones are counted."""

import os
import socket
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1, EXTENDED, YAW_RATE_A1, YAW_RATE_A2
from tests.support.vcan import Node, now_us
from wrcd.bus.frame import Frame
from wrcd.bus.link import MAX_FRAMES
from wrcd.bus.socketcan import SocketCanLink


def test_only_mapped_ids_are_received_with_kernel_stamps(link: SocketCanLink, node: Node) -> None:
    before = now_us()
    for word in (YAW_RATE_A1, YAW_RATE_A2, 0x80000101, 0x98FF0001, 0x40000101, YAW_RATE_A1):
        node.send(word)
    after = now_us()
    frames = link.receive(0)
    assert [(f.can_id, f.extended, f.remote, f.data) for f in frames] == [
        (YAW_RATE_A1, False, False, b"\x01\x02"),
        (EXTENDED, True, False, b"\x01\x02"),
        (YAW_RATE_A1, False, True, b""),  # it asks for two bytes, and has none
        (YAW_RATE_A1, False, False, b"\x01\x02"),
    ]
    assert [f.extra for f in frames] == [0, 0, 2, 0]
    assert all(before <= f.stamp_us <= after for f in frames)
    assert sorted(f.stamp_us for f in frames) == [f.stamp_us for f in frames]
    assert link.receive(0) == []
    link.narrow((YAW_RATE_A2,))
    node.send(YAW_RATE_A1)
    node.send(YAW_RATE_A2)
    assert [f.can_id for f in link.receive(0)] == [YAW_RATE_A2]


def test_full_receive_buffer_counts_every_lost_frame(link: SocketCanLink, node: Node) -> None:
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


def test_unmapped_frames_do_not_fill_the_receive_buffer(link: SocketCanLink, node: Node) -> None:
    for k in range(20_000):
        node.send(0x300 + k % 0x100)
        if k % 1000 == 0:
            node.send(YAW_RATE_A1)
    assert len(link.receive(0)) == 20
    assert link.health.drops == 0


@pytest.mark.skipif(os.environ.get("GUEST") != "uml", reason="changes the kernel's bound of receive buffers")
def test_receive_returns_at_most_max_frames(bus: str, node: Node) -> None:
    Path("/proc/sys/net/core/rmem_max").write_text("8388608")
    link = SocketCanLink(bus, (YAW_RATE_A1,))
    for _ in range(MAX_FRAMES + 10):
        node.send(YAW_RATE_A1)
    assert [len(link.receive(0)) for _ in range(3)] == [MAX_FRAMES, 10, 0]
    link.close()


def test_missing_hardware_stamps_are_the_kernels(bus: str, node: Node) -> None:
    link = SocketCanLink(bus, (YAW_RATE_A1,))
    link.stamp_by_hardware()
    before = now_us()
    node.send(YAW_RATE_A1)
    frames = link.receive(0)
    assert before <= frames[0].stamp_us <= now_us()
    link.close()


def test_frame_of_somebody_else_under_an_own_id_is_counted(link: SocketCanLink, node: Node) -> None:
    """From the first frame that was sent here on; it is handed over for the recorder. A node of the same computer is
    somebody else, too: only what this socket has sent is marked."""
    node.send(ADHESION_A1)
    assert link.receive(0) == []
    assert link.send(Frame(now_us(), ADHESION_A1, b"\x07"))
    assert link.receive(0) == []
    for word in (ADHESION_A1, ADHESION_A1, 0x80000000 | ADHESION_A1, 0x40000000 | ADHESION_A1):
        node.send(word)
    assert [(f.can_id, f.remote) for f in link.receive(0)] == [(ADHESION_A1, False)] * 2 + [(ADHESION_A1, True)]
    assert link.health.foreign_frames == 2
    assert link.health.foreign_by_key == {ADHESION_A1: 2}
    assert link.send(Frame(now_us(), ADHESION_A1, b"\x08"))
    assert link.receive(0) == []
    assert link.health.foreign_frames == 2


def fd_frame(word: int, length: int) -> bytes:
    """struct canfd_frame."""
    return word.to_bytes(4, "little") + bytes([length, 0, 0, 0]) + bytes(range(length)).ljust(64, b"\0")


def test_link_receives_fd_frames_where_they_are_wanted(bus: str, node: Node) -> None:
    sender = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    sender.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
    sender.bind((bus,))
    extended = 0x80000000 | 0x101
    with_fd, without = SocketCanLink(bus, (extended, 0x102), fd=True), SocketCanLink(bus, (extended, 0x102))
    later = SocketCanLink(bus, None)
    before = now_us()
    for frame in (fd_frame(0x102, 48), fd_frame(extended, 64), fd_frame(0x101, 64)):
        sender.send(frame)
    node.send(0x102)
    node.send(0x101)
    got = with_fd.receive(0)
    assert [(f.can_id, f.extended, f.fd, f.data) for f in got] == [
        (0x102, False, True, bytes(range(48))), (0x101, True, True, bytes(range(64))),
        (0x102, False, False, b"\x01\x02"),
    ]  # fmt: skip
    assert all(before <= f.stamp_us <= now_us() for f in got)
    assert [(f.can_id, f.fd) for f in without.receive(0)] == [(0x102, False)]
    assert [f.can_id for f in later.receive(0)] == [0x102, 0x101]
    later.narrow((extended, 0x102), fd=True)
    sender.send(fd_frame(0x102, 12))
    node.send(0x101)
    node.send(0x102)
    assert [(f.can_id, len(f.data), f.fd) for f in later.receive(0)] == [(0x102, 12, True), (0x102, 2, False)]
    sender.close()
    for link in (with_fd, without, later):
        link.close()
