"""What the library in C makes of what a kernel gives beside frames: link.c, compiled over a recvmmsg of these tests."""

import ctypes
import errno
import socket
import struct
import subprocess

import pytest

from tests.support.can_socket import control_of
from tests.support.processes import ROOT
from tests.support.tools import needs
from wrcd.bus.batch import FD_RECORD, FrameBatch
from wrcd.bus.rawcan import SO_RXQ_OVFL, SO_TIMESTAMPING, SO_TIMESTAMPNS, HardwareClock
from wrcd.bus.socketcan import _Received

pytestmark = needs("gcc")
NOW_US, MSG_CONFIRM = 1_700_000_000_000_000, 0x800
KERNEL = r"""
#define _GNU_SOURCE
#include <errno.h>
#include <string.h>
#include <sys/socket.h>

typedef struct { int bytes, flags, control_bytes, error; unsigned char frame[72], control[128]; } given;
static given *next;
static int left;

void give(given *of, int count) { next = of; left = count; }

int given_recvmmsg(int fd, struct mmsghdr *heads, unsigned most, int flags, struct timespec *until)
{
    unsigned got = 0;
    (void)fd, (void)flags, (void)until;
    for (; got < most && left && !next->error; got++, next++, left--) {
        struct msghdr *h = &heads[got].msg_hdr;
        memcpy(h->msg_iov->iov_base, next->frame, (size_t)next->bytes);
        memcpy(h->msg_control, next->control, (size_t)next->control_bytes);
        h->msg_controllen = (size_t)next->control_bytes;
        h->msg_flags = next->flags;
        heads[got].msg_len = (unsigned)next->bytes;
    }
    if (got)
        return (int)got;
    errno = left ? next->error : EAGAIN;
    return -1;
}
"""
CLASSICAL = struct.pack("=IB3x8s", 0x101, 8, b"12345678")
FD = struct.pack("=IBB2x64s", 0x102, 12, 0b01, b"longer than 8")


class Given(ctypes.Structure):
    """One message, or an error instead."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("bytes", "flags", "control_bytes", "error")),
        ("frame", ctypes.c_ubyte * 72), ("control", ctypes.c_ubyte * 128),
    )  # fmt: skip


def beside(kind: int, *values: int, of: str) -> bytes:
    return control_of((socket.SOL_SOCKET, kind, struct.pack(f"@{len(values)}{of}", *values)))


def message(frame: bytes, control: bytes = b"", flags: int = 0) -> Given:
    parts = (ctypes.c_ubyte * 72)(*frame), (ctypes.c_ubyte * 128)(*control)
    return Given(len(frame), flags, len(control), 0, *parts)


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("kernel")
    (folder / "kernel.c").write_text(KERNEL)
    link = ROOT / "wrcd/bus/c/link.c"
    words = ["gcc", "-shared", "-fPIC", "-Drecvmmsg=given_recvmmsg", str(link), str(folder / "kernel.c")]
    subprocess.run([*words, "-o", str(folder / "link.so")], check=True, timeout=60)
    return ctypes.CDLL(str(folder / "link.so"))


def received(kernel: ctypes.CDLL, *given: Given, clock: HardwareClock | None = None) -> tuple[FrameBatch, _Received]:
    size, said, room = FD_RECORD.size, _Received(), ctypes.create_string_buffer(8 * FD_RECORD.size)
    kept = (Given * len(given))(*given)
    kernel.give(kept, len(given))
    at = None if clock is None else ctypes.byref(clock)
    now = ctypes.c_int64(NOW_US)
    count = kernel.wrcd_receive(0, room, ctypes.c_int64(size), 8, now, b"", 0, at, ctypes.byref(said))
    return FrameBatch(room.raw[: count * size], fd=True), said


def test_classical_frames_and_those_of_can_fd_come_with_the_kernels_stamp_or_that_of_the_look(
    kernel: ctypes.CDLL,
) -> None:
    stamped = message(FD, beside(SO_TIMESTAMPNS, 1_700_000_001, 5_000, of="l"))
    frames, said = received(kernel, message(CLASSICAL), stamped)
    first, second = frames
    assert (first.stamp_us, first.can_id, first.data, first.fd) == (NOW_US, 0x101, b"12345678", False)
    assert (second.stamp_us, second.data, second.fd, second.extra) == (NOW_US + 1_000_005, b"longer than ", True, 0b01)
    assert (said.error, said.confirmed, said.lost) == (0, 0, 0)


def test_frames_of_ours_that_have_left_are_counted_and_are_not_among_the_frames(kernel: ctypes.CDLL) -> None:
    frames, said = received(
        kernel, message(CLASSICAL, flags=MSG_CONFIRM), message(CLASSICAL), message(FD, flags=MSG_CONFIRM)
    )
    assert (len(frames), said.confirmed) == (1, 2)


def test_lost_frames_are_told_as_the_newest_count_has_them(kernel: ctypes.CDLL) -> None:
    lost = [message(CLASSICAL, beside(SO_RXQ_OVFL, n, of="I")) for n in (3, 2**32 - 1)]
    assert received(kernel, lost[0], message(CLASSICAL))[1].lost == 3
    assert received(kernel, *lost)[1].lost == 2**32 - 1
    assert received(kernel, message(CLASSICAL))[1].lost == 0


def test_error_is_told_and_an_empty_socket_is_none(kernel: ctypes.CDLL) -> None:
    frames, said = received(kernel, Given(error=errno.ENETDOWN))
    assert (len(frames), said.error) == (0, errno.ENETDOWN)
    assert received(kernel, message(CLASSICAL), Given(error=errno.ENODEV))[1].error == 0
    assert received(kernel)[1].error == 0


def test_controllers_stamps_lie_on_the_kernels_clock(kernel: ctypes.CDLL) -> None:
    late_ns, clock = (900_000, 400_000, 700_000), HardwareClock()
    given = [
        message(CLASSICAL, beside(SO_TIMESTAMPING, 1_700_000_000 + k, late, 0, 0, 50 + k, 0, of="l"))
        for k, late in enumerate(late_ns)
    ]
    stamps = [f.stamp_us for f in received(kernel, *given, clock=clock)[0]]
    assert stamps == [NOW_US + 900, NOW_US + 1_000_400, NOW_US + 2_000_400]  # by the least delay that was seen
