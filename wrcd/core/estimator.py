"""The estimator: a thin door to the C (wrcd/core/c), which steps and answers for all axles of a train."""

import ctypes
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from wrcd.core.design import Design, FloatArray, HealthModel, IntArray
from wrcd.core.design_members import IN_PLACE, Member, OverSpeed, health_members, members
from wrcd.core.layouts import layouts
from wrcd.core.records import Estimate, Ticks
from wrcd.core.terms import COLUMNS, MAX_AXLES, MODELS, PAIR_FEATURES, PairState
from wrcd.errors import InputError
from wrcd.native import library

_WHOLE, _FLAGS = ("rule", "winner", "doubt", "regime"), ("saturated", "contradicted")


class _SpeedTable(ctypes.Structure):
    _fields_ = [
        ("speeds", ctypes.c_int), ("width", ctypes.c_int), ("speed_m_s", ctypes.c_void_p), ("row", ctypes.c_void_p)
    ]  # fmt: skip


class Estimator:
    """Steps the bank and answers. Never fails on data: what is unknown comes out as NaN. Raises InputError for a design
    or axles beyond its limits, and where the library is missing.

    Every few ticks the newest part of the window is compared with the rest; where the rail or the torque has changed,
    the rest is dropped, so that the estimate follows in a fraction of the window and says so by a wider interval. While
    nothing changes the words on it are fused.
    """

    def __init__(self, design: Design, axles: int) -> None:
        self.design, self.axles, self.library = design, axles, (c := library())
        self._keeps: list[object] = []  # what C has addresses of
        table = _structure(members(design), self._keeps)
        self._keeps.append(table)
        self._d = ctypes.byref(table)
        size = int(c.wrcd_size(self._d, axles))
        if not size:
            raise InputError(
                f"is beyond the estimator's limits with {axles} axles, at most {MAX_AXLES}", file=design.name
            )
        train = layouts()["estimator"]
        self._memory = np.zeros(size // 8)
        self._train = self._memory[: train.itemsize // 8].view(train)[0]
        self._axle = self._train["axle"][:axles]
        self._result = np.zeros(1, dtype=layouts()["result"])
        self._e = _address(self._memory)
        self.addresses = self._memory.ctypes.data, ctypes.addressof(table), self._result.ctypes.data
        c.wrcd_begin(self._e, self._d, axles)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Estimator":
        twin = memo[id(self)] = type(self)(self.design, self.axles)
        twin._memory[:] = self._memory
        return twin

    def copy_from(self, other: "Estimator") -> None:
        """Become as another estimator of the same design and axles."""
        self._memory[:] = other._memory

    def run(self, ticks: Ticks, first: int, end: int, resets: bool) -> None:
        """Step ticks first … end - 1 of them; resets: whether axles are reset that need it."""
        part = ticks.part(first, end)
        z, present = np.ascontiguousarray(part.z, np.float64), np.ascontiguousarray(part.present)
        ratio, speeds = np.ascontiguousarray(part.torque_ratio, np.float64), np.asarray(part.speeds_m_s, np.float64)
        self.library.wrcd_run(
            self._e, self._d, part.number, len(part), _address(z), _address(present), _address(ratio),
            _address(speeds), resets,
        )  # fmt: skip

    def estimate(self) -> Estimate:
        """The adhesion that the window's residuals and torque speak for."""
        out = np.zeros(self.axles, dtype=layouts()["estimate"])
        self.library.wrcd_estimate(self._e, self._d, _address(out))
        kinds: dict[str, Any] = dict.fromkeys(_WHOLE, np.int64) | dict.fromkeys(_FLAGS, np.bool_)
        return Estimate(**{n: out[n].astype(kinds[n]) if n in kinds else out[n] for n in out.dtype.names})

    @property
    def slides(self) -> tuple[float, float, float, float]:
        """Of the train's slides, the older counting less: weight, sum and squares of the logs of the estimate before
        over what was shown; their mean, 0 where that may be chance."""
        weight, total, squares, bias = self._train["slides"][:4].tolist()
        return weight, total, squares, bias

    def take_slides(self, sums: Sequence[float]) -> None:
        """Go on from such a weight, sum and squares."""
        given = np.array(sums, np.float64)
        self.library.wrcd_slides_take(self._e, _address(given))

    def torque_now(self) -> FloatArray:
        """(n,): torque ratio of the moment; NaN where it is not known."""
        return self._told("wrcd_torque_now", self.axles)

    def inputs_of(self, blocks: IntArray, now: FloatArray) -> FloatArray:
        """What the rules are given (m, COLUMNS) of windows of so many blocks (m,): all axles with one length after all
        with another. now (n,): torque ratio of the moment."""
        m, lengths, torque = len(blocks), np.ascontiguousarray(blocks, np.int64), np.ascontiguousarray(now, np.float64)
        return self._told("wrcd_inputs_of", m, COLUMNS, given=(m, _address(lengths), _address(torque)))

    def steps(self) -> FloatArray:
        """Decades (n, 4) by which the newest part's residuals lie above those of the rest of the usual window."""
        return self._told("wrcd_steps", self.axles, MODELS)

    def features(self) -> FloatArray:
        """(n, PAIR_FEATURES) that pairs of sensors are judged by, after a look."""
        return self._told("wrcd_features", self.axles, PAIR_FEATURES)

    def _told(self, question: str, *shape: int, given: tuple[Any, ...] = ()) -> FloatArray:
        """What a function of the library writes into an array of this shape."""
        out = np.empty(shape)
        getattr(self.library, question)(self._e, self._d, *given, _address(out))
        return out


def evidence(model: HealthModel, x: FloatArray) -> FloatArray:
    """(n, states): log of how much likelier features x (n, PAIR_FEATURES) are in each state than of a sound pair."""
    keeps: list[object] = []
    table, rows = _structure(health_members(model), keeps), np.ascontiguousarray(x, np.float64)
    out = np.empty((len(rows), len(PairState)))
    library().wrcd_evidence(ctypes.byref(table), len(rows), _address(rows), _address(out))
    return out


class Runs(Protocol):
    """An estimator, or several."""

    def run(self, ticks: Ticks, first: int, end: int, resets: bool) -> None:
        """As Estimator.run()."""


def step_through(estimator: Runs, ticks: Ticks, stops: Iterable[int] = (), resets: bool = False) -> Iterator[int]:
    """Step any number of ticks; resets: whether axles are reset that need it. Yields after each of the stops, places
    among the ticks that grow."""
    first = 0
    for stop in (*stops, len(ticks) - 1):
        estimator.run(ticks, first, stop + 1, resets)
        first = stop + 1
        yield stop


def _address(array: np.ndarray[Any, Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _structure(of: Mapping[str, Member], keeps: list[object]) -> Any:
    """Members as C has them; `keeps` holds what there are only addresses of."""
    kinds: list[tuple[str, Any]] = []
    values: list[Any] = []
    for name, value in of.items():
        kind, member = _member(name, value, keeps)
        kinds.append((name, kind))
        values.append(member)
    made: ctypes.Structure = type("Members", (ctypes.Structure,), {"_fields_": kinds})(*values)
    return made


def _member(name: str, value: Member, keeps: list[object]) -> tuple[Any, Any]:
    def pointed(array: np.ndarray[Any, Any]) -> int:
        flat = np.ascontiguousarray(array, np.int32 if array.dtype == np.int32 else np.float64)
        keeps.append(flat)
        return int(flat.ctypes.data)

    if isinstance(value, OverSpeed):
        v, rows = value
        return _SpeedTable, _SpeedTable(len(v), rows.shape[1], pointed(v), pointed(rows))
    if isinstance(value, tuple):
        return ctypes.c_void_p * len(value), (ctypes.c_void_p * len(value))(*map(pointed, value))
    if isinstance(value, np.ndarray):
        if name in IN_PLACE:
            kind: Any = (ctypes.c_int if value.dtype == np.int32 else ctypes.c_double) * len(value)
            return kind, kind(*value.tolist())
        return ctypes.c_void_p, pointed(value)
    if isinstance(value, Mapping):
        inner = _structure(value, keeps)
        keeps.append(inner)
        return ctypes.c_void_p, ctypes.addressof(inner)
    if value is None:
        return (_SpeedTable, _SpeedTable()) if name == "widening" else (ctypes.c_void_p, None)
    return (ctypes.c_int if isinstance(value, int) else ctypes.c_double), value
