"""AUTOSAR E2E Profile 11, data id mode "both": CRC in byte 0, counter 0 … 14 in the low nibble of byte 1."""

from wrcd.bus.reasons import Reason

COUNTER_MODULO = 15
# How many counts may be missing between two frames that are used one after the other (two lost frames).
MOST_LOST = 2


def _table() -> bytes:
    # SAE J1850: x^8 + x^4 + x^3 + x^2 + 1
    out = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x1D if crc & 0x80 else crc << 1
        out.append(crc & 0xFF)
    return bytes(out)


_CRC = _table()


def crc(data: bytes | bytearray, data_id: int) -> int:
    """CRC over the data id (low byte first) and the frame without its first byte. Initial and final value 0."""
    c = _CRC[_CRC[data_id & 0xFF] ^ (data_id >> 8)]
    for byte in memoryview(data)[1:]:
        c = _CRC[c ^ byte]
    return c


def protect(data: bytes | bytearray, data_id: int, counter: int) -> bytes:
    """The frame with counter and CRC written into it."""
    out = bytearray(data)
    out[1] = (out[1] & 0xF0) | counter
    out[0] = crc(out, data_id)
    return bytes(out)


class Checker:
    """Watches one protected message. The counter of every frame with a good CRC is remembered, used or not, so one
    frame is refused after a gap and the next is good again."""

    def __init__(self, data_id: int) -> None:
        self._data_id = data_id
        self._last: int | None = None

    def forget(self) -> None:
        """Start anew: the next frame's counter is taken as it comes."""
        self._last = None

    def check(self, data: bytes) -> Reason | None:
        """None if the frame may be used, else why not. The length has been checked."""
        if len(data) < 2 or data[0] != crc(data, self._data_id):
            return Reason.CRC
        counter, last = data[1] & 0x0F, self._last
        if counter >= COUNTER_MODULO:
            return Reason.COUNTER
        self._last = counter
        if last is None:
            return None
        step = (counter - last) % COUNTER_MODULO
        if step == 0:
            return Reason.REPEAT
        return None if step <= 1 + MOST_LOST else Reason.COUNTER
