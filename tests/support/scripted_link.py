"""A CAN link without a bus."""

from wrcd.bus.frame import Frame
from wrcd.bus.link import Link, LinkHealth


class ScriptedLink(Link):
    """A link that hands over the frames a test puts into `waiting`, each at its time stamp, and keeps what is sent."""

    name = "test"
    stamps_arrivals = True

    def __init__(self) -> None:
        self.health = LinkHealth()
        self.waiting: list[Frame] = []
        self.sent: list[Frame] = []
        self.closed = False

    def receive(self, now_us: int) -> list[Frame]:
        ready = [f for f in self.waiting if f.stamp_us <= now_us]
        self.waiting = [f for f in self.waiting if f.stamp_us > now_us]
        return ready

    def send(self, frame: Frame) -> bool:
        assert not self.closed
        self.sent.append(frame)
        return True

    def close(self) -> None:
        self.closed = True
