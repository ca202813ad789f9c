"""The consumer under test: what the plug-in asks of it, and an adapter for a Python object on virtual time."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from wrcd.bus.frame import Frame


class ConsumerError(Exception):
    """The consumer cannot be asked: it has ended, or says what nobody understands."""


@dataclass(frozen=True, slots=True)
class Use:
    """What a consumer makes of an axle's adhesion: the most that it asks for, in percent of the load; None: it falls
    back, as if there were no wrcd."""

    limit_pct: float | None
    axle: int


@dataclass(frozen=True, slots=True)
class BusSettings:
    """Where the frames come from. config: the daemon's configuration (None: the default); axles: their numbers."""

    interface: str
    channel: str
    config: Path | None
    axles: tuple[int, ...]


class Consumer(Protocol):
    """A consumer that listens to a bus by itself: a process, a receiver in C, a controller on a bench."""

    def start(self, bus: BusSettings) -> None:
        """Begin to listen. It may take its time: nothing is judged before it uses a frame."""

    def use(self, axle: int) -> Use:
        """What it uses of an axle now. Asked every 5 ms; raises ConsumerError."""

    def stop(self) -> None:
        """End."""


class Hearing(Protocol):
    """A Python object that is handed frames and time. Times are microseconds since 1970."""

    def hear(self, frame: Frame) -> None:
        """A frame has come, at its stamp. Every frame of the bus is handed over, those of other ids too."""

    def use(self, axle: int, now_us: int) -> Use:
        """What it uses of an axle at a time. Times only grow."""


class ObjectConsumer:
    """Tests a Python object on virtual time: a new one for every check. make: its class, or what makes one."""

    def __init__(self, make: Callable[[], Hearing]) -> None:
        self._make = make
        self._object: Hearing | None = None

    def start(self, bus: BusSettings) -> None:
        """Make the object. It needs no bus."""
        self._object = self._make()

    def hear(self, frame: Frame) -> None:
        """Hand a frame over."""
        if self._object is None:
            raise ConsumerError("the consumer was not started")
        self._object.hear(frame)

    def use_at(self, axle: int, now_us: int) -> Use:
        """What it uses at a time."""
        if self._object is None:
            raise ConsumerError("the consumer was not started")
        return self._object.use(axle, now_us)

    def stop(self) -> None:
        """Forget the object."""
        self._object = None
