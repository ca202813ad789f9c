"""Every change of an axle's Validity, and of its cause while it is not Valid: when, from what to what, and why.

A text is made where something changes and nowhere else. What speaks against a tick is described when it begins: a slot
later it may be over. What an estimate says against itself is described from the estimate.
"""

import csv
import io
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wrcd.core.causes import RESERVED, Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.details import Details
from wrcd.core.estimator import PairHealth
from wrcd.core.inputs import Inputs, TickInputs
from wrcd.core.messages import Report
from wrcd.core.records import Estimate
from wrcd.core.validity import OF_ESTIMATE, OF_PAIR, Standing, ValidityMonitor

COLUMNS = ("time_s", "axle", "from", "to", "cause", "detail")
MAX_KEPT = 4096  # changes, for those who look after every turn
MAX_DETAIL = 200  # characters
# What a cause is described from: the axle's sensors, the estimate, what an axle lacks; else it is of a tick.
PAIR_CAUSES = frozenset(OF_PAIR.values())
ESTIMATE_CAUSES = frozenset((*OF_ESTIMATE.values(), Cause.CONTRADICTION))
LACKS = frozenset((Cause.WARMING_UP, Cause.STANDSTILL, Cause.INPUT_SILENT))
TICK_CAUSES = frozenset(Cause) - PAIR_CAUSES - ESTIMATE_CAUSES - LACKS - RESERVED - {Cause.NONE, Cause.RESTARTED}


@dataclass(frozen=True, slots=True)
class Change:
    """One axle (its number) at one slot. The cause and the detail, an input with its figures, are of not being Valid.

    before and after are alike where the cause alone has changed.
    """

    time_us: int
    axle: int
    before: Validity
    after: Validity
    cause: Cause
    detail: str

    @property
    def step(self) -> str:
        """From what to what, and the cause: "Valid -> Degraded, InputStale"."""
        step = self.after.value if self.before is self.after else f"{self.before} -> {self.after}"
        return f"{step}, {self.cause.label}" if self.cause else step

    @property
    def text(self) -> str:
        """For a person: "Valid -> Degraded, InputStale: yaw rate A.B 20.9 ms old, limit 15"."""
        return f"{self.step}: {self.detail}" if self.cause else self.step

    @property
    def csv_line(self) -> str:
        """A row of COLUMNS."""
        cause = self.cause.label if self.cause else ""
        return csv_line((csv_time(self.time_us), self.axle, self.before.value, self.after.value, cause, self.detail))


def csv_time(time_us: int) -> str:
    """A time as the rows have it, in seconds."""
    return f"{'-' * (time_us < 0)}{abs(time_us) // 1_000_000}.{abs(time_us) % 1_000_000:06d}"


def csv_line(cells: Sequence[object]) -> str:
    """Cells as a line of CSV, its end included."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(cells)
    return line.getvalue()


class Events:
    """Compares each slot with the one before."""

    validities: list[Validity]  # as at the newest slot
    confidences: list[str]
    causes: list[Cause]
    _standing: list[tuple[bool, Cause]]
    tick_causes: Sequence[Cause]  # what spoke against the newest tick
    _details: list[list[str]]

    def __init__(self, config: Config) -> None:
        n = len(config.axles)
        self._numbers = [a.number for a in config.axles]
        self.validities = [Validity.NOT_AVAILABLE] * n
        self.confidences = ["None"] * n
        self.causes = [Cause.NONE] * n
        self._standing = [(False, Cause.NONE)] * n
        self.tick_causes = (Cause.NONE,) * n
        # by axle and cause: how that was when it began, of the causes that a slot may be too late to describe
        self._details = [[""] * len(Cause) for _ in range(n)]
        self.describe = Details(config)
        self.total = 0  # changes so far
        self._kept: deque[Change] = deque(maxlen=MAX_KEPT)

    @property
    def all_estimated(self) -> bool:
        """Whether every axle had an estimate at the newest slot."""
        return Validity.NOT_AVAILABLE not in self.validities and all(has for has, _ in self._standing)

    @property
    def standing_causes(self) -> list[Cause]:
        """What spoke against each axle at the newest slot, whatever its estimate was."""
        return [cause for _, cause in self._standing]

    def since(self, total: int) -> list[Change]:
        """The changes after the first so many, as far as they are kept."""
        new = min(self.total - total, len(self._kept))
        return [self._kept[k] for k in range(-new, 0)]

    def tick(self, causes: Sequence[Cause], inputs: Inputs, tick: TickInputs, end_us: int) -> None:
        """Other things speak against a tick than against the one before."""
        for axle, (cause, before) in enumerate(zip(causes, self.tick_causes, strict=True)):
            if cause and cause is not before:
                self._details[axle][cause] = _cut(self.describe.tick(cause, axle, inputs, tick, end_us))
        self.tick_causes = causes

    def restarted(self, axle: int, why: str) -> None:
        """An axle was started anew."""
        self._details[axle][Cause.RESTARTED] = _cut(why)

    def standing(
        self, standing: Sequence[Standing], inputs: Inputs, validity: ValidityMonitor, health: PairHealth, end_us: int
    ) -> Mapping[int, str]:
        """How it is, by axle (its place): of those whose standing differs from that at the slot before."""
        if standing == self._standing:
            return {}
        changed = [
            axle for axle, (now, before) in enumerate(zip(standing, self._standing, strict=True)) if now != before
        ]
        self._standing = list(standing)
        out = {}
        for axle in changed:
            cause = standing[axle].cause
            if not cause:
                self._details[axle] = [""] * len(Cause)  # a window of sound ticks: all of that is over
            elif cause in PAIR_CAUSES:
                out[axle] = self.describe.pair(axle, health)
            elif cause in TICK_CAUSES or cause is Cause.RESTARTED:
                out[axle] = self._details[axle][cause]
            else:
                out[axle] = self.describe.unavailable(cause, axle, inputs, validity, end_us)
        return out

    def slot(
        self, end_us: int, reports: Sequence[Report], standing: Mapping[int, str], estimate: Estimate | None
    ) -> None:
        """Note what differs from the slot before; standing is what was reported at the slot of the axles' standing."""
        for axle, r in enumerate(reports):
            validity, cause, before = r.validity, r.cause, self.validities[axle]
            self.confidences[axle] = r.confidence
            if cause is self.causes[axle] and validity is before:
                continue
            self.validities[axle], self.causes[axle] = validity, cause
            detail = standing.get(axle, "")
            if cause and not detail and estimate is not None and validity is Validity.DEGRADED:
                detail = self.describe.estimate(cause, axle, estimate)
            detail = _cut(detail or cause.words)
            self.total += 1
            self._kept.append(Change(end_us, self._numbers[axle], before, validity, cause, detail))


def _cut(text: str) -> str:
    return text if len(text) <= MAX_DETAIL else text[: MAX_DETAIL - 4] + " ..."
