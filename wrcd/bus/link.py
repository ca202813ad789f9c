"""Links to a bus: what the loop needs of one, and how to open it."""

from typing import Protocol

from wrcd.bus.frame import Frame


class Link(Protocol):
    """One bus, without threads: what has arrived lies in the kernel (or the driver) until it is fetched."""

    name: str
    drops: int  # frames lost because a buffer was full
    reopens: int  # how often the device had to be opened again
    unsent: int  # frames that could not be sent and were dropped

    @property
    def up(self) -> bool:
        """Whether the bus can be expected to carry frames now."""

    def receive(self, now_us: int) -> list[Frame]:
        """All that is there, oldest first. now_us serves re-opening, and stamps where the interface has none."""

    def send(self, frame: Frame) -> bool:
        """Send at once or not at all: a frame that has to queue would arrive stale."""

    def close(self) -> None:
        """Let go of the bus."""


def open_link(interface: str, channel: str, ids: tuple[int, ...] | None) -> Link:
    """Open a bus for some ids, or for every frame (None): SocketCAN by our own socket, everything else by python-can.

    Raises BusError if it can't be opened.
    """
    if interface == "socketcan":
        from wrcd.bus.socketcan import SocketCanLink

        return SocketCanLink(channel, ids)
    from wrcd.bus.pythoncan import PythonCanLink

    return PythonCanLink(interface, channel, ids)
