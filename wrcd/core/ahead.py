"""What lies ahead of an axle, as the axles before it have met it: the slot's side of fusion along the vehicle.

A leading axle's sign (front.py), or the fall of its Valid estimate, makes a drop: a place on the track. It moves
towards the axles behind at the train's speed, and is reported to each until it has passed. The estimate of the axles
that are on it says how much adhesion there is. A drop that no estimate bears out is taken back.

Nothing here changes what is reported of an axle itself.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.bus.codec import Value
from wrcd.core.causes import Validity
from wrcd.core.front import View
from wrcd.core.messages import Report
from wrcd.core.vocabulary import NOT_AVAILABLE
from wrcd.estimator.design import FloatArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.records import Estimate

# Set by hand: from a bogie, the lengths of the windows, and rides onto low rail of training seeds.
MAX_DROPS = 8  # that are known at once
ON_M = 5.0  # so far behind its begin a drop is still reported: the axle's own signals then show it
ENTERING_S = 0.5  # before an axle is there
SAME_M, SAME_S = 3.0, 0.1  # two signs so close together, in way or time, are of one drop
FALLEN_TO = 0.75  # of the estimate before: what is less is a drop
CLEAN_S = 0.04  # by which a window may reach back before the drop and still count as of it
BORNE_OUT_S = 0.6  # after which an estimate that has not fallen takes a suspicion back
FOLLOW_M = 40.0  # of a drop: its adhesion is learned from the first so much
FALLS_S, RISES_S = 3.0, 0.5  # time constants of the adhesion that an axle had before
SEES_US, LAPSES_US = 1_000_000.0, 5_000_000.0  # not Valid for longer: an axle sees nothing; what it had says nothing
# An estimate alone makes a drop where it is far below that for a while, and torque enough is in use to tell by.
FAR_FALLEN_TO, FAR_FALLEN_US, MIN_USED_PCT = 0.6, 200_000.0, 3.0
AGE_LIMIT_MS = 4000
_PLACE, _SEEN_US, _BY, _EVIDENCE, _MU, _BEFORE = range(6)
_SUSPECTED, _CONFIRMED = 1.0, 2.0
_EVIDENCES = {_SUSPECTED: "Suspected", _CONFIRMED: "Confirmed"}


@dataclass(frozen=True, slots=True)
class RailAhead:
    """The drop that one axle goes towards, if any; None is not available."""

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


NOBODY_AHEAD = RailAhead(NOT_AVAILABLE)
NOTHING_SEEN = RailAhead("NothingSeen")


@dataclass(init=False, repr=False, eq=False)
class Ahead:
    """Keeps the drops of a train and tells them, slot by slot. numbers: of the axles."""

    _drops: FloatArray  # empty rows are NaN
    _before: FloatArray  # adhesion (%) that each axle had
    _valid_us: FloatArray  # when it was Valid last; floats hold a date's microseconds
    _low_us: FloatArray  # since when its estimate has been far below that
    _blind_to_m: FloatArray  # the place up to which an axle may have missed a drop
    _epoch: int = -1
    _slot_us: float = math.nan  # of the newest slot

    def __init__(self, numbers: Sequence[int]) -> None:
        n = len(numbers)
        self._numbers = tuple(numbers)
        self._drops = np.full((MAX_DROPS, 6), np.nan)
        self._before = np.full(n, np.nan)
        self._valid_us = np.full(n, np.nan)
        self._low_us = np.full(n, np.nan)
        self._blind_to_m = np.full(n, np.nan)

    @property
    def is_possible(self) -> bool:
        """Whether the drops are such as this class makes: a state from a file may hold others."""
        empty = np.isnan(self._drops).all(axis=1)
        place, seen_us, by, evidence, mu, _ = self._drops[~empty].T
        known = np.isfinite(place) & np.isfinite(seen_us) & np.isin(by, np.arange(len(self._numbers)))
        suspected = (evidence == _SUSPECTED) & ~np.isinf(mu)
        return bool((known & (suspected | ((evidence == _CONFIRMED) & np.isfinite(mu)))).all())

    def update(self, now_us: int, view: View, reports: Sequence[Report], estimate: Estimate | None) -> list[RailAhead]:
        """Take a slot's view and reports; return what lies ahead of each axle."""
        if view.epoch != self._epoch:
            self._epoch = view.epoch
            for known in (self._drops, self._before, self._low_us, self._blind_to_m):
                known[:] = np.nan
        if math.isnan(view.way_m):
            return [NOBODY_AHEAD] * len(self._numbers)
        now, own = float(now_us), view.way_m + view.x_m
        mu, most, past_s = _estimates(reports, estimate)
        self._note_restarts(view)
        self._note_signs(now, view)
        self._note_falls(now, view, most, past_s)
        self._learn(view, mu, past_s)
        self._drops[self._drops[:, _PLACE] < own.min() - ON_M] = np.nan  # the last axle has passed them
        self._remember(now, mu)
        sees = view.ready & np.isfinite(self._before) & (now - self._valid_us <= SEES_US)
        missed = ~sees | np.isnan(self._blind_to_m)
        self._blind_to_m = np.where(missed, np.fmax(self._blind_to_m, own), self._blind_to_m)
        silent = [NOTHING_SEEN if self._is_seen(axle, view, own) else NOBODY_AHEAD for axle in range(len(own))]
        if not np.isfinite(self._drops[:, _PLACE]).any():
            return silent
        return [self._warning(axle, now, view, mu) or silent[axle] for axle in range(len(self._numbers))]

    def _is_seen(self, axle: int, view: View, own: FloatArray) -> bool:
        """Whether an axle ahead has watched all the way from an axle's place to its own."""
        return bool(((view.x_m > view.x_m[axle]) & (self._blind_to_m <= own[axle])).any())

    def _note_restarts(self, view: View) -> None:
        """What an axle suspected, and what it had, does not hold where its sensors or their estimate broke."""
        for axle in np.flatnonzero(view.lost).tolist():
            self._before[axle] = self._low_us[axle] = np.nan
            self._lose((self._drops[:, _BY] == axle) & (self._drops[:, _EVIDENCE] == _SUSPECTED))

    def _note_signs(self, now: float, view: View) -> None:
        """A sign of an axle that had an estimate is a drop, unless one is known there. Another axle's sign at the same
        place proves none: a joint, a switch or a jolt of the whole train shows as much."""
        for axle in np.flatnonzero(np.isfinite(view.met_m) & np.isfinite(self._before)).tolist():
            place = float(view.met_m[axle] + view.x_m[axle])
            if not (np.abs(self._drops[:, _PLACE] - place) <= max(SAME_M, SAME_S * view.speed_m_s)).any():
                self._add(place, now, axle)

    def _note_falls(self, now: float, view: View, most: FloatArray, past_s: FloatArray) -> None:
        """An estimate that has fallen for good without a sign is a drop, too: it began where its past does."""
        low = most < FAR_FALLEN_TO * self._before
        since_us = np.where(low, np.fmin(self._low_us, now), np.nan)
        fallen = (now - since_us >= FAR_FALLEN_US) & ~(self._slot_us - self._low_us >= FAR_FALLEN_US)
        self._low_us = since_us
        own = view.way_m + view.x_m
        for axle in np.flatnonzero(fallen).tolist():
            begun = float(own[axle] - view.speed_m_s * past_s[axle])
            places = self._drops[:, _PLACE]
            known = (places <= own[axle]) & (places >= begun - SAME_M - SAME_S * view.speed_m_s)
            if not known.any():
                self._add(begun, now, axle)

    def _add(self, place: float, now: float, axle: int) -> None:
        """A new drop. Where there are too many, the oldest that is only suspected is lost, else the oldest."""
        empty = np.isnan(self._drops[:, _PLACE])
        if not empty.any():
            empty[np.lexsort((self._drops[:, _SEEN_US], self._drops[:, _EVIDENCE]))[0]] = True
            self._lose(empty)
        self._drops[int(empty.argmax())] = place, now, axle, _SUSPECTED, np.nan, self._before[axle]

    def _lose(self, rows: BoolArray) -> None:
        """Forget drops that nobody has disproved: up to there, nobody has seen nothing."""
        places = self._drops[rows, _PLACE]
        if len(places):
            self._blind_to_m = np.fmax(self._blind_to_m, places.max() + ON_M)
            self._drops[rows] = np.nan

    def _learn(self, view: View, mu: FloatArray, past_s: FloatArray) -> None:
        """How much adhesion there is behind a drop, from the axles on it whose estimates are mostly of that."""
        own, speed = view.way_m + view.x_m, max(view.speed_m_s, 1.0)
        for row in np.flatnonzero(np.isfinite(self._drops[:, _PLACE])).tolist():
            drop = self._drops[row]
            way = own - drop[_PLACE]
            clean = (way > 0.0) & (way <= FOLLOW_M) & (past_s <= way / speed + CLEAN_S) & np.isfinite(mu)
            if clean.any():
                drop[_MU] = np.fmin(drop[_MU], mu[clean].min())
            if drop[_MU] < FALLEN_TO * drop[_BEFORE]:
                drop[_EVIDENCE] = _CONFIRMED
            elif (
                drop[_EVIDENCE] == _SUSPECTED and math.isfinite(drop[_MU]) and way[int(drop[_BY])] > BORNE_OUT_S * speed
            ):
                drop[:] = np.nan

    def _remember(self, now: float, mu: FloatArray) -> None:
        """The adhesion that an axle had follows its estimate: upwards soon, downwards slowly, and not for ever."""
        elapsed_s = 1e-6 * (now - self._slot_us) if now > self._slot_us else 0.0
        self._slot_us = now
        self._valid_us = np.where(np.isnan(mu), self._valid_us, now)
        self._before[now - self._valid_us > LAPSES_US] = np.nan
        share = np.where(mu > self._before, elapsed_s / RISES_S, elapsed_s / FALLS_S)
        moved = self._before + np.minimum(share, 1.0) * (mu - self._before)
        self._before = np.where(np.isnan(self._before), mu, np.where(np.isnan(mu), self._before, moved))

    def _warning(self, axle: int, now: float, view: View, mu: FloatArray) -> RailAhead | None:
        """The drop that an axle goes towards or has just reached, and that is less than what it has, if any."""
        x, drops = view.x_m, self._drops
        place = drops[:, _PLACE] - (view.way_m + x[axle])
        by = np.nan_to_num(drops[:, _BY]).astype(np.int64)
        here = (place >= -ON_M) & (x[by] > x[axle]) & ~(drops[:, _MU] >= FALLEN_TO * mu[axle])
        if not here.any():
            return None
        sure, soon_m = drops[:, _EVIDENCE] == _CONFIRMED, ENTERING_S * view.speed_m_s
        row = _foremost(place, here, sure, soon_m)
        distance = float(place[row])
        least = float(drops[row, _MU])
        if distance > 0.0:  # it may be followed at once by a worse one
            near = here & sure & (place > 0.0) & (place <= max(distance, soon_m))
            least = float(np.min(drops[:, _MU], where=near, initial=math.inf))
        return RailAhead(
            state="OnIt" if distance <= 0.0 else "Entering" if distance <= soon_m else "Ahead",
            evidence=_EVIDENCES[float(drops[row, _EVIDENCE])],
            seen_by=self._numbers[int(by[row])],
            mu_pct=least if sure[row] else None,
            distance_m=max(distance, 0.0),
            age_ms=min(1e-3 * (now - float(drops[row, _SEEN_US])), AGE_LIMIT_MS),
        )


