"""What the sensors of a linear bogie measure on a random track, in frames too; and its state in C (fit.c)."""

import ctypes
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from sim_ecu.play.encoder import COUNTERS
from tests.support.can_ids import LAT_ACCEL, TORQUE, VEHICLE_SPEED, YAW_RATE
from tests.support.sensor_simulator import START_US
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.packaged_designs import design_path
from wrcd.core.design import BoolArray, FloatArray, load_design
from wrcd.core.design_fit import fit_members
from wrcd.core.layouts import layouts
from wrcd.core.vocabulary import FITS
from wrcd.fit.bogie import BogieConstants, ComplexArray, response
from wrcd.fit.stretches import CHANNELS, BogieSignals
from wrcd.fit.whittle import NOISE, UNKNOWNS, USUAL_SLOPE
from wrcd.native import library

DESIGN = load_design(design_path("multiple-unit"))
OWN = BogieConstants.of(DESIGN.wheelset)
MEMBERS = fit_members(DESIGN)
TICK_S, PIECE_S = DESIGN.tick_s, 120.0
HIGHEST_HZ = 20.0
DRY = OWN.slope_N * USUAL_SLOPE
SPEEDS_M_S = (25.0, 20.0, 31.25, 12.5)  # at which a wheelbase is a whole number of ticks
_ROW, _COLUMN = np.triu_indices(CHANNELS, 1)


@dataclass(frozen=True, slots=True)
class Ride:
    """z (T, 4) as BogieSignals has it, speed_m_s (T,)."""

    z: FloatArray
    speed_m_s: FloatArray

    def part(self, first: int, end: int | None = None) -> "Ride":
        return Ride(self.z[first:end], self.speed_m_s[first:end])

    @property
    def signals(self) -> BogieSignals:
        return BogieSignals(TICK_S, self.z, self.speed_m_s, np.ones(len(self.z), bool))


def powers(frequency_hz: FloatArray, speed_m_s: float) -> FloatArray:
    """(F, 2): of alignment and cross-level, in units of white noise's variance: a rough track."""
    waves = frequency_hz / speed_m_s
    return np.stack((1e-8 * waves**-3.2, 1e-8 * waves**-2.5), axis=1)


def piece(
    c: BogieConstants, speed_m_s: float, rng: np.random.Generator, seconds: float, log_of_slope: float
) -> FloatArray:
    """z (T, 4) at one speed. log_of_slope: of the creep force's secant over dry rail's; g11 is nine tenths of it."""
    ticks = round(seconds / TICK_S)
    f: FloatArray = np.fft.rfftfreq(ticks, TICK_S).astype(np.float64)
    used = (f > 0.3) & (f < HIGHEST_HZ)
    g22 = DRY * np.exp(log_of_slope)
    H = response(c, speed_m_s, 0.9 * g22, g22, f[used])[:, :, :2].reshape(-1, CHANNELS, 2)
    drawn = rng.normal(size=(2, used.sum(), 2)) * np.sqrt(0.5 * ticks * powers(f[used], speed_m_s))
    spectrum = np.zeros((len(f), CHANNELS), np.complex128)
    spectrum[used] = np.einsum("fcs,fs->fc", H, drawn[0] + 1j * drawn[1])
    noise = rng.normal(size=(ticks, CHANNELS)) * NOISE
    return np.asarray(np.fft.irfft(spectrum, ticks, axis=0) + noise)


def ride(
    c: BogieConstants = OWN, speeds_m_s: Sequence[float] = SPEEDS_M_S, seed: int = 1, seconds: float = PIECE_S
) -> Ride:
    """So many seconds at each speed, on rails of several slopes."""
    rng = np.random.default_rng(seed)
    pieces = [piece(c, v, rng, seconds, 0.3 * (k % 3 - 1)) for k, v in enumerate(speeds_m_s)]
    return Ride(np.concatenate(pieces), np.repeat(speeds_m_s, round(seconds / TICK_S)))


def table(**changed: Any) -> np.ndarray[Any, Any]:
    """The design's table, with some members changed."""
    out = np.zeros(1, dtype=layouts()["fit"])
    for name, value in {**MEMBERS, **changed}.items():
        out[name][0] = value
    return out


def _at(array: np.ndarray[Any, Any]) -> ctypes.c_void_p:
    assert array.flags.c_contiguous
    return ctypes.c_void_p(array.ctypes.data)


