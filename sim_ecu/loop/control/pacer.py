"""When a controller's cycles are: right after its wheel speeds come, so that no cycle works with old ones."""

from sim_ecu.loop.control.controller import CYCLE_US

SETTLE_US = 1_000  # from a frame to the cycle that works with it: the other axles' come meanwhile
WINDOW = 50  # frames
STEP_US = 200  # that the cycles are moved by after a window, once they are right: two clocks drift apart slowly
AWAY_US = 2_000  # further than this they are wrong


class Pacer:
    """Told when frames of a message of the same cycle came, says by how much the cycles are too early (us).

    A frame is late at times and early never: the earliest of a window counts. The first one counts at once.
    """

    def __init__(self) -> None:
        self._earliest_us: int | None = None
        self._frames, self._first = 0, True

    def hear(self, stamp_us: int) -> int:
        """By how much later the cycles are to come from now on; below zero: earlier."""
        # one that is late by nearly a cycle is none of the next that is early
        after_us = (stamp_us + SETTLE_US + AWAY_US) % CYCLE_US - AWAY_US
        self._earliest_us = after_us if self._earliest_us is None else min(self._earliest_us, after_us)
        self._frames += 1
        if self._frames < WINDOW and not self._first:
            return 0
        at_once = self._first or self._earliest_us > AWAY_US
        move_us, self._earliest_us, self._frames, self._first = self._earliest_us, None, 0, False
        return move_us if at_once else min(max(move_us, -STEP_US), STEP_US)
