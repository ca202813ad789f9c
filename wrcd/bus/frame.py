"""A CAN frame with the time of its reception in whole microseconds."""

from dataclasses import dataclass

EXTENDED = 0x8000_0000  # in a key: the id is one of 29 bits


# Not frozen, though nobody changes one: a frozen dataclass of seven fields takes seven times as long to make, longer
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

    @property
    def plain(self) -> bool:
        """A classical data frame: what most mapped messages are."""
        return not (self.remote or self.error or self.fd)

    @property
    def key(self) -> int:
        """Identity of the frame's message: the id, and EXTENDED if it has 29 bits. Two messages may share a number."""
        return self.can_id | EXTENDED if self.extended else self.can_id
