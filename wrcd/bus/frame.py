"""A CAN frame with the time of its reception in whole microseconds."""

from collections.abc import Mapping
from dataclasses import dataclass

EXTENDED = 0x8000_0000  # in a key, and in the kernel's word: the id is one of 29 bits
REMOTE, ERROR = 0x4000_0000, 0x2000_0000  # in the kernel's word
ID_BITS, STANDARD_BITS = 0x1FFF_FFFF, 0x7FF
GROUP = 0x4000_0000  # in a key that is looked for: any frame of its parameter group (J1939)


def id_text(key: int) -> str:
    """Return the id of a key in hexadecimal; an extended one has eight digits."""
    return f"0x{key & ID_BITS:08X}{' of any sender' * bool(key & GROUP)}" if key & EXTENDED else f"0x{key:03X}"


def mask_of(key: int) -> int:
    """The bits that a frame's key must have in common with a key that is looked for: all; of a group neither those of
    priority and source address, nor those of the destination where ids have one."""
    if not key & GROUP:
        return EXTENDED | ID_BITS
    return EXTENDED | (0x3FF_FF00 if key >> 16 & 0xFF >= 0xF0 else 0x3FF_0000)


def counted_ids(counts: Mapping[int, int], most: int = 8) -> str:
    """Return the commonest of some keys, each with its count: "0x101 200, 0x130 50, …"."""
    first = sorted(counts.items(), key=lambda item: -item[1])[:most]
    return ", ".join(f"{id_text(key)} {count}" for key, count in first) + (", …" if len(counts) > most else "")


# Not frozen, though nobody changes one: a frozen dataclass of its fields takes seven times as long to make, longer
# than to receive the frame from the kernel.
@dataclass(slots=True, unsafe_hash=True)
class Frame:
    """stamp_us is microseconds since 1970; a received frame's stamp is truncated, never rounded up."""

    stamp_us: int
    can_id: int
    data: bytes
    extended: bool = False
    remote: bool = False
    error: bool = False
    fd: bool = False
    # FD: its flags (1 bit rate switched, 2 sender error passive); remote: the length asked for; else a DLC above 8
    extra: int = 0

    @property
    def plain(self) -> bool:
        """A classical data frame: what most mapped messages are."""
        return not (self.remote or self.error or self.fd)

    @property
    def key(self) -> int:
        """Identity of the frame's message: the id, and EXTENDED if it has 29 bits. Two messages may share a number."""
        return self.can_id | EXTENDED if self.extended else self.can_id

    @property
    def possible(self) -> bool:
        """Whether a bus can carry it: a damaged log names ids and lengths that there are not."""
        longest_id = 0x1FFFFFFF if self.extended or self.error else 0x7FF
        return 0 <= self.can_id <= longest_id and len(self.data) <= (64 if self.fd else 8)
