"""When the past is worth keeping: judged by the reports of every slot."""

from collections import deque
from collections.abc import Sequence

from wrcd.core.causes import Validity
from wrcd.core.messages import Report

LOST_SLOTS = 5  # in a row without Valid: less is a hiccup
COLLAPSED_PCT = 15.0
COLLAPSED_SHARE = 0.5  # of what it was
REMEMBERED_US = 1_000_000


class Triggers:
    """Watches every axle, each with a slot of its own. Give it each slot's reports once."""

    def __init__(self, slots_us: Sequence[int]) -> None:
        self._was_valid = [False] * len(slots_us)
        self._lost = [0] * len(slots_us)  # slots in a row that were not Valid
        # percent, 0 where it was not Valid
        self._mu: list[deque[float]] = [deque([0.0], max(1, REMEMBERED_US // slot_us)) for slot_us in slots_us]

    def look(self, reports: Sequence[Report], below_min_speed: bool, axles: Sequence[int]) -> str:
        """ "validity" or "collapse" in the slot where it shows, else nothing. axles: whose slot it is. A train that
        stands is not Valid by right; one that is about to stand, or an estimate that is too vague for other reasons,
        has lost nothing."""
        lost = collapsed = False
        for axle in axles:
            report = reports[axle]
            valid = report.validity is Validity.VALID
            if not report.vague:
                lost |= self._loses(axle, valid, below_min_speed)
            mu = (report.mu_available_pct or 0.0) if valid else 0.0
            before = self._mu[axle]
            collapsed |= valid and mu < min(COLLAPSED_PCT, COLLAPSED_SHARE * max(before))
            before.append(mu)
        return "validity" if lost else "collapse" if collapsed else ""

    def _loses(self, axle: int, valid: bool, below_min_speed: bool) -> bool:
        if valid or below_min_speed:
            self._was_valid[axle], self._lost[axle] = valid, 0
            return False
        self._lost[axle] += self._was_valid[axle]
        if self._lost[axle] < LOST_SLOTS:
            return False
        self._was_valid[axle], self._lost[axle] = False, 0
        return True
