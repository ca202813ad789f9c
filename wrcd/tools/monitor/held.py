"""The newest frames as they came, in few large batches."""

from collections import deque
from collections.abc import Iterator

from wrcd.tools.monitor.batch import Batch

MIN_FRAMES = 1_000  # of a batch that is kept as it is: of a smaller one the arrays cost more than the frames


class Held:
    """At most max_frames of them, or one batch."""

    def __init__(self, max_frames: int) -> None:
        self._max = max_frames
        self._whole: deque[Batch] = deque()
        self._small: list[Batch] = []  # after those
        self._small_frames = 0
        self.frames = 0

    def add(self, batch: Batch) -> None:
        """Newer ones."""
        self._small.append(batch)
        self._small_frames += len(batch)
        self.frames += len(batch)
        if self._small_frames >= MIN_FRAMES:
            self._gather()
        while self.frames > self._max and len(self._whole) > 1:
            self.frames -= len(self._whole.popleft())

    def _gather(self) -> None:
        if self._small:
            self._whole.append(Batch.joined(self._small))
            self._small, self._small_frames = [], 0

    def __len__(self) -> int:
        """How many batches there are."""
        return len(self._whole) + len(self._small)

    def __iter__(self) -> Iterator[Batch]:
        """The frames, oldest first."""
        self._gather()
        return iter(tuple(self._whole))
