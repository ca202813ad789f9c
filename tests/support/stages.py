"""Stages of the core in C from a value to a tick, on a train of its own that has a few inputs, or on one that a core
made."""

import ctypes
import math
from functools import cache
from typing import Any

import numpy as np

from wrcd.bus.reasons import Reason
from wrcd.core.counts import REASONS
from wrcd.core.layouts import layouts
from wrcd.core.reading import Checker
from wrcd.core.state import Train
from wrcd.core.tables import DIRECTION, LAT, LOAD, QUANTITIES, RADIUS, SPEED, TORQUE, YAW, Tables
from wrcd.native import library

NEVER = -(1 << 60)
CHANNELS, MAX_AXLES = LAT + 1, 8
_LABELS = ("None", *(r.label for r in Reason))


class _Value(ctypes.Structure):
    _fields_ = [
        ("value", ctypes.c_double), ("input", ctypes.c_int32), ("is_degraded", ctypes.c_bool),
        ("is_contested", ctypes.c_bool),
    ]  # fmt: skip


class _TickInputs(ctypes.Structure):
    _fields_ = [
        ("z", ctypes.c_double * (CHANNELS * MAX_AXLES)), ("torque_ratio", ctypes.c_double * MAX_AXLES),
        ("speed_m_s", ctypes.c_double), ("present", ctypes.c_uint8 * (CHANNELS * MAX_AXLES)),
        ("stale", ctypes.c_int32), ("silent", ctypes.c_int32),
    ]  # fmt: skip


@cache
def stages() -> Any:
    """The library, with the stages that are called here declared."""
    c = library()
    pointer, number, long = ctypes.c_void_p, ctypes.c_int, ctypes.c_int64
    for name, result, *arguments in (
        ("wrcd_plausible", number, pointer, pointer, long), ("wrcd_accept", ctypes.c_bool, pointer, pointer, long),
        ("wrcd_is_unchanged", ctypes.c_bool, pointer, number, long), ("wrcd_inputs_begin", None, pointer),
        ("wrcd_reject", None, pointer, number, long, number), ("wrcd_inputs_reset", None, pointer),
        ("wrcd_inputs_close", None, pointer, long, pointer),
        ("wrcd_reached", number, pointer, number, number, long, pointer),
        ("wrcd_validity_update", None, pointer, number, number), ("wrcd_validity_reset", None, pointer, number),
        ("wrcd_e2e_suspect", ctypes.c_bool, pointer),
        ("wrcd_standing", None, pointer, number, number, pointer, pointer),
        ("wrcd_verdict", number, number, pointer, pointer),
        ("wrcd_pack", None, pointer, number, long, pointer, pointer),
        ("wrcd_tell_cause", None, pointer, pointer, number, number, long),
        ("wrcd_tell_changes", None, pointer, pointer, pointer, pointer),
        ("wrcd_tell_outliers", None, pointer, pointer, number, ctypes.c_double, ctypes.c_double, long),
    ):  # fmt: skip
        function = getattr(c, name)
        function.restype, function.argtypes = result, arguments
    return c


def empty_tables() -> Tables:
    """Of a train without anything."""
    names = ("settings", "message", "input", "status", "condition", "sent", "told")
    tables: Tables = {name: np.zeros(1, dtype=layouts()[name]) for name in names}
    tables |= {"number": np.zeros(1, np.int64), "word": np.zeros(1, np.int64), "rule": np.zeros(1, np.int32)}
    return tables


