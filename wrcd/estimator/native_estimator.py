"""The estimator in C (wrcd/estimator/c), under the reference's interface, and its state as the reference's."""

import ctypes
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, cast

import numpy as np

from wrcd.estimator.design import CHANNELS, COLUMNS, MODELS, Design, FloatArray, IntArray
from wrcd.estimator.design_members import IN_PLACE, Member, OverSpeed, members
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.paper.window import COLUMNS as SUMS
from wrcd.estimator.records import Estimate, StepResult, Tick, Ticks
from wrcd.estimator.signals.gate import Gate, Outliers
from wrcd.estimator.trust.health import FEATURES, HealthFigures
from wrcd.estimator.trust.pair import BANDS

# Where in a reference estimator what the C state names lies. Its arrays have the axles last.
_OF_AXLE = {
    "bank_x": "_bank.x", "offset_mean": "_offset._mean", "offset_count": "_offset._count",
    "gate_power": "_gate._power", "gate_peak": "_gate._peak", "gate_count": "_gate._count",
    "gate_net_outliers": "_gate._net_outliers", "gate_last": "_gate._last", "gate_age": "_gate._age",
    "joints_highpass": "_joints._highpass._x", "joints_power": "_joints._power", "joints_ticks": "_joints._ticks",
    "joints_left": "_joints._left", "joints_length": "_joints._length", "joints_since": "_joints._since",
    "joints_first": "_joints._first", "joints_newest": "_joints._newest", "noise_past": "_noise._past",
    "noise_run": "_noise._run", "noise_power": "_noise._power", "noise_count": "_noise._count",
    "lowpass": "_lowpass._x", "complete": "_complete", "started": "started", "delayed": "_delayed",
    "delayed_live": "_delayed_live", "delayed_clear": "_delayed_clear", "window_since": "_window._since",
    "window_first": "_window._first", "window_last": "_window._last", "window_past": "_window._past",
    "memory": "_memory", "pair_filter": "health.pairs._filters._state", "pair_mean": "health.pairs._mean",
    "pair_offset_ticks": "health.pairs._offset_ticks", "pair_plain": "health.pairs._plain",
    "pair_ticks": "health.pairs._ticks", "pair_goes_on": "health.pairs._goes_on", "health_rows": "health._rows",
    "health_held": "health._held",
}  # fmt: skip
_OF_TRAIN = {
    "speed": "_speed._speed", "speed_rate": "_speed._rate", "speed_ticks": "_speed._ticks", "speed_m_s": "_speed_m_s",
    "window_newest": "_window._newest", "pair_at": "health.pairs._at", "pair_later": "health.pairs._later",
    "outliers": "outliers",
}  # fmt: skip
# What is longer in C than a design needs, by what of it: states, sections.
_PADDED = {"bank_x": (MODELS, -1), "lowpass": (-1, MODELS * CHANNELS), "joints_highpass": (-1, 1)}
_WHOLE, _FLAGS = ("rule", "winner", "doubt", "regime"), ("saturated", "contradicted")


class _Tick(ctypes.Structure):
    _fields_ = [
        ("number", ctypes.c_int64), ("speed_m_s", ctypes.c_double), ("z", ctypes.c_void_p),
        ("present", ctypes.c_void_p), ("torque_ratio", ctypes.c_void_p),
    ]  # fmt: skip


class _SpeedTable(ctypes.Structure):
    _fields_ = [
        ("speeds", ctypes.c_int), ("width", ctypes.c_int), ("speed_m_s", ctypes.c_void_p), ("row", ctypes.c_void_p)
    ]  # fmt: skip


class CompiledResult:
    """What the newest tick brought, as StepResult has it: read it before the next one."""

    def __init__(self, memory: Any, axles: int) -> None:
        self._memory, self._n, self.notable = memory, axles, False

    def __getattr__(self, name: str) -> Any:
        found = self._memory[name]
        if name in ("innovations", "whitened"):
            return found.reshape(MODELS, CHANNELS, -1)[..., : self._n].copy()
        return found[: self._n] > 0


