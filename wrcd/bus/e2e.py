"""AUTOSAR E2E Profile 11, data id mode "both": CRC in byte 0, counter 0 … 14 in the low nibble of byte 1."""

import numpy as np
from numpy.typing import NDArray

COUNTER_MODULO = 15


def _table() -> bytes:
    # SAE J1850: x^8 + x^4 + x^3 + x^2 + 1
    out = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x1D if crc & 0x80 else crc << 1
        out.append(crc & 0xFF)
    return bytes(out)


CRC_TABLE = _table()
_TABLE = np.frombuffer(CRC_TABLE, dtype=np.uint8)


def crc(data: bytes | bytearray, data_id: int) -> int:
    """CRC over the data id (low byte first) and the frame without its first byte. Initial and final value 0."""
    return _crc_after(crc_of_data_id(data_id), data)


def crc_of_data_id(data_id: int) -> int:
    """The CRC of the data id alone: the part of it that is the same for all frames of a message."""
    return CRC_TABLE[CRC_TABLE[data_id & 0xFF] ^ (data_id >> 8)]


def _crc_after(start: int, data: bytes | bytearray) -> int:
    table, c = CRC_TABLE, start
    for byte in data[1:]:
        c = table[c ^ byte]
    return c


def crcs(data: NDArray[np.uint8], start: NDArray[np.uint8] | int, length: NDArray[np.int64] | int) -> NDArray[np.uint8]:
    """CRCs of many frames, (n,), with data (n, m). start: the CRC of their data ids (Checker.start)."""
    out = np.broadcast_to(np.asarray(start, dtype=np.uint8), len(data))
    for k in range(1, min(int(np.max(length, initial=0)), data.shape[1])):
        out = np.where(length > k, _TABLE[out ^ data[:, k]], out)
    return out


def protect(data: bytes | bytearray, data_id: int, counter: int) -> bytes:
    """The frame with counter and CRC written into it."""
    out = bytearray(data)
    out[1] = (out[1] & 0xF0) | counter
    out[0] = crc(out, data_id)
    return bytes(out)
