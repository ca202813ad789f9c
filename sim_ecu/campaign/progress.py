"""How far a campaign has come, on standard error."""

import sys
import time
from collections.abc import Sequence

from sim_ecu.campaign.job import Ending, Row
from wrcd.tools.colour import moves
from wrcd.tools.progress import Progress

LINES = 20  # where there is no terminal: a line for each twentieth of the work


class Shown:
    """Jobs done of all, how many failed, jobs a second, time left.

    costs: of the jobs that are left, in their order; cost_before: of those that were there.
    """

    def __init__(self, jobs: int, before: int, costs: Sequence[float], cost_before: float) -> None:
        self._jobs, self._done, self._before = jobs, before, before
        self._costs, self._whole, self._cost = costs, cost_before + sum(costs) or 1.0, cost_before
        self._share_before = cost_before / self._whole
        self._failed = 0
        self._began = time.monotonic()
        self._progress = Progress(steps=True)
        self._every_share = moves(sys.stderr)
        self._next = 0.0

    def row(self, place: int, row: Row) -> None:
        """One more."""
        self._done += 1
        self._failed += row.ending is not Ending.DONE
        self._cost += self._costs[place]
        share = self._cost / self._whole
        if self._every_share or share >= self._next or self._done == self._jobs:
            self._next = share + 1 / LINES
            seconds = max(time.monotonic() - self._began, 1e-3)
            failed = f", {self._failed} failed" if self._failed else ""
            rate = (self._done - self._before) / seconds
            self._progress.at(
                f"{self._done} of {self._jobs} jobs{failed}, {_rate(rate)} jobs/s", share, self._share_before
            )

    def end(self) -> None:
        """Leave the line."""
        self._progress.end()


def _rate(rate: float) -> str:
    return f"{rate:.0f}" if rate >= 100 else f"{rate:.3g}"
