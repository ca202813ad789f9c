"""What was refused of each input since its newest good frame."""

from collections import Counter

from wrcd.bus.reasons import Reason
from wrcd.core.jitter_buffer import NEVER


class Refusals:
    """By place (a quantity of an axle). Costs nothing while no frame is refused: a good frame is told by its stamp."""

    STATE = {"counts": "_counts", "good_us": "_good_us"}

    def __init__(self, places: int) -> None:
        self._counts: list[Counter[str]] = [Counter() for _ in range(places)]
        self._good_us = [NEVER] * places  # stamp of the good frame that they came after

    def reject(self, place: int, good_us: int, reason: Reason) -> None:
        """A frame was refused, the newest good one being of good_us."""
        if good_us != self._good_us[place]:
            self._good_us[place] = good_us
            self._counts[place].clear()
        self._counts[place][reason.value] += 1

    def since(self, place: int, good_us: int) -> str:
        """How many and why: "12 crc, 1 repeat"; nothing where none was."""
        if good_us != self._good_us[place]:
            return ""
        return ", ".join(f"{n} {reason}" for reason, n in self._counts[place].most_common())

    def reset(self) -> None:
        """A step of time, or a long silence."""
        for count in self._counts:
            count.clear()
        self._good_us = [NEVER] * len(self._good_us)
