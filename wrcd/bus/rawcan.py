"""The kernel's side of a raw CAN socket: structures, options, masks (linux/can.h, linux/can/raw.h)."""

import errno
import socket
import struct

FRAME = struct.Struct("=IB3x8s")  # struct can_frame
FD_FRAME = struct.Struct("=IBB2x64s")  # struct canfd_frame
FD_BITS = 0b11  # of its flags: bit rate switched, sender error passive
TIMESPEC = struct.Struct("@ll")
U32 = struct.Struct("=I")
FILTER = struct.Struct("=II")  # struct can_filter
# Not all of these have names in the socket module.
SO_TIMESTAMPNS = 35
SO_TIMESTAMPING = 37
RAW_HARDWARE, RX_SOFTWARE, SOFTWARE, RX_HARDWARE = 1 << 6, 1 << 3, 1 << 4, 1 << 2
SO_RXQ_OVFL = 40
CAN_RAW_RECV_OWN_MSGS = 4
CAN_RAW_ERR_FILTER = 2
CAN_RAW_FD_FRAMES = 5
CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_ERR_FLAG = 0x80000000, 0x40000000, 0x20000000
GONE = (errno.ENODEV, errno.ENXIO, errno.EBADF)  # what a socket says of a device that is not there any more


# As plain numbers: those of the socket module may be enumerations, whose & takes longer than the system call.
SOL_SOCKET, MSG_CONFIRM = int(socket.SOL_SOCKET), int(socket.MSG_CONFIRM)
EFF_MASK, SFF_MASK = int(socket.CAN_EFF_MASK), int(socket.CAN_SFF_MASK)


def time_us(value: bytes, place: int) -> int:
    """One of the time stamps that came along, in whole microseconds."""
    seconds, nanoseconds = TIMESPEC.unpack_from(value, place * TIMESPEC.size)
    return int(seconds) * 1_000_000 + int(nanoseconds) // 1000


def parse_ancillary(ancillary: list[tuple[int, int, bytes]], now_us: int) -> tuple[int, int, int | None]:
    """Parse what recvmsg gives beside a frame.

    Returns the kernel's time stamp in µs, now_us where there is none; the controller's own in µs, 0 where there is
    none; and how many frames the socket's buffer has lost so far, None where the kernel does not say.
    """
    kernel_us, hardware_us, lost = now_us, 0, None
    for level, kind, value in ancillary:
        if level != SOL_SOCKET:
            continue
        if kind == SO_TIMESTAMPNS:
            seconds, nanoseconds = TIMESPEC.unpack_from(value)
            kernel_us = seconds * 1_000_000 + nanoseconds // 1000
        elif kind == SO_TIMESTAMPING:
            kernel_us, hardware_us = time_us(value, 0), time_us(value, 2)
        elif kind == SO_RXQ_OVFL:
            lost = int(U32.unpack(value[:4])[0])
    return kernel_us, hardware_us, lost


def only_word(word: int) -> bytes:
    """Exactly this id, in its own length: an id with its flag, as Frame.key is."""
    mask = socket.CAN_EFF_MASK if word & CAN_EFF_FLAG else socket.CAN_SFF_MASK
    return FILTER.pack(word, mask | CAN_EFF_FLAG)
