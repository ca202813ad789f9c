"""An axle that is reset again and again waits before it is tried once more, longer each time."""

# So many resets in a row are for nothing: a signal that steps resets the axle twice, when the step comes and when it
# goes, and a second signal beside it may do so again.
FREE_RESETS = 4
FIRST_WAIT_S, LAST_WAIT_S = 1.0, 8.0  # twice as long each time


class Backoff:
    """Counts each axle's resets that no full window of good ticks came between."""

    STATE = {"waits": "waits", "in_a_row": "_in_a_row", "until": "_until"}

    def __init__(self, axles: int, tick_s: float) -> None:
        self._tick_s = tick_s
        self.waits = 0  # of all axles so far
        self._in_a_row = [0] * axles
        self._until = [0] * axles  # number of the tick with which the axle is tried again

    def was_reset(self, axle: int, tick: int) -> None:
        """An axle was reset in a tick."""
        self._in_a_row[axle] = min(self._in_a_row[axle] + 1, FREE_RESETS + 10)
        doublings = self._in_a_row[axle] - FREE_RESETS - 1
        if doublings >= 0:
            self.waits += 1
            self._until[axle] = tick + 1 + round(min(FIRST_WAIT_S * 2**doublings, LAST_WAIT_S) / self._tick_s)

    def recovered(self, axle: int) -> None:
        """A full window of good ticks has come."""
        self._in_a_row[axle] = 0

    def waiting(self, axle: int, tick: int) -> bool:
        """Whether the axle is left alone in a tick."""
        return tick < self._until[axle]

    def wait_s(self, axle: int, tick: int) -> float:
        """For how long the axle is left alone from a tick on."""
        return max(self._until[axle] - tick - 1, 0) * self._tick_s

    def any_waits(self, tick: int) -> bool:
        """Whether any axle is left alone in a tick."""
        return tick < max(self._until)

    def reset(self) -> None:
        """A step of time, or a silence: a tick's number tells nothing of what came before."""
        self._in_a_row = [0] * len(self._in_a_row)
        self._until = [0] * len(self._until)