class Bogie:
    """A bogie's state in C, and who steps it."""

    def __init__(self, **changed: Any) -> None:
        self.table, self.state = table(**changed), np.zeros(1, dtype=layouts()["bogie_state"])
        self.tick = 0

    def run(self, ride: Ride, present: BoolArray | None = None) -> "Bogie":
        """Ticks on end; a NaN is not there."""
        there = np.ascontiguousarray(np.isfinite(ride.z) if present is None else present, np.uint8)
        z, speed = (np.ascontiguousarray(a, np.float64) for a in (ride.z, ride.speed_m_s))
        run = _c("wrcd_fit_run", None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 3)
        run(_at(self.table), _at(self.state), self.tick, len(z), _at(z), _at(there), _at(speed))
        self.tick += len(z)
        return self

    def step(self, z: FloatArray, speed_m_s: float, is_reverse: bool) -> None:
        """One tick, one way or the other."""
        there = np.ones(CHANNELS, np.uint8)
        of = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_bool, ctypes.c_int64, *[ctypes.c_void_p] * 2, ctypes.c_double)
        step = _c("wrcd_fit_step", None, *of)
        step(
            _at(self.table), _at(self.state), is_reverse, self.tick, _at(np.ascontiguousarray(z)), _at(there), speed_m_s
        )
        self.tick += 1

    def copy(self) -> "Bogie":
        """Another one that has come as far."""
        twin = Bogie()
        twin.table[:], twin.state[:], twin.tick = self.table, self.state, self.tick
        return twin

    def of(self, name: str) -> Any:
        """A member of the state."""
        return self.state[name][0]

    @property
    def word(self) -> str:
        return FITS[self.of("verdict")]

    @property
    def said(self) -> tuple[float, ...]:
        """Every number that it is told by."""
        return tuple(float(self.of(n)) for n in ("ratio", "bias_pp", "bias_sigma_pp", "weight"))

    def times(self, name: str) -> float:
        """A constant of any vehicle over the design's."""
        return float(np.exp(self.of("free")[UNKNOWNS.index(name)]))

    @property
    def information(self) -> FloatArray:
        """(27, 27), of the sum."""
        return np.asarray(self.of("information").reshape(len(MEMBERS["bias"]), -1))

    @property
    def cross(self) -> ComplexArray:
        """(F, 4, 4), of the newest whole block."""
        return hermitian(self.of("cross").reshape(-1, CHANNELS * CHANNELS))


def hermitian(numbers: FloatArray) -> ComplexArray:
    """(F, 4, 4) of (F, 16): diagonals, then re and im of what is above them."""
    out = np.zeros((len(numbers), CHANNELS, CHANNELS), np.complex128)
    above = numbers[:, CHANNELS::2] + 1j * numbers[:, CHANNELS + 1 :: 2]
    out[:, _ROW, _COLUMN], out[:, _COLUMN, _ROW] = above, above.conj()
    out[:, np.arange(CHANNELS), np.arange(CHANNELS)] = numbers[:, :CHANNELS]
    return out


class _Moment(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("speed_m_s", "g11_N", "g22_N", "later_s")]


@cache
def _c(name: str, result: Any, *arguments: Any) -> Any:
    return ctypes.CFUNCTYPE(result, *arguments)((name, library()))


def response_in_c(c: FloatArray, moment: Sequence[float], frequency_hz: float) -> ComplexArray:
    """(2 wheelsets, 3 signals, 2 sources)"""
    out = np.zeros((2, 3, 2), np.complex128)
    of = _c("wrcd_bogie_response", None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p)
    of(_at(np.ascontiguousarray(c, np.float64)), ctypes.byref(_Moment(*moment)), frequency_hz, _at(out))
    return out


def changed_in_c(c: FloatArray, logs: Mapping[int, float]) -> FloatArray:
    """Constants with unknowns, by their places, at logs."""
    out = np.array(c)
    change = _c("wrcd_bogie_change", None, ctypes.c_void_p, ctypes.c_int, ctypes.c_double)
    for unknown, log in logs.items():
        change(_at(out), unknown, log)
    return out


def frames(of: Ride, torque_N_m: float = 10_000.0) -> list[Frame]:
    """Of axles 1 and 2 at each tick, 1 ms after it begins; the packaged DBC's."""
    out, slow = list[Frame](), {}
    z = np.round(of.z * (1e6, 1e5, 1e6, 1e5)).astype(np.int64).tolist()
    ids = (YAW_RATE[1], LAT_ACCEL[1], YAW_RATE[2], LAT_ACCEL[2])
    for k, (row, v) in enumerate(zip(z, of.speed_m_s.tolist(), strict=True)):
        counter, at = k % COUNTERS, START_US + 5000 * k + 1000
        out += [_frame(at, can_id, struct.pack("<i", raw)[:3], counter) for can_id, raw in zip(ids, row, strict=True)]
        same = counter, v
        if same not in slow:
            torque, speed = struct.pack("<i", round(torque_N_m * 100))[:3], struct.pack("<H", round(v / 0.0025))
            slow[same] = [
                _frame(at, i, p, counter) for i, p in ((TORQUE[1], torque), (TORQUE[2], torque), (VEHICLE_SPEED, speed))
            ]
        out += [Frame(at, f.can_id, f.data) for f in slow[same]]
    return out


def _frame(at_us: int, can_id: int, payload: bytes, counter: int) -> Frame:
    return Frame(at_us, can_id, protect(b"\0\0" + payload, can_id, counter))
