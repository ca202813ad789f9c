"""Links to a bus: what the loop needs of one."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame

MAX_FRAMES = 4096  # that a link hands over at a time, so that no flood keeps the loop from its tick

LinkState = Literal["Up", "Down", "Gone", "ErrorPassive", "BusOff"]


@dataclass(slots=True)
class LinkHealth:
    """What a link has seen so far."""

    state: LinkState = "Up"
    drops: int = 0  # frames lost because a buffer was full
    reopens: int = 0  # how often the device had to be opened again
    unsent: int = 0  # frames that could not be sent and were dropped
    error_frames: int = 0  # that the controller reported
    bus_offs: int = 0
    foreign_frames: int = 0  # of messages that are sent here, and that somebody else sent
    # the same by message (Frame.key), for the log
    foreign_by_key: Counter[int] = field(default_factory=Counter)

    def foreign(self, key: int) -> None:
        """Somebody else has sent a message that is sent here."""
        self.foreign_frames += 1
        self.foreign_by_key[key] += 1

    @property
    def up(self) -> bool:
        """Whether the bus can be expected to carry frames now."""
        return self.state in ("Up", "ErrorPassive")


class Link(Protocol):
    """One bus, without threads: what has arrived lies in the kernel (or the driver) until it is fetched."""

    name: str
    health: LinkHealth
    stamps_arrivals: bool = False  # whether stamps tell when frames came, or perhaps when they were fetched

    def receive(self, now_us: int) -> list[Frame]:
        """What is there, oldest first, MAX_FRAMES at the most. now_us serves re-opening, and stamps where the interface
        has none."""

    def receive_batch(self, now_us: int) -> FrameBatch | list[Frame]:
        """The same, where the link can without one Python object for each."""
        return self.receive(now_us)

    def send(self, frame: Frame) -> bool:
        """Send at once or not at all: a frame that has to queue would arrive stale."""

    def send_all(self, frames: FrameBatch | Sequence[Frame]) -> list[bool]:
        """Send a slot's frames, each at once or not at all. Returns which have been sent."""
        return [self.send(frame) for frame in frames]

    def close(self) -> None:
        """Let go of the bus."""