class Inputs:
    """Takes values of a train's inputs, and closes its ticks."""

    def __init__(self, train: Train) -> None:
        self._c, self._at, self.state = stages(), train.pointer, train.state["input_state"]
        self.train = train

    def accept(self, number: int, value: float, stamp_us: int) -> bool:
        """A value has come. Whether it is clipped; NaN is."""
        return bool(self._c.wrcd_accept(self._at, ctypes.byref(_Value(value, number)), stamp_us))

    def reject(self, number: int, stamp_us: int, reason: Reason) -> None:
        """A frame of an input was refused."""
        self._c.wrcd_reject(self._at, number, stamp_us, REASONS.index(reason))

    def close(self, end_us: int) -> tuple[list[float], list[bool]]:
        """A tick is over: its measurements by channel and axle, and which there are."""
        tick, size = _TickInputs(), CHANNELS * len(self.train.state["axle"])
        self._c.wrcd_inputs_close(self._at, end_us, ctypes.byref(tick))
        return list(tick.z[:size]), [x != 0 for x in tick.present[:size]]

    def reached(self, quantity: int, axle: int, now_us: int) -> tuple[int, str]:
        """The register of a quantity, and the label of the newest rejection within it."""
        refused = ctypes.c_int()
        register = self._c.wrcd_reached(self._at, quantity, axle, now_us, ctypes.byref(refused))
        return register, _LABELS[refused.value]

    def plausible(self, number: int, value: float, stamp_us: int) -> Reason | None:
        """Why a value cannot be believed."""
        return REASONS[int(self._c.wrcd_plausible(self._at, ctypes.byref(_Value(value, number)), stamp_us))]

    def unchanged(self, number: int, now_us: int) -> bool:
        """Whether a sensor stands still."""
        return bool(self._c.wrcd_is_unchanged(self._at, number, now_us))

    def reset(self) -> None:
        """Nothing that came before counts."""
        self._c.wrcd_inputs_reset(self._at)


class OwnInputs(Inputs):
    """Of a train without messages: each a quantity of an axle. `of` is their table."""

    def __init__(self, *places: tuple[int, int], patience: int = 100) -> None:
        tables = empty_tables()
        self.of = tables["input"] = np.zeros(len(places), dtype=layouts()["input"])
        self.of["first_end"], self.of["last_end"], self.of["next"] = -math.inf, math.inf, -1
        self.settings = tables["settings"][0]
        input_of = np.full((len(QUANTITIES), MAX_AXLES), -1)
        for number, (quantity, axle) in enumerate(places):
            self.of["quantity"][number], self.of["axles"][number] = quantity, 1 << axle
            input_of[quantity, axle] = number
        self.settings["inputs"], self.settings["axles"] = len(places), 1 + max(axle for _, axle in places)
        self.settings["input_of"], self.settings["recent_ticks"] = input_of.ravel(), patience
        self.settings["min_speed_m_s"] = 1.0
        self.settings["start"][[LOAD, RADIUS, DIRECTION]] = 1.0
        super().__init__(Train(tables, (0, 0, 0)))
        self._c.wrcd_inputs_begin(self._at)


class StuckCheck:
    """Watches a sensor that must move. ends: the values from which on it is clipped."""

    def __init__(self, ends: tuple[float, float] = (-math.inf, math.inf)) -> None:
        self._own = OwnInputs((YAW, 0))
        self._own.of["first_end"], self._own.of["last_end"] = ends
        self._speed = self._own.settings["start"]

    def check(self, value: float, stamp_us: int, moving: bool) -> Reason | None:
        """STUCK for a value that has been the same for too long."""
        self._speed[SPEED] = 1.0 if moving else 0.999
        return self._own.plausible(0, value, stamp_us)

    def unchanged(self, now_us: int, timeout_us: int) -> bool:
        """Whether it has sent the same for longer than its time-out, and oftener than by chance, or is clipped."""
        self._own.of["timeout_us"] = timeout_us
        return self._own.unchanged(0, now_us)


class JumpCheck:
    """Watches a quantity that cannot jump."""

    def __init__(self, max_step: float, timeout_us: int) -> None:
        self._own = OwnInputs((TORQUE, 0))
        self._own.of["max_step"], self._own.of["timeout_us"] = max_step, timeout_us

    def check(self, value: float, stamp_us: int) -> Reason | None:
        """JUMP for a value too far from the one before."""
        return self._own.plausible(0, value, stamp_us)


class SuspectingChecker(Checker):
    """Tells whether a second sender is suspected."""

    @property
    def suspect(self) -> bool:
        """Whether one is."""
        return bool(stages().wrcd_e2e_suspect(self._train.state["message_state"].ctypes.data))
