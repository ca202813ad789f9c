"""Parts of the estimator in C, each by itself, as its own files call it (wrcd/core/c/parts.h)."""

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np

from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.stepped import SteppedEstimator
from wrcd.core.design import BoolArray, Design, FloatArray, load_design
from wrcd.core.terms import BLOCK_TICKS, CHANNELS, COLUMNS, MODELS
from wrcd.native import library

W = MODELS * CHANNELS
SUMS, IN_BANDS = 118, 58
N, HEARD, LIVE, RATIO, RATIO_N = 0, 1, 2, 41, 42
_double, _bool, _int, _long, _pointer = ctypes.c_double, ctypes.c_bool, ctypes.c_int, ctypes.c_int64, ctypes.c_void_p


def _at(array: np.ndarray[Any, Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _given(values: Any) -> FloatArray:
    return np.ascontiguousarray(values, np.float64)


def _c(name: str, result: Any, *arguments: Any) -> Any:
    return ctypes.CFUNCTYPE(result, *arguments)((name, library()))


class Part:
    """The state of an estimator of so many axles, of which a part is used."""

    def __init__(self, axles: int, design: Design | None = None) -> None:
        self.estimator = SteppedEstimator(load_design(LONE_DESIGN) if design is None else design, axles)
        self.e, self.d, _ = map(ctypes.c_void_p, self.estimator.addresses)
        self.state, self.axles = self.estimator._axle, axles

    def of(self, axle: int) -> ctypes.c_void_p:
        """An axle's state in C."""
        return ctypes.c_void_p(self.state[axle : axle + 1].ctypes.data)

    def reset(self, axle: int) -> None:
        self.estimator.reset(axle)


class WindowTick(ctypes.Structure):
    _fields_ = [("running", _bool), ("heard", _bool), ("live", _bool), ("calm", _bool), ("ratio", _double)]


class Statistics(ctypes.Structure):
    """window_statistics"""

    _fields_ = [
        ("_mean_square", _double * MODELS), ("_lag", _double * W), ("_cross", _double * MODELS), ("ratio", _double),
        ("ticks", _double), ("heard_share", _double), ("live_share", _double),
    ]  # fmt: skip

    @property
    def mean_square(self) -> FloatArray:
        return np.array(self._mean_square)

    @property
    def lag(self) -> FloatArray:
        return np.array(self._lag).reshape(MODELS, CHANNELS)

    @property
    def cross(self) -> FloatArray:
        return np.array(self._cross)


def statistics(sums: FloatArray, min_ticks: float) -> Statistics:
    out = Statistics()
    _c("wrcd_window_statistics_of", None, _pointer, _double, _pointer)(_at(_given(sums)), min_ticks, ctypes.byref(out))
    return out


def decades(newer: FloatArray, rest: FloatArray, min_ticks: float) -> FloatArray:
    out = np.empty(MODELS)
    of = _c("wrcd_window_decades", None, _pointer, _pointer, _double, _pointer)
    of(_at(_given(newer)), _at(_given(rest)), min_ticks, _at(out))
    return out


class Window(Part):
    """Running sums of so many blocks."""

    def __init__(self, blocks: int, axles: int) -> None:
        design = load_design(LONE_DESIGN)
        super().__init__(axles, replace(design, longest_s=blocks * BLOCK_TICKS * design.tick_s))

    def put(self, tick: int, w: Any, raw: Any, running: Any, heard: Any, live: Any, calm: Any, ratio: Any) -> None:
        """Innovations (4, 2, n), masks and torque ratios (n,)."""
        _c("wrcd_window_move", None, _pointer, _pointer, _long)(self.e, self.d, tick // BLOCK_TICKS)
        put = _c("wrcd_window_put", None, _pointer, _pointer, _int, _long, _pointer, _pointer, WindowTick)
        for a in range(self.axles):
            is_ = WindowTick(running[a], heard[a], live[a], calm[a], ratio[a])
            put(self.e, self.d, a, tick, _at(_given(w[..., a])), _at(_given(raw[..., a])), is_)

    def sums(self, first: int, end: int, axle: int = 0, past_change: bool = False) -> FloatArray:
        out = np.empty(SUMS)
        sums = _c("wrcd_window_sums", None, _pointer, _pointer, _int, _int, _int, _bool, _pointer)
        sums(self.e, self.d, axle, first, end, past_change, _at(out))
        return out

    def filled(self) -> list[int]:
        filled = _c("wrcd_window_filled", _int, _pointer, _pointer, _int)
        return [filled(self.e, self.d, axle) for axle in range(self.axles)]

    def truncate(self, blocks: int, axle: int = 0) -> None:
        _c("wrcd_window_truncate", None, _pointer, _int, _int)(self.e, axle, blocks)

    def torque_range(self, blocks: int, axle: int = 0) -> tuple[float, float]:
        out = np.empty(2)
        _c("wrcd_window_torque_range", None, _pointer, _pointer, _int, _int, _pointer)(
            self.e, self.d, axle, blocks, _at(out)
        )
        return float(out[0]), float(out[1])


class Gate(Part):
    def outliers(self, e: Any, yaw_rate: Any, there: Any) -> BoolArray:
        out = np.zeros((self.axles, CHANNELS), dtype=np.bool_)
        of = _c("wrcd_gate_outliers", None, _pointer, _pointer, _double, _bool, _pointer)
        for a in range(self.axles):
            of(self.of(a), _at(_given(e[..., a])), float(yaw_rate[a]), bool(there[a]), _at(out[a]))
        return out.T

    def learn(self, e: Any, yaw_rate: Any, used: Any, outliers: BoolArray) -> BoolArray:
        of = _c("wrcd_gate_learn", _bool, _pointer, _pointer, _double, _bool, _pointer)
        masks = np.ascontiguousarray(outliers.T)
        found = [
            of(self.of(a), _at(_given(e[..., a])), float(yaw_rate[a]), bool(used[a]), _at(masks[a]))
            for a in range(self.axles)
        ]
        return np.array(found)


class Joints(Part):
    def step(self, lat_accel: Any, present: Any) -> tuple[BoolArray, BoolArray]:
        """Where it is a pulse, and where it is one or just after."""
        near, pulse = np.zeros((2, self.axles), dtype=np.bool_)
        of = _c("wrcd_joints_step", _bool, _pointer, _pointer, _double, _bool, _pointer)
        for a in range(self.axles):
            pulse[a] = of(self.of(a), self.d, float(lat_accel[a]), bool(present[a]), _at(near[a:]))
        return pulse, near

    @property
    def recovering(self) -> list[bool]:
        return [_c("wrcd_joints_recovering", _bool, _pointer)(self.of(a)) for a in range(self.axles)]


class NoiseLevel(Part):
    def step(self, z: FloatArray, used: Any) -> None:
        of = _c("wrcd_noise_step", None, _pointer, _pointer, _pointer, _bool)
        for a in range(self.axles):
            of(self.of(a), self.d, _at(_given(z[:, a])), bool(used[a]))

    @property
    def factor(self) -> FloatArray:
        """(2, n): rms of what is fast in each channel over the design's sensor noise."""
        return np.asarray(np.sqrt(self.state["noise_power"].T))

    def sensor_factor(self) -> FloatArray:
        out = np.empty((self.axles, CHANNELS))
        for a in range(self.axles):
            _c("wrcd_noise_sensor_factor", None, _pointer, _pointer)(self.of(a), _at(out[a]))
        return out.T


class Sections:
    """A recursive filter over channels."""

    def __init__(self, sos: FloatArray, channels: int) -> None:
        self._sos, self._x = _given(sos), np.zeros((2 * len(sos), channels))

    def step(self, u: FloatArray) -> FloatArray:
        out = np.array(u, np.float64)
        of = _c("wrcd_sections_step", None, _pointer, _int, _pointer, _int, _pointer)
        of(_at(self._sos), len(self._sos), _at(self._x), len(out), _at(out))
        return out


class Answer(ctypes.Structure):
    """rules_answer"""

    _fields_ = [(n, _double) for n in ("output", "firing", "rule_share", "spread")] + [("rule", _int)]


def infer(design: Design, inputs: FloatArray) -> list[Answer]:
    """What the rules say of inputs (n, COLUMNS)."""
    part, found = Part(1, design), []
    assert inputs.shape[1] == COLUMNS
    for row in inputs:
        answer = Answer()
        _c("wrcd_rules_infer", None, _pointer, _pointer, _pointer)(part.d, _at(_given(row)), ctypes.byref(answer))
        found.append(answer)
    return found


class Word(ctypes.Structure):
    _fields_ = [("log_pct", _double), ("sigma", _double)]


def spoken(precision: float, weighed: float, own: Word, whole: bool) -> tuple[Word, float]:
    share = np.empty(1)
    said = _c("wrcd_memory_spoken", Word, _double, _double, Word, _bool, _pointer)(
        precision, weighed, own, whole, _at(share)
    )
    return said, float(share[0])


def fuse(
    memory: FloatArray, own: Word, whole: bool, newest: Word, live_share: float, in_use_pct: float, step_s: float,
    speed_m_s: float,
) -> FloatArray:  # fmt: skip
    """The memory a step later."""
    out = memory.copy()
    of = _c("wrcd_memory_fuse", _bool, _pointer, Word, _bool, Word, _double, _double, _double, _double)
    of(_at(out), own, whole, newest, live_share, in_use_pct, step_s, speed_m_s)
    return out


class Pairs(Part):
    """What pairs of sensors say. total (axles, IN_BANDS): all that came into the axles' rows, in the order of parts.h:
    ticks, fine [2], plain [2][2], own power [3][2], cross [3], apart [2][3], the partner's power [3][2], across
    [2][4][3], now [2][3]."""

    def __init__(self, axles: int, design: Design | None = None) -> None:
        super().__init__(axles, design)
        self.total, self._tick = np.zeros((axles, IN_BANDS)), 0

    def step(self, z: FloatArray, used: Any) -> None:
        _c("wrcd_window_move", None, _pointer, _pointer, _long)(self.e, self.d, self._tick // BLOCK_TICKS)
        before = self._rows()
        of = _c("wrcd_bands_step", None, _pointer, _pointer, _int, _pointer, _bool)
        for a in range(self.axles):
            of(self.e, self.d, a, _at(_given(z[:, a])), bool(used[a]))
        _c("wrcd_bands_end_of_tick", None, _pointer, _pointer)(self.e, self.d)
        self.total += self._rows() - before
        self._tick += 1

    def _rows(self) -> FloatArray:
        newest = _c("wrcd_window_newest", ctypes.POINTER(_double), _pointer, _pointer, _int)
        rows = [np.ctypeslib.as_array(newest(self.e, self.d, a), (SUMS,)) for a in range(self.axles)]
        return np.array(rows)[:, SUMS - IN_BANDS :]

    def look(self, speed_m_s: float, ratio: FloatArray, inputs: FloatArray) -> None:
        self.estimator._train["speed_m_s"] = speed_m_s
        of = _c("wrcd_health_look", None, _pointer, _pointer, _pointer, _pointer)
        of(self.e, self.d, _at(_given(inputs)), _at(_given(ratio)))
