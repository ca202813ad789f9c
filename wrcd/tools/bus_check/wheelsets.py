"""Whether the wheelsets are like the one that the design is for: by all that a log or a bus gives, not tick by tick."""

import math
from collections.abc import Sequence

import numpy as np

from wrcd.bus.codec import Sample
from wrcd.core.configuration import Config
from wrcd.estimator.bank import BoolArray
from wrcd.estimator.likeness import likeness
from wrcd.estimator.records import Estimate, StepResult, Ticks

MIN_S = 30.0  # of measurements: over a stop, saturated for most of it, some sound trains seem unlike their design's
MAX_LOG = 300.0  # of a likelihood: more is no number


class Wheelsets:
    """Shows a core's measurements to a Likeness: an observer of the core."""

    def __init__(self, config: Config) -> None:
        axles = len(config.axles)
        self._noise_rms = np.array(config.design.noise_rms)[:, None]
        self._likeness = likeness(config.design, axles)  # None where the design says too little
        self._tick_s = config.design.tick_s
        self._seconds = 0.0  # in which an axle had data
        self._saturated: BoolArray = np.zeros(axles, dtype=bool)

    def accepted(self, samples: Sequence[Sample], stamp_us: int) -> None:
        """The ticks have them."""

    def stepped(self, ticks: Ticks, first: int, result: StepResult) -> None:
        """Measurements that the bank has used, far from pulses of the axle box."""
        used = np.logical_and.reduce(result.accepted & ~result.near_pulse)
        self._seconds += self._tick_s * len(result) * bool(used.any())
        if self._likeness is not None:
            end = first + len(result)
            x = np.where(used, ticks.z[first:end] / self._noise_rms, 0.0)
            mask = None if used.all() else used
            self._likeness.add(x, mask, ticks.speeds_m_s[first:end], self._saturated)

    def was_reset(self, axle: int) -> None:
        """Its window does not go on."""
        self._saturated[axle] = False
        if self._likeness is not None:
            self._likeness.reset(axle)

    def estimated(self, tick: int, estimate: Estimate) -> None:
        """Which axles are saturated."""
        self._saturated = estimate.saturated

    @property
    def finding(self) -> str | None:
        """What the signals say against the design's wheelset; None: nothing, or there is too little of them."""
        if self._likeness is None or not self._likeness.unlike or self._seconds < MIN_S:
            return None
        k, m, margin = self._likeness.figures
        times = math.exp(min(0.5 * margin, MAX_LOG))
        return (
            f"the signals of {self._seconds:.0f} s fit a wheelset with {k:.2f} times the design's yaw stiffness over "
            f"yaw inertia (k_w/I_w) and {m:.2f} times its load over mass (M_v/m_w) {times:.1g} times better than one "
            "near the design's"
        )
