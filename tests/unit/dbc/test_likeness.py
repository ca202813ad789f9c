"""Whether wheelsets are told from the design's: on the rig's own, from the beginning of a log."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from sim_ecu.design.cases import Condition, simulate_group
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import SPECTRA
from sim_ecu.physics.wheelset import LAT_ACCEL, YAW_RATE, Wheelset
from sim_ecu.play.vehicles import load_vehicle
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.dbc.bus_check.likeness import Likeness, likeness
from wrcd.estimator.design import FloatArray, load_design
from wrcd.estimator.paper.bank import BoolArray

DESIGN = load_design(LONE_DESIGN)
OWN = Wheelset()
AXLES, TICK_S, TEN_S = 4, 0.005, 2000
NEVER = 10**9
ALL, SATURATED = np.ones(AXLES, dtype=bool), np.zeros(AXLES, dtype=bool)


@cache
def played(w: Wheelset, speed: float = 40.0, seconds: float = 10.0, curvature: float = 0.0) -> FloatArray:
    """z (ticks, 2, 4) of wheelsets on dry to greasy rails, from a third to two thirds utilised."""
    rails = zip("BCED", (0.3, 0.5, 0.6, 0.4), strict=True)
    axles = [
        Condition(speed, CURVES[c], SPECTRA["poor"], u, math.nan, 2_800_000_000 + k, wheelset=w, curvature=curvature)
        for k, (c, u) in enumerate(rails)
    ]
    y = simulate_group(w, axles, seconds, TICK_S)
    rng, s = np.random.default_rng(5), SENSOR_SETS["mems"]
    out = [s.yaw_rate.measure(y[:, YAW_RATE], rng), s.lat_accel.measure(y[:, LAT_ACCEL], rng)]
    return np.stack(out, axis=1)


def made() -> Likeness:
    out = likeness(DESIGN, AXLES)
    assert out is not None
    return out


def found(z: FloatArray, speed: float = 40.0, used: BoolArray | None = None) -> int:
    """The tick from which on the wheelsets are unlike; NEVER."""
    judge, x = made(), z / DESIGN.noise_rms[:, None]
    for k, row in enumerate(x):
        judge.add(row, ALL if used is None else used[k], speed, SATURATED)
        if judge.unlike:
            return k + 1
    return NEVER


def scaled(**factors: float) -> Wheelset:
    """Ours, but for some properties that are so many times as large."""
    return replace(OWN, **{name: factor * getattr(OWN, name) for name, factor in factors.items()})


def bundled(name: str) -> Wheelset:
    return load_vehicle(name)


@pytest.mark.parametrize(
    ("changed", "by_tick"),
    [
        ({"k_w": 4.0}, TEN_S),
        ({"k_w": 2.0}, TEN_S),
        ({"m_w": 0.5, "I_w": 0.5}, TEN_S),
        ({"m_w": 2.0, "I_w": 2.0}, TEN_S),
        ({"I_w": 2.5}, TEN_S),
        # load, wear and scatter are not doubted
        ({"M_v": 1.15}, NEVER),
        ({"M_v": 0.85}, NEVER),
        ({"r_0": 0.92}, NEVER),
        ({"gamma": 0.3 / OWN.gamma}, NEVER),
        ({"k_w": 1.1, "I_w": 0.9, "m_w": 0.9}, NEVER),
    ],
    ids=str,
)
def test_a_foreign_wheelset_alone_is_found_within_ten_seconds(changed: dict[str, float], by_tick: int) -> None:
    at = found(played(scaled(**changed)))
    assert at <= TEN_S if by_tick == TEN_S else at == NEVER


@pytest.mark.parametrize("speed", [15.0, 40.0])
def test_the_designs_wheelset_is_never_doubted(speed: float) -> None:
    assert found(played(OWN, speed, 30.0), speed) == NEVER


@pytest.mark.parametrize("name", ["metro", "locomotive"])
def test_a_wheelset_of_like_stiffness_and_load_over_mass_is_not_told(name: str) -> None:
    """The limit that docs/reference/limits.md states: what differs is the torque's scale, which shows in neither."""
    w = bundled(name)
    assert 0.8 < (w.k_w / w.I_w) / (OWN.k_w / OWN.I_w) < 1.25
    assert 0.7 < (w.M_v / w.m_w) / (OWN.M_v / OWN.m_w) < 1.35
    assert found(played(w)) == NEVER


def test_nothing_is_concluded_in_a_curve_or_with_gaps() -> None:
    foreign = scaled(m_w=0.5, I_w=0.5)
    assert found(played(foreign, curvature=1 / 1500)) == NEVER
    used = np.ones((TEN_S, AXLES), dtype=bool)
    used[::300] = False  # a joint every one and a half seconds
    assert found(played(foreign), used=used) == NEVER


def test_what_was_found_holds_across_a_standstill() -> None:
    judge, x = made(), played(scaled(k_w=4.0)) / DESIGN.noise_rms[:, None]
    for row in x:
        judge.add(row, ALL, 40.0, SATURATED)
    assert judge.unlike
    for axle in range(AXLES):
        judge.reset(axle)
    assert judge.unlike


@pytest.mark.parametrize(
    ("changed", "judged"),
    [
        ({"wheelset": {"r_0": 0.5}}, False),
        ({"wheelset": DESIGN.wheelset | {"I_w": 0}}, False),
        ({"tick_s": 0.005}, True),
        ({"tick_s": 0.01}, False),  # no band of nothing but noise
    ],
)
def test_a_design_of_too_little_or_of_long_ticks_judges_nothing(changed: dict[str, Any], judged: bool) -> None:
    assert (likeness(replace(DESIGN, **changed), AXLES) is not None) == judged
