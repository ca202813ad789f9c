"""The estimator a tick at a time, and what a step brings: the core runs it in C, and who makes designs many ticks at
once."""

import ctypes
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wrcd.core.design import BoolArray, Design, FloatArray, IntArray
from wrcd.core.estimator import Estimator
from wrcd.core.layouts import layouts
from wrcd.core.records import Ticks
from wrcd.core.terms import CHANNELS, MODELS, PairState


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick of n axles. What is not present, or unknown, is NaN or anything."""

    number: int
    z: FloatArray  # (2, n) yaw rate in rad/s, lateral acceleration in m/s2
    present: BoolArray  # (2, n)
    torque_ratio: FloatArray  # (n,) |torque| / (2 N r0)
    speed_m_s: float


def tick_of(ticks: Ticks, k: int) -> Tick:
    """The k-th of some."""
    return Tick(ticks.number + k, ticks.z[k], ticks.present[k], ticks.torque_ratio[k], ticks.speeds_m_s[k])


class StepResult:
    """What the newest tick brought; masks are (n,). Read it before the next one."""

    innovations: FloatArray  # (4, 2, n)
    whitened: FloatArray  # the same in units of their expected size
    accepted: BoolArray  # both measurements were used
    outliers: BoolArray  # a measurement was left out by the gate
    near_pulse: BoolArray  # at a pulse of the axle box, or just after it
    live: BoolArray  # the window was given the innovation of some ticks before, when no pulse could follow any more
    calm: BoolArray  # and that one is far from any pulse
    needs_reset: BoolArray  # outliers go on, or a filter is not finite
    notable: bool = False  # whether anything was left out, or needs a reset

    def __init__(self, memory: Any, axles: int) -> None:
        self._memory, self._n = memory, axles

    def __getattr__(self, name: str) -> Any:
        found = self._memory[name]
        if name in ("innovations", "whitened"):
            return found.reshape(MODELS, CHANNELS, -1)[..., : self._n].copy()
        return found[: self._n] > 0


class Outliers(NamedTuple):
    """What an axle is reset for: by how often its usual size each channel's innovation is off, of the model that it
    fits best, with the limits; and by how much the yaw rate differs from the newest that was used."""

    times_usual: list[float]
    limits: list[float]
    jump_rad_s: float


class HealthFigures(NamedTuple):
    """What leads beside a sound pair, with its probability, and what that was found by."""

    state: int
    probability: float
    sound: float
    low: float  # correlation below 1.5 Hz
    middle: float  # and in 3 to 10 Hz
    yaw_rms: float  # of each signal's alternating part, in units of the design's sensor noise
    lat_rms: float


class _Tick(ctypes.Structure):
    _fields_ = [
        ("number", ctypes.c_int64), ("speed_m_s", ctypes.c_double), ("z", ctypes.c_void_p),
        ("present", ctypes.c_void_p), ("torque_ratio", ctypes.c_void_p),
    ]  # fmt: skip


def _address(array: "np.ndarray[Any, Any]") -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class SteppedEstimator(Estimator):
    def __init__(self, design: Design, axles: int) -> None:
        super().__init__(design, axles)
        self._z, self._present = np.zeros((CHANNELS, axles)), np.zeros((CHANNELS, axles), dtype=bool)
        self._ratio = np.zeros(axles)
        self._tick = _Tick(0, 0.0, *(_address(a) for a in (self._z, self._present, self._ratio)))
        self._of_tick = np.zeros(1, dtype=layouts()["result"])
        self.newest = StepResult(self._of_tick[0], axles)

    @property
    def state(self) -> bytes:
        """All that it goes on from."""
        return self._memory.tobytes()

    @property
    def outliers(self) -> int:
        """Samples left out so far."""
        return int(self._train["outliers"])

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self.library.wrcd_reset(self._e, self._d, int(axle))

    @property
    def started(self) -> BoolArray:
        """(n,): whether a measurement was used since the last reset."""
        return np.asarray(self._axle["started"] > 0.0)

    def step(self, tick: Tick) -> StepResult:
        """One tick; call reset() for the axles that need it before the next. The result holds until then."""
        self._tick.number, self._tick.speed_m_s = tick.number, tick.speed_m_s
        self._z[:], self._present[:], self._ratio[:] = tick.z, tick.present, tick.torque_ratio
        says = self.library.wrcd_step(self._e, self._d, ctypes.byref(self._tick), _address(self._of_tick))
        self.newest.notable = says != 0
        return self.newest

    def why_reset(self, result: StepResult, yaw_rate: FloatArray, axle: int) -> Outliers:
        """Of an axle that needs it, after the step (n yaw rates) that showed it and before its reset."""
        e, why = np.ascontiguousarray(result.innovations[:, :, axle]), np.empty(2 * CHANNELS + 1)
        self.library.wrcd_gate_why(self._e, axle, _address(e), float(yaw_rate[axle]), _address(why))
        return Outliers(why[:CHANNELS].tolist(), why[CHANNELS:-1].tolist(), float(why[-1]))


def pair_states(e: Estimator) -> IntArray:
    """(n,): the PairState that leads where a pair is not more likely sound than not."""
    return np.array([e.library.wrcd_pair_state(e._e, axle) for axle in range(e.axles)])


def log_odds(e: Estimator) -> FloatArray:
    """(n, states): over a sound pair's."""
    return np.array(e._axle["log_odds"])


def health_figures(e: Estimator, axle: int) -> HealthFigures:
    """What an axle's state was found by."""
    p, figures = np.empty(len(PairState)), np.empty(5)
    e.library.wrcd_health_figures(e._e, axle, _address(p), _address(figures))
    lead, *rest = figures.tolist()
    return HealthFigures(int(lead), float(p[int(lead)]), float(p[PairState.SOUND]), *rest)
