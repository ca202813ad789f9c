"""Faults that send frames beside the train's own."""

import math
from collections.abc import Iterable, Iterator, Sequence

from sim_ecu.play.encoder import SAMPLE_US, Sample, Sent
from sim_ecu.play.fault_at_work import FrameFault
from sim_ecu.play.faults import Fault
from sim_ecu.play.train import Carrier, Train

BESIDE_US = 2_500  # by how much a second sender's frames come later than the first's
SECOND_COUNTER = 7  # at which a second sender begins to count
ERROR_CLASS = 0x80  # CAN_ERR_BUSERROR of linux/can/error.h


class Sender(FrameFault):
    """Somebody else sends the same messages."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        self._encoder = train.encoder(self.numbers, truth=False, counter=SECOND_COUNTER)

    def beside(self, sample: Sample) -> Iterator[Sent]:
        """The other's frames."""
        for f in self._encoder.frames(sample.scaled(self.amount)):
            if f.key in self.messages:
                yield f._replace(due_us=f.due_us + BESIDE_US)


class Babble(FrameFault):
    """A node that does not stop."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        self._copied: Sent | None = None

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame as it is, remembered."""
        self._copied = f
        return (f,)

    def beside(self, sample: Sample) -> Iterator[Sent]:
        """The unmapped id and the copy in turn."""
        for k, due_us in _every(sample.due_us, self.amount):
            if k % 2 == 0:
                yield Sent(due_us, self.train.idle_id, bytes(8))
            elif self._copied is not None:
                yield self._copied._replace(due_us=due_us)


class ErrorFlood(FrameFault):
    """Error frames, as the controller reports bus errors."""

    def carriers(self) -> list[Carrier]:
        """It is of no message."""
        return []

    def beside(self, sample: Sample) -> Iterator[Sent]:
        """Error frames."""
        for _, due_us in _every(sample.due_us, self.amount):
            yield Sent(due_us, ERROR_CLASS, bytes(8), error=True)


def _every(due_us: int, per_second: float) -> Iterator[tuple[int, int]]:
    """Number and time, within a sample, of what comes so often from the scenario's start on."""
    first, last = (math.ceil(t * per_second / 1e6) for t in (due_us, due_us + SAMPLE_US))
    for k in range(first, last):
        yield k, round(k * 1e6 / per_second)
