"""The time that rig and daemon go by: the computer's own, or on a virtual bus one that waits for a busy computer."""

import time
from typing import Protocol

STEP_NS = 1_000_000  # of paced time at once: less than lies between two samples


class Clock(Protocol):
    """What the module `time` has of clocks."""

    def monotonic_ns(self) -> int:
        """Nanoseconds that nobody steps."""

    def time_ns(self) -> int:
        """Nanoseconds since 1970."""


class RealPace:
    """The computer's own time."""

    def begin(self) -> None:
        """It has begun."""

    def turn(self) -> None:
        """It goes by itself."""

    def sleep(self, seconds: float) -> None:
        """Until then."""
        time.sleep(seconds)

    def monotonic_ns(self) -> int:
        """Nanoseconds that nobody steps."""
        return time.monotonic_ns()

    def time_ns(self) -> int:
        """Nanoseconds since 1970."""
        return time.time_ns()

    def steady_us(self) -> int:
        """Return the steady time in microseconds, as the daemon has it."""
        return self.monotonic_ns() // 1000

    def wall_us(self) -> int:
        """Return the wall time in microseconds, as frames are stamped."""
        return self.time_ns() // 1000


class Pace(RealPace):
    """Goes with the computer's time, but never further than STEP_NS between two turns. A computer that stood still
    finds every frame in its place: the demo hurries until it has caught up, and nothing is late in its own time.

    Only where no kernel stamps the frames: there everything must go by this.
    """

    def __init__(self, real: Clock = time) -> None:
        self._real = real
        self._begin_ns, self._elapsed_ns = real.monotonic_ns(), 0
        self._epoch_ns = real.time_ns()

    def begin(self) -> None:
        """Time goes on from now on: what was before is nothing to catch up with."""
        self._begin_ns = self._real.monotonic_ns() - self._elapsed_ns

    def turn(self) -> None:
        """Take a step, as far as time has gone on."""
        self._elapsed_ns += min(max(self._behind_ns, 0), STEP_NS)

    @property
    def _behind_ns(self) -> int:
        return self._real.monotonic_ns() - self._begin_ns - self._elapsed_ns

    def sleep(self, seconds: float) -> None:
        """Until then, in paced time; not at all while it is behind."""
        time.sleep(max(seconds - self._behind_ns * 1e-9, 0.0))

    def monotonic_ns(self) -> int:
        """Nanoseconds since the first beginning."""
        return self._elapsed_ns

    def time_ns(self) -> int:
        """Nanoseconds since 1970."""
        return self._epoch_ns + self._elapsed_ns
