"""The slides' oracle. What a slide shows of the rail, beside the estimate before it: of a train's axles, over hours.

An axle's estimate counts as one before a slide while nothing goes on and little of it is in use. Where the axle then is
saturated for a while with more in use than before, what lasted is what the rail bears. Slides of several axles within
some seconds tell one and the same. The bias of all that were told, the older the less, widens intervals where it is
beyond doubt.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wrcd.core.design import BoolArray, FloatArray
from wrcd.core.records import Estimate

MOST_USED = 0.85  # of an estimate: with more in use it is known without the rules
RISES = 1.2  # only so many times as much in use as before tells that it was asked for
MOST_SAID = 0.7  # by a slide: a rail that changes in these seconds says as much as a bias
ENDS = 0.9  # of what a slide shows: it ends as less is in use; else the estimate was late, and has found more
HOLDS_S, BEFORE_S, TOGETHER_S = 0.4, 6.0, 5.0
KEPT = 0.98  # of the weight of those before, at each
OWN_SIGMA, OWN_SLIDES = 0.15, 6.0  # slides of vehicles as trained scatter so (log adhesion), and count for so many
LEAST, SURE = 3.5, 3.0  # weight of the slides, and standard errors, from which on a bias counts
FULLY = 0.3  # the bias counts in full where so much less than MOST_USED is in use
STEADY = 0  # regime


@dataclass
class Axle:
    """The estimate before (percent), what was in use, and how long ago; how long it slides, and what that showed."""

    before_pct: float = 0.0
    used_pct: float = 0.0
    age_s: float = 0.0
    held_s: float = 0.0
    shown: list[float] = field(default_factory=list)


class Slides:
    """told: the logs of the estimate before over what was shown, the oldest first."""

    def __init__(self, axles: int) -> None:
        self.axles = [Axle() for _ in range(axles)]
        self.told: list[float] = []
        self._together: list[float] = []
        self._since_s = 0.0

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self.axles[axle] = Axle()

    def look(self, now: Estimate, sound: BoolArray, lasted: FloatArray, step_s: float) -> None:
        """A step later: what is estimated, whose pair of sensors is sound (n,), and the torque ratio that has lasted
        (n,)."""
        for k, a in enumerate(self.axles):
            mu, used = float(now.mu_available_pct[k]), float(now.used_pct[k])
            if not (sound[k] and math.isfinite(lasted[k])):
                self.reset(k)
                continue
            a.age_s += step_s if a.before_pct > 0.0 else 0.0
            if not mu > 0.0:
                continue
            if now.saturated[k]:
                a.held_s += step_s
                a.shown += [100.0 * float(lasted[k])] if a.held_s > HOLDS_S else []
                continue
            shown = max(a.shown, default=0.0)
            is_young, is_asked = a.age_s - a.held_s <= BEFORE_S, shown > RISES * a.used_pct
            if a.before_pct > 0.0 and is_young and is_asked and used < ENDS * shown:
                self._together.append(min(max(math.log(a.before_pct / shown), -MOST_SAID), MOST_SAID))
                a.before_pct = 0.0
            a.held_s, a.shown = 0.0, []
            is_steady = now.regime[k] == STEADY and now.doubt[k] == 0 and not now.contradicted[k]
            if is_steady and used < MOST_USED * mu:
                a.before_pct, a.used_pct, a.age_s = mu, used, 0.0
        self._since_s = self._since_s + step_s if self._together else 0.0
        if self._since_s >= TOGETHER_S:
            self.told.append(float(np.mean(self._together)))
            self._together, self._since_s = [], 0.0

    @property
    def bias(self) -> float:
        """Mean of the logs; 0 where it may be chance."""
        return bias_of(self.told)

    def wider_pp(self, now: Estimate) -> FloatArray:
        """(n,): by how much an estimate may be off (percentage points)."""
        if self.bias == 0.0:
            return np.zeros(len(self.axles))
        available = now.mu_available_pct * (math.exp(-self.bias) if self.bias < 0.0 else 1.0)
        share = np.clip((MOST_USED - now.used_pct / available) / FULLY, 0.0, 1.0)
        return np.asarray(abs(1.0 - math.exp(-self.bias)) * now.mu_available_pct * share)


def bias_of(told: Sequence[float]) -> float:
    """Of logs, the oldest first: their mean, 0 where it may be chance."""
    x, weight = np.array(told), KEPT ** np.arange(len(told))[::-1]
    n = float(weight.sum())
    if n < LEAST:
        return 0.0
    mean = float(np.average(x, weights=weight))
    variance = (float(weight @ (x - mean) ** 2) + OWN_SLIDES * OWN_SIGMA**2) / (n + OWN_SLIDES - 1.0)
    return mean if abs(mean) > SURE * math.sqrt(variance / n) else 0.0
