"""Why a mapped frame was not accepted. Every rejection is counted under one of these."""

from enum import StrEnum


class Reason(StrEnum):
    """The value is the word that counters and logs use."""

    KIND = "kind"  # remote, or CAN FD where the message is classical, or the other way round
    LENGTH = "length"  # DLC is not the message's
    CRC = "crc"  # E2E checksum: flipped bits
    DATA_ID = "data id"  # E2E checksum of another message: it came under the wrong id
    REPEAT = "repeat"  # E2E counter did not move
    COUNTER = "counter"  # E2E counter does not continue its sender's chain, or is out of range
    TWO_SENDERS = "two senders"  # two chains of counters go on beside each other: neither can be believed
    STATUS = "status"  # the sender itself says Error or NotAvailable
    RANGE = "range"  # beyond the DBC's minimum or maximum
    NOT_FINITE = "not finite"  # NaN or infinite after conversion
    STUCK = "stuck"  # a sensor says the same again and again while the train moves
    JUMP = "jump"  # further from the value before than anything moves, and not confirmed by a second frame

    @property
    def label(self) -> str:
        """The word as the DBC's value table and signal names spell it: DataId for "data id"."""
        return "".join(word.capitalize() for word in self.value.split())
