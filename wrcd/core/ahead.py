"""What lies ahead of an axle, as the axles before it have met it: the slot's side of fusion along the vehicle.

A leading axle's sign (front.py), or the fall of its Valid estimate, makes a drop: a place on the track. It moves
towards the axles behind at the train's speed, and is told to each until it has passed. The estimate of the axles that
are on it says how much adhesion there is. A drop that no estimate bears out is taken back.

Nothing here changes what is said of an axle itself.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.bus.codec import Value
from wrcd.core.causes import Validity
from wrcd.core.front import View
from wrcd.core.messages import Report, nan_to_none
from wrcd.core.vocabulary import NOT_AVAILABLE
from wrcd.estimator.design import FloatArray
from wrcd.estimator.records import Estimate

MAX_DROPS = 8  # that are known at once; of more the newest
MAX_AGE_S = 30.0  # a train that stands forgets where it was
ON_M = 5.0  # so far behind its begin a drop is still told: the axle's own signals then tell of it
MAX_AHEAD_M = 100.0
ENTERING_S = 0.5  # before an axle is there
SAME_M, SAME_S = 3.0, 0.1  # two signs so close together, in way or time, are of one drop
FALLEN_TO = 0.75  # of the estimate before: what is less is a drop
CLEAN_S = 0.04  # by which a window may reach back before the drop and still count as of it
BORNE_OUT_S = 0.6  # after which an estimate that has not fallen takes a suspicion back
FOLLOW_M = 40.0  # of a drop: its adhesion is learned from the first so much
FALLS_S, RISES_S = 3.0, 0.5  # time constants of the adhesion that an axle had before
# An estimate alone makes a drop where it is far below that for a while, and torque enough is in use to tell by.
FAR_FALLEN_TO, FAR_FALLEN_S, MIN_USED_PCT = 0.6, 0.2, 3.0
AGE_LIMIT_MS = 4000
_PLACE, _SEEN_S, _BY, _EVIDENCE, _MU, _BEFORE = range(6)
_SUSPECTED, _CONFIRMED = 1.0, 2.0
_EVIDENCES = {_SUSPECTED: "Suspected", _CONFIRMED: "Confirmed"}


@dataclass(frozen=True, slots=True)
class Told:
    """What is told to one axle; None is not available."""

    state: str
    evidence: str = "None"
    seen_by: int = 0  # number of the axle
    mu_pct: float | None = None
    distance_m: float | None = None
    age_ms: float | None = None

    @property
    def warns(self) -> bool:
        """Whether there is a drop."""
        return self.evidence != "None"

    def values(self) -> dict[str, Value]:
        """By signal name of the DBC."""
        return {
            "State": self.state,
            "Evidence": self.evidence,
            "SeenBy": float(self.seen_by),
            "MuAhead": self.mu_pct,
            "Distance": self.distance_m,
            "Age": self.age_ms,
        }


NOBODY_AHEAD = Told(NOT_AVAILABLE)
NOTHING_SEEN = Told("NothingSeen")


class Ahead:
    """Keeps the drops of a train and tells them, slot by slot. numbers: of the axles."""

    STATE = {"epoch": "_epoch", "drops": "_drops", "before_pct": "_before", "low_s": "_low_s", "slot_s": "_slot_s"}

    def __init__(self, numbers: Sequence[int]) -> None:
        n = len(numbers)
        self._numbers = tuple(numbers)
        self._epoch = -1
        self._drops: FloatArray = np.full((MAX_DROPS, 6), np.nan)  # rows are empty where the place is NaN
        self._before: FloatArray = np.full(n, np.nan)  # adhesion (%) that each axle had
        self._low_s: FloatArray = np.full(n, np.nan)  # since when its estimate has been far below that
        self._slot_s = math.nan  # of the newest slot

    def update(self, now_s: float, view: View, reports: Sequence[Report], estimate: Estimate | None) -> list[Told]:
        """A slot: what is told to each axle."""
        if view.epoch != self._epoch:
            self._epoch = view.epoch
            self._drops[:] = np.nan
            self._before[:] = np.nan
            self._low_s[:] = np.nan
        if math.isnan(view.way_m):
            return [NOBODY_AHEAD] * len(self._numbers)
        mu, most, window_s = _estimates(reports, estimate)
        self._note_signs(now_s, view)
        self._note_falls(now_s, view, most, window_s)
        self._learn(view, mu, window_s)
        self._forget(now_s, view)
        self._remember(now_s, mu)
        leader = float(np.max(view.x_m, where=view.ready, initial=-math.inf))
        silent = [NOTHING_SEEN if leader > x else NOBODY_AHEAD for x in view.x_m.tolist()]
        if not np.isfinite(self._drops[:, _PLACE]).any():
            return silent
        return [self._told(axle, now_s, view, mu) or silent[axle] for axle in range(len(self._numbers))]

    def _note_signs(self, now_s: float, view: View) -> None:
        """A sign of a leading axle that had an estimate is a drop, or another axle's sight of one."""
        for axle in np.flatnonzero(np.isfinite(view.met_m) & np.isfinite(self._before)).tolist():
            place = float(view.met_m[axle] + view.x_m[axle])
            same = self._near(place, view.speed_m_s)
            if same is None:
                self._add(place, now_s, axle)
            elif self._drops[same, _BY] != axle:
                self._drops[same, _EVIDENCE] = _CONFIRMED

    def _note_falls(self, now_s: float, view: View, most: FloatArray, window_s: FloatArray) -> None:
        """An estimate that has fallen for good without a sign is a drop, too: it began where its window does."""
        low = most < FAR_FALLEN_TO * self._before
        since_s = np.where(low, np.fmin(self._low_s, now_s), np.nan)
        fallen = (now_s - since_s >= FAR_FALLEN_S) & ~(self._slot_s - self._low_s >= FAR_FALLEN_S)
        self._low_s = since_s
        own = view.way_m + view.x_m
        for axle in np.flatnonzero(fallen).tolist():
            begun = float(own[axle] - view.speed_m_s * window_s[axle])
            places = self._drops[:, _PLACE]
            known = (places <= own[axle]) & (places >= begun - SAME_M - SAME_S * view.speed_m_s)
            if not known.any():
                self._add(begun, now_s, axle)

    def _add(self, place: float, now_s: float, axle: int) -> None:
        empty = np.isnan(self._drops[:, _PLACE])
        row = int(empty.argmax()) if empty.any() else int(self._drops[:, _SEEN_S].argmin())
        self._drops[row] = place, now_s, axle, _SUSPECTED, np.nan, self._before[axle]

    def _near(self, place: float, speed_m_s: float) -> int | None:
        """The drop that begins at a place, or so close to it that it is the same."""
        apart = np.abs(self._drops[:, _PLACE] - place)
        near = np.flatnonzero(apart <= max(SAME_M, SAME_S * speed_m_s))
        return int(near[apart[near].argmin()]) if len(near) else None

    def _learn(self, view: View, mu: FloatArray, window_s: FloatArray) -> None:
        """How much adhesion there is behind a drop, from the axles on it whose windows hold nothing else."""
        own, speed = view.way_m + view.x_m, max(view.speed_m_s, 1.0)
        for row in np.flatnonzero(np.isfinite(self._drops[:, _PLACE])).tolist():
            drop = self._drops[row]
            way = own - drop[_PLACE]
            clean = (way > 0.0) & (way <= FOLLOW_M) & (window_s <= way / speed + CLEAN_S) & np.isfinite(mu)
            if clean.any():
                drop[_MU] = np.fmin(drop[_MU], mu[clean].min())
            before = drop[_BEFORE]
            if drop[_MU] < FALLEN_TO * before:
                drop[_EVIDENCE] = _CONFIRMED
            elif (
                drop[_EVIDENCE] == _SUSPECTED and math.isfinite(drop[_MU]) and way[int(drop[_BY])] > BORNE_OUT_S * speed
            ):
                drop[:] = np.nan

    def _forget(self, now_s: float, view: View) -> None:
        """Drops that the last axle has passed, and old ones."""
        last = view.way_m + float(view.x_m.min())
        over = (self._drops[:, _PLACE] < last - ON_M) | (now_s - self._drops[:, _SEEN_S] > MAX_AGE_S)
        self._drops[over] = np.nan

    def _remember(self, now_s: float, mu: FloatArray) -> None:
        """The adhesion that an axle had follows its estimate: upwards soon, downwards slowly."""
        elapsed = now_s - self._slot_s if now_s > self._slot_s else 0.0
        self._slot_s = now_s
        share = np.where(mu > self._before, elapsed / RISES_S, elapsed / FALLS_S)
        moved = self._before + np.minimum(share, 1.0) * (mu - self._before)
        self._before = np.where(np.isnan(self._before), mu, np.where(np.isnan(mu), self._before, moved))

    def _told(self, axle: int, now_s: float, view: View, mu: FloatArray) -> Told | None:
        """The nearest drop that an axle goes towards or has just reached, and that is less than what it has, if any."""
        x = view.x_m
        place = self._drops[:, _PLACE] - (view.way_m + x[axle])
        by = np.nan_to_num(self._drops[:, _BY]).astype(np.int64)
        here = (place >= -ON_M) & (place <= MAX_AHEAD_M) & (x[by] > x[axle])
        here &= ~(self._drops[:, _MU] >= FALLEN_TO * mu[axle])
        if not here.any():
            return None
        row = int(np.where(here, place, np.inf).argmin())
        drop, distance = self._drops[row], float(place[row])
        entering = distance <= ENTERING_S * view.speed_m_s
        return Told(
            state="OnIt" if distance <= 0.0 else "Entering" if entering else "Ahead",
            evidence=_EVIDENCES[float(drop[_EVIDENCE])],
            seen_by=self._numbers[int(drop[_BY])],
            mu_pct=nan_to_none(float(drop[_MU])),
            distance_m=max(distance, 0.0),
            age_ms=min(1000.0 * (now_s - float(drop[_SEEN_S])), AGE_LIMIT_MS),
        )


def _estimates(reports: Sequence[Report], estimate: Estimate | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of each axle (n,), NaN where it is not Valid: its adhesion, the most that it may be where torque enough is in use
    to tell by (both in %), and its window (s)."""
    n = len(reports)
    valid = np.array([r.validity is Validity.VALID for r in reports])
    if estimate is None or not valid.any():
        nothing = np.full(n, np.nan)
        return nothing, nothing, nothing
    mu, window_s = (np.where(valid, x, np.nan) for x in (estimate.mu_available_pct, estimate.window_s))
    most = np.where(estimate.used_pct >= MIN_USED_PCT, mu + estimate.half_width_pp, np.nan)
    return mu, most, window_s
