"""Whether the design is this train's: what the core is given to tell it by, and what it tells (wrcd/core/c/fit.c)."""

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from wrcd.core.configuration import Config
from wrcd.core.design import Design, FloatArray
from wrcd.core.layouts import layouts
from wrcd.core.vocabulary import FITS
from wrcd.fit.bogie import PRIOR_SIGMA, BogieConstants
from wrcd.fit.stretches import (
    ALIKE,
    BAND_HZ,
    MAX_FILLED,
    MAX_STRETCHES,
    MIN_SPEED_M_S,
    PULSE_HZ,
    PULSE_SIGMA,
    STEADY,
    STRAIGHT_1_M,
    STRETCH_S,
)
from wrcd.fit.whittle import (
    INCOHERENCE,
    NOISE,
    NOISE_SIGMA,
    POWER_SIGMA,
    SECANT_SIGMA,
    SENSOR_SIGMA,
    SLOPE_SIGMA,
    UNKNOWNS,
    USUAL_SLOPE,
)
from wrcd.native import constant

BINS_APART = 3  # of the band: a Hann window smears each over its neighbours
# Standard deviations (log) of the vehicles that a design is trained for: sim_ecu/design/train_worlds.py draws them.
OWN_SIGMA = dict.fromkeys(PRIOR_SIGMA, 0.06) | {
    "gamma": 0.17, "frame_mass_kg": 0.03, "frame_yaw_inertia_kg_m2": 0.03, "r_0": 0.02, "shaft": 0.08
}  # fmt: skip
# Percentage points by which the packaged bogie's design is too high, for each unit (log) that a constant is above its.
BIAS_PP = {"gamma": 3.3, "primary_yaw_N_m_rad": -2.0, "secondary_yaw_damping_N_m_s_rad": -1.25}
UNSURE = constant("UNSURE")  # ratio from which a vehicle is not surely the own
SURE = 1.645  # standard deviations of what is beyond doubt
CONSTANTS = {
    "gamma": "conicity", "primary_yaw_N_m_rad": "primary yaw stiffness",
    "secondary_yaw_damping_N_m_s_rad": "secondary yaw damping",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class DesignFit:
    """Of one bogie: the numbers of its axles, a word of FITS, and by what.

    ratio: of the likelihoods of another vehicle and of the design's within its scatter, twice its log; stretches: of
    calm running that count; bias_pp and its standard deviation: by how much the estimate is too high; incoherence: the
    share of the signals that the design's vehicle does not explain; times: constants over the design's.
    """

    axles: tuple[int, int]
    word: str
    ratio: float
    stretches: float
    bias_pp: float
    bias_sigma_pp: float
    incoherence: float
    times: Mapping[str, float]

    @property
    def sentence(self) -> str:
        """For a person."""
        of = f"axles {self.axles[0]} and {self.axles[1]}"
        if self.word == "Unknown":
            return f"{of}: too little calm running to tell whether the design is this train's"
        by = f"likelihood ratio {self.ratio:.0f} of {self.stretches:.0f} calm stretches"
        if self.word == "Like":
            return f"{of}: the design is like this train ({by})"
        if self.word == "Unsure" and self.ratio < UNSURE:
            incoherent = f"the signals are incoherent by {100 * self.incoherence:.0f} %"
            return f"{of}: {incoherent}: a sensor is wrong or shaken, or they share no bogie ({by})"
        said = "the design is another bogie's" if self.word == "Unlike" else "the design may be another bogie's"
        return f"{of}: {said} ({by}){self._figures}"

    @property
    def _figures(self) -> str:
        constants = ", ".join(f"{CONSTANTS[name]} x {times:.2g}" for name, times in self.times.items())
        sure = abs(self.bias_pp) - SURE * self.bias_sigma_pp
        if self.word != "Unlike" or sure <= 0.0:
            return f": {constants}"
        return f": {constants}; adhesion is about {abs(self.bias_pp):.1f} points too {_way(self.bias_pp)} here"


def _way(bias_pp: float) -> str:
    return "high" if bias_pp > 0 else "low"


def fits_of(config: Config, bogies: np.ndarray[Any, Any]) -> tuple[DesignFit, ...]:
    """What the states of bogies say."""
    pairs = [(config.axles[a].number, config.axles[b].number) for a, b in config.bogies]
    return tuple(_fit_of(axles, b) for axles, b in zip(pairs, bogies, strict=False))


def _fit_of(axles: tuple[int, int], bogie: Any) -> DesignFit:
    times = {name: float(np.exp(bogie["free"][UNKNOWNS.index(name)])) for name in BIAS_PP}
    names = ("ratio", "weight", "bias_pp", "bias_sigma_pp", "incoherence")
    ratio, stretches, bias, sigma, incoherence = (float(bogie[name]) for name in names)
    return DesignFit(axles, FITS[bogie["verdict"]], ratio, stretches, bias, sigma, incoherence, times)


def fit_members(design: Design) -> dict[str, Any]:
    """Every member of `wrcd_fit_table`; ticks 0: the design's wheelset is in no bogie, or its ticks are below 5 ms."""
    ticks, most = 8 * round(STRETCH_S / design.tick_s / 8), layouts()["fit"]["cosine"].shape[0]
    if not design.is_bogie or ticks > most:
        return {"ticks": 0}
    bogie, bins = BogieConstants.of(design.wheelset), layouts()["fit"]["basis"].shape[0] // 3
    first = int(np.ceil(BAND_HZ[0] * ticks * design.tick_s))
    free = {**PRIOR_SIGMA, **SENSOR_SIGMA, **NOISE_SIGMA}
    own, unknowns = {**free, **OWN_SIGMA}, UNKNOWNS[: UNKNOWNS.index("incoherence")]
    return {
        "constants": list(astuple(bogie)), "own_sigma": [own[name] for name in unknowns],
        "free_sigma": [free[name] for name in unknowns], "bias": [BIAS_PP.get(name, 0.0) for name in unknowns],
        "noise": NOISE.tolist(), "incoherence": INCOHERENCE, "secant_N": bogie.slope_N * USUAL_SLOPE,
        "block_sigma": (SECANT_SIGMA, SLOPE_SIGMA, free["incoherence"]), "power_sigma": POWER_SIGMA,
        "basis": _basis(np.log(first + BINS_APART * np.arange(bins))).ravel().tolist(),
        "cosine": np.cos(2 * np.pi * np.arange(ticks) / ticks).tolist(),
        "highpass": _highpass(design.tick_s).ravel().tolist(), "tick_s": design.tick_s,
        "least_speed_m_s": MIN_SPEED_M_S, "steady": STEADY, "alike": ALIKE, "straight_1_m": STRAIGHT_1_M,
        "pulse_sigma": PULSE_SIGMA, "most_missing": MAX_FILLED, "most_stretches": MAX_STRETCHES,
        "wheelbase_m": bogie.wheelbase_m, "ticks": ticks, "first_bin": first, "bins_apart": BINS_APART,
    }  # fmt: skip


def _basis(x: FloatArray) -> FloatArray:
    """Curves of second order over x (n,), orthonormal: (3, n)."""
    curves = np.stack([(x - x.mean()) ** k for k in range(3)], axis=1)
    return np.asarray(np.linalg.qr(curves)[0].T)


def _highpass(tick_s: float) -> FloatArray:
    """Butterworth's of fourth order at PULSE_HZ: two sections (2, 6)."""
    w = np.tan(np.pi * PULSE_HZ * tick_s)
    rows = []
    for k in range(2):
        damping = 2 * np.sin(np.pi * (2 * k + 1) / 8) * w
        a0 = 1 + damping + w * w
        rows.append([1 / a0, -2 / a0, 1 / a0, 1.0, 2 * (w * w - 1) / a0, (1 - damping + w * w) / a0])
    return np.array(rows)