def _foremost(place: FloatArray, here: BoolArray, sure: BoolArray, soon_m: float) -> int:
    """Which drop is reported. One that lies ahead goes before one that is reached. The nearest, but a confirmed one
    before a suspected one, where that is not the only one of both within reach soon."""
    ahead = here & (place > 0.0)
    if not ahead.any():
        return int(np.where(here, place, -np.inf).argmax())
    nearest = int(np.where(ahead, place, np.inf).argmin())
    confirmed = int(np.where(ahead & sure, place, np.inf).argmin())
    if (ahead & sure).any() and (place[nearest] > soon_m or place[confirmed] <= soon_m):
        return confirmed
    return nearest


def _estimates(reports: Sequence[Report], estimate: Estimate | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of each axle (n,), NaN where it is not Valid: its adhesion, the most that it may be where torque enough is in use
    to tell by (both in %), and how far back that goes (s)."""
    n = len(reports)
    valid = np.array([r.validity is Validity.VALID for r in reports])
    if estimate is None or not valid.any():
        nothing = np.full(n, np.nan)
        return nothing, nothing, nothing
    mu, past_s = (np.where(valid, x, np.nan) for x in (estimate.mu_available_pct, estimate.past_s))
    most = np.where(estimate.used_pct >= MIN_USED_PCT, mu + estimate.half_width_pp, np.nan)
    return mu, most, past_s
