"""Why a mapped frame was not accepted. Every rejection is counted under one of these."""

from enum import StrEnum


class Reason(StrEnum):
    """The value is the word that counters and logs use."""

    KIND = "kind"  # remote, CAN FD or the other id length
    LENGTH = "length"  # DLC is not the message's
    CRC = "crc"  # E2E checksum: flipped bits, or another message under this id
    REPEAT = "repeat"  # E2E counter did not move
    COUNTER = "counter"  # E2E counter jumped or is out of range
    STATUS = "status"  # the sender itself says Error or NotAvailable
    RANGE = "range"  # beyond the DBC's minimum or maximum
    NOT_FINITE = "not finite"  # NaN or infinite after conversion