class CompiledEstimator:
    """Steps and answers as `Estimator` does. Raises ValueError for a design or axles beyond the library's limits."""

    engine: ClassVar[str] = "Compiled"

    def __init__(self, library: ctypes.CDLL, design: Design, axles: int) -> None:
        self.design, self.axles, self.library = design, axles, library
        self._keeps: list[object] = []  # what C has addresses of
        table = _structure(members(design), self._keeps)
        self._d = ctypes.byref(table)
        size = int(library.wrcd_size(self._d, axles))
        if not size:
            raise ValueError("the design is beyond the compiled estimator's limits")
        axle, train, self._adhesion, result = (_record(library, of) for of in range(4))
        self._memory = np.zeros(size // 8)
        head, first = train.itemsize // 8, _offset(train, "axle") // 8
        self._train = self._memory[:head].view(train)[0]
        self._axle = self._memory[first : first + axles * axle.itemsize // 8].view(axle)
        self._rest = self._memory[head:]
        self._result = np.zeros(1, dtype=result)
        self._newest = CompiledResult(self._result[0], axles)
        self._z, self._present = np.zeros((CHANNELS, axles)), np.zeros((CHANNELS, axles), dtype=bool)
        self._ratio = np.zeros(axles)
        self._tick = _Tick(0, 0.0, *(_address(a) for a in (self._z, self._present, self._ratio)))
        self._e, self._r, self._t = _address(self._memory), _address(self._result), ctypes.byref(self._tick)
        self.arguments = self._e, self._d, self._r  # of C's functions that step: state, design, result
        library.wrcd_begin(self._e, self._d, axles)
        self.health = CompiledHealth(self)

    def __deepcopy__(self, memo: dict[int, Any]) -> "CompiledEstimator":
        twin = memo[id(self)] = CompiledEstimator(self.library, self.design, self.axles)
        twin._memory[:] = self._memory
        return twin

    @property
    def newest(self) -> StepResult:
        """What the newest tick brought."""
        return cast(StepResult, self._newest)

    @property
    def outliers(self) -> int:
        """Samples left out so far."""
        return int(self._train["outliers"])

    @property
    def started(self) -> BoolArray:
        """(n,): whether a measurement was used since the last reset."""
        return np.asarray(self._axle["started"] > 0.0)

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self.library.wrcd_reset(self._e, self._d, int(axle))

    def why_reset(self, result: StepResult, yaw_rate: FloatArray, axle: int) -> Outliers:
        """Of an axle that needs it, after the step (n yaw rates) that showed it and before its reset."""
        gate = Gate(self.axles)
        for name in ("_power", "_last", "_age"):
            own, there = self._axle[f"gate{name}"], getattr(gate, name)
            setattr(gate, name, np.moveaxis(own.reshape(self.axles, *there.shape[:-1]), 0, -1))
        return gate.why_reset(result.innovations[:, :, axle], float(yaw_rate[axle]), axle)

    def step(self, tick: Tick) -> StepResult:
        """One tick; call reset() for the axles that need it before the next. The result holds until then."""
        self._tick.number, self._tick.speed_m_s = tick.number, tick.speed_m_s
        self._z[:], self._present[:], self._ratio[:] = tick.z, tick.present, tick.torque_ratio
        self._newest.notable = self.library.wrcd_step(self._e, self._d, self._t, self._r) != 0
        return self.newest

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
        out = np.zeros(self.axles, dtype=self._adhesion)
        self.library.wrcd_estimate(self._e, self._d, _address(out))
        kinds: dict[str, Any] = dict.fromkeys(_WHOLE, np.int64) | dict.fromkeys(_FLAGS, np.bool_)
        return Estimate(**{n: out[n].astype(kinds[n]) if n in kinds else out[n] for n in out.dtype.names})

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
        """(n, FEATURES) that pairs of sensors are judged by, after a look."""
        return self._told("wrcd_features", self.axles, FEATURES)

    def _told(self, question: str, *shape: int, given: tuple[Any, ...] = ()) -> FloatArray:
        """What a function of the library writes into an array of this shape."""
        out = np.empty(shape)
        getattr(self.library, question)(self._e, self._d, *given, _address(out))
        return out

    def reference(self) -> Estimator:
        """A reference estimator in the same state."""
        e = Estimator(self.design, self.axles)
        for place, name, own in self._arrays(e):
            there = getattr(place, name)
            setattr(place, name, own.astype(there.dtype).reshape(there.shape))
        for c_name, path in _OF_TRAIN.items():
            place, name = _place(e, path)
            setattr(place, name, type(getattr(place, name))(self._train[c_name]))
        e._window._latest_change = int(e._window._since.max())
        return e

    def _arrays(self, e: Estimator) -> Iterator[tuple[Any, str, FloatArray]]:
        """Of each array of the state: whose it is in a reference estimator, its name there, and its own memory with the
        axes of there."""
        n, blocks, ring = self.axles, len(e._window._rows), len(e.health.pairs._past)
        for c_name, path in _OF_AXLE.items():
            place, name = _place(e, path)
            there = getattr(place, name)
            shape = _PADDED.get(c_name, (len(there), CHANNELS) if c_name == "pair_filter" else there.shape[:-1])
            own = np.moveaxis(self._axle[c_name].reshape(n, *shape), 0, -1)
            yield place, name, own[:, : there.shape[1]] if c_name == "bank_x" else own[: len(there)]
        rows, past = np.split(self._rest, [n * blocks * SUMS])
        yield e._window, "_rows", np.moveaxis(rows.reshape(n, blocks, SUMS), 0, -1)
        yield e.health.pairs, "_past", past.reshape(-1, ring, BANDS, 2 * CHANNELS).transpose(1, 2, 0, 3)
        products = self._train["pair_products"].reshape(-1, 2, BANDS, 2 * CHANNELS, 2 * CHANNELS)
        yield e.health.pairs, "_products", products[: (n + 1) // 2].transpose(1, 2, 0, 3, 4)
        yield e.health, "log_odds", self._axle["log_odds"]


class CompiledHealth:
    """What PairHealth tells."""

    def __init__(self, of: CompiledEstimator) -> None:
        self._of, self.judges = of, of.design.health is not None

    @property
    def state(self) -> IntArray:
        """(n,): the PairState that leads where a pair is not more likely sound than not."""
        return np.array([self._of.library.wrcd_pair_state(self._of._e, axle) for axle in range(self._of.axles)])

    @property
    def log_odds(self) -> FloatArray:
        """(n, STATES)."""
        return np.array(self._of._axle["log_odds"])

    def probabilities(self) -> FloatArray:
        """(n, STATES)."""
        return self._of.reference().health.probabilities()

    def figures(self, axle: int) -> HealthFigures:
        """What an axle's state was found by."""
        return self._of.reference().health.figures(axle)


def _place(e: Estimator, path: str) -> tuple[Any, str]:
    """The part of an estimator that has an attribute, and its name there."""
    *parts, name = path.split(".")
    place: Any = e
    for part in parts:
        place = getattr(place, part)
    return place, name


def _address(array: np.ndarray[Any, Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _offset(record: np.dtype[Any], name: str) -> int:
    assert record.fields is not None
    return int(record.fields[name][1])


def _record(library: ctypes.CDLL, of: int) -> np.dtype[Any]:
    """One of C's records as numpy's: each field a number or a row of them."""
    listed = library.wrcd_fields(of)
    names, formats, offsets = list[str](), list[Any](), list[int]()
    while (field := listed[len(names)]).name:
        is_flag = of == 3 and field.bytes < 8 * MODELS  # of a result: bytes
        count = field.bytes if is_flag else field.bytes // 8
        names.append(field.name.decode())
        formats.append((np.uint8 if is_flag else np.float64, () if count == 1 else (count,)))
        offsets.append(field.offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": field.offset})


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
        flat = np.ascontiguousarray(array)
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
