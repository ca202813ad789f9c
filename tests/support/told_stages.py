"""Stages of the core in C from a tick's cause to what is told: Validity, events, levels, bytes."""

import ctypes
import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from tests.support.sensor_simulator import SensorSimulator
from tests.support.stages import CHANNELS, MAX_AXLES, empty_tables, stages
from wrcd.bus.writers import SignalWriter
from wrcd.core.causes import Cause, Validity
from wrcd.core.core import Core
from wrcd.core.events import VALIDITIES
from wrcd.core.layouts import layouts
from wrcd.core.state import Train
from wrcd.core.tables import _filled, _told
from wrcd.core.vocabulary import CONFIDENCES, words_of

_CAUSES, _LEVELS = tuple(Cause), words_of("adhesion", "Confidence")
_NOT_AVAILABLE, _VALID, _DEGRADED = range(len(VALIDITIES))


class Monitor:
    """Counts the sound ticks of an axle, and says what follows."""

    def __init__(self, window_ticks: int) -> None:
        self._c, self._window = stages(), window_ticks
        self._axle = np.zeros(1, dtype=layouts()["axle"])

    def update(self, cause: Cause) -> None:
        """A tick, and what speaks against it."""
        self._c.wrcd_validity_update(self._axle.ctypes.data, self._window, int(cause))

    def reset(self, why: Cause) -> None:
        """What was known does not hold any more."""
        self._c.wrcd_validity_reset(self._axle.ctypes.data, int(why))

    def verdict(self, pair: int, estimate: Any) -> tuple[Validity, Cause]:
        """With the state of the pair of sensors, and the record of an estimate."""
        has_estimate, cause = ctypes.c_int(), ctypes.c_int()
        self._c.wrcd_standing(
            self._axle.ctypes.data, self._window, int(pair), ctypes.byref(has_estimate), ctypes.byref(cause)
        )
        record = np.array(estimate)
        at = record.ctypes.data if has_estimate.value else None
        validity = self._c.wrcd_verdict(cause.value, at, ctypes.byref(cause))
        return VALIDITIES[validity], _CAUSES[cause.value]


def packed(writers: Sequence[SignalWriter], start: bytes, values: Sequence[float | None]) -> bytes:
    """A message that was `start` before some numbers were put in, as the core sends it."""
    tables, told = empty_tables(), np.array([math.nan if x is None else x for x in values] + [math.nan] * 64)
    tables["told"] = _filled("told", [{**_told("inputs", "Outlier", w), "what": k} for k, w in enumerate(writers)])
    tables["sent"]["length"], tables["sent"]["told"] = len(start), len(writers)
    tables["sent"]["start"][0][: len(start)] = list(start)
    train, data = Train(tables, (0, 0, 0)), ctypes.create_string_buffer(8)
    stages().wrcd_pack(train.pointer, 0, 0, told.ctypes.data, data)
    return data.raw[: len(start)]


def beginning(core: Core, cause: Cause, end_us: int) -> Any:
    """What the core tells of axle 1 as a cause begins that speaks against a tick."""
    stages().wrcd_tell_cause(core._train.pointer, core._buffers.pointer, 0, int(cause), end_us)
    return core._buffers.take()["event"][0]


def change_to(core: Core, cause: Cause, estimate: Mapping[str, Any] | None) -> Any:
    """What the core tells as axle 1 goes from Valid to a cause: of its estimate, whose members are given, or None: of
    its standing."""
    reports, axle = np.zeros(len(core.config.axles), dtype=layouts()["report"]), core._train.state["axle"]
    axle["cause"], axle["validity"], axle["standing"] = 0, 0, 0
    axle["validity"][0], axle["standing"][0] = _VALID, 0 if estimate is not None else int(cause)
    reports["cause"][0], reports["validity"][0] = int(cause), _NOT_AVAILABLE if estimate is None else _DEGRADED
    for name, value in (estimate or {}).items():
        reports["estimate"][name][0] = value
    changed = np.zeros(len(reports), dtype=np.bool_)
    changed[0] = estimate is None
    at = (core._train.pointer, core._buffers.pointer, reports.ctypes.data, changed.ctypes.data)
    stages().wrcd_tell_changes(*at)
    (event,) = core._buffers.take()["event"]
    return event


def restarted(core: Core, times: Sequence[float], yaw_jump: float, wait_s: float) -> Any:
    """What the core tells as axle 1 is started anew for outliers. times: by how often its usual size each channel's
    innovation is off; yaw_jump: from the newest that was used (rad/s), NaN: none was."""
    found, result = core.estimator._axle[0], core.estimator._result[0]
    found["gate_power"] = 4.0
    innovations = result["innovations"].reshape(-1, CHANNELS, MAX_AXLES)
    for channel, off in enumerate(times):
        innovations[:, channel, 0] = -2.0 * off * np.arange(1, 1 + len(innovations))
    found["gate_last"], found["gate_age"] = 0.1, math.inf if math.isnan(yaw_jump) else 1.0
    yaw_rate = 0.1 if math.isnan(yaw_jump) else 0.1 - yaw_jump
    stages().wrcd_tell_outliers(core._train.pointer, core._buffers.pointer, 0, yaw_rate, wait_s, 0)
    return core._buffers.take()["event"][0]


def level_of(sim: SensorSimulator, half_width_pp: float | None, before: str | None = None) -> str:
    """The Confidence that the next slot tells of axle 1 if its estimate has this half-width (None: if it is not Valid).
    before: what the slot before has told, if it is to be another.

    The estimate is as it is: the levels are made so much wider that it lies among them as the half-width among their
    own.
    """
    if before is not None:
        sim.core._train.state["axle"]["confidence"][0] = _LEVELS.index(before)
    if half_width_pp is None:
        return str(sim.during(20, yaw_status=1)[-1]["Confidence"])
    twin = deepcopy(sim)
    twin.run(20)
    (why,) = (o.why for o in twin.out[len(sim.out) :] if o.why is not None)
    limits = sim.core._tables["settings"]["confidence_pp"][0]
    limits[: len(CONFIDENCES)] = [most * why["half_width_pp"] / half_width_pp for most, _ in CONFIDENCES]
    (sent,) = sim.run(20)
    assert sent["Validity"] == "Valid"
    return str(sent["Confidence"])
