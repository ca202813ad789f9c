"""Release of one axle at a time, so that the reference speed meets the train's again.

A wheel that is held at a small creep for long looks like a wheel that rolls, and a reference that goes on by a bound
drifts to it. So an axle is released when none has given the train's speed for some time: it comes back, and tells.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Constants:
    """When an axle is released, and how far."""

    after_s: float = 2.0  # without any axle that proved the reference
    share: float = 0.6  # of its torque: what it keeps,
    # The same where an adhesion limit alone holds the torque: the wheel creeps little, and rolls with more left. Found
    # on training seeds: with 0.8 a wheel that a false high lets slide comes back too late (errors up to 1.0 m/s).
    limited_share: float = 0.7
    min_s: float = 0.1  # of a release
    max_s: float = 0.4
    back_m_s2: float = 1.0  # a wheel that comes back faster than this has not arrived


class Resync:
    """The releases of a train's axles, in turn."""

    def __init__(self, axles: int, constants: Constants | None = None) -> None:
        self._c = constants or Constants()
        self._turn = 0
        self._axles = axles
        self._proved_us = 0
        self._began_us: int | None = None
        self._torque_N_m = 0.0
        self._was_sliding = [False] * axles
        self.releases = 0

    def skip(self, k: int) -> None:
        """Pass the turn on: axle k has no wheel speed that could tell."""
        if k == self._turn:
            self._began_us, self._turn = None, (k + 1) % self._axles

    def step(
        self, k: int, now_us: int, torque_N_m: float, asked_N_m: float, sliding: bool, slide_m_s2: float, limited: bool
    ) -> float:
        """The torque of axle k in this cycle, from what its law gives.

        asked_N_m: what the driver asks. limited: a limit below that is all that holds the torque; a wheel that carries
        what a limit leaves it has proved nothing: it may slide at that.
        """
        c = self._c
        if torque_N_m >= asked_N_m or (self._was_sliding[k] and not sliding):
            self._proved_us = now_us  # it carries all that is asked, or has just come back from a slide
        self._was_sliding[k] = sliding
        if k != self._turn:
            return torque_N_m
        if self._began_us is None:
            if now_us - self._proved_us < c.after_s * 1e6:
                return torque_N_m
            self._began_us, self._torque_N_m = now_us, torque_N_m * (c.limited_share if limited else c.share)
            self.releases += 1
        lasts_s = (now_us - self._began_us) * 1e-6
        if lasts_s >= c.max_s or (lasts_s >= c.min_s and -slide_m_s2 < c.back_m_s2):
            self._began_us, self._proved_us = None, now_us
            self._turn = (k + 1) % self._axles
        return min(torque_N_m, self._torque_N_m)
