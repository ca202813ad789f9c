"""A CAN frame with the time of its reception in whole microseconds."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
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
        """A classical data frame: what every mapped message is."""
        return not (self.remote or self.error or self.fd)
