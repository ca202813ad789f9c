"""Whether wheelsets are told from the design's: on the rig's own, from the beginning of a log."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.design.brief import find, read_brief
from sim_ecu.design.cases import Condition, simulate_group
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import QUALITY
from sim_ecu.physics.wheelset import LAT_ACCEL, YAW_RATE, Wheelset
from wrcd import resources
from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import FloatArray, load_design
from wrcd.estimator.likeness import Likeness, likeness
from wrcd.settings import read_toml

DESIGN = load_design(resources.DESIGN)
OWN = Wheelset()
AXLES, TICK_S, TEN_S = 4, 0.005, 2000
NEVER = 10**9
SATURATED = np.zeros(AXLES, dtype=bool)


@cache
def played(w: Wheelset, speed: float = 40.0, seconds: float = 10.0, curvature: float = 0.0) -> FloatArray:
    """z (ticks, 2, 4) of wheelsets on dry to greasy rails, from a third to two thirds utilised."""
    rails = zip("BCED", (0.3, 0.5, 0.6, 0.4), strict=True)
    axles = [
        Condition(speed, CURVES[c], QUALITY["poor"], u, math.nan, 2_800_000_000 + k, wheelset=w, curvature=curvature)
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
    for k in range(0, len(x), 4):
        judge.add(x[k : k + 4], None if used is None else used[k], (speed,) * 4, SATURATED)
        if judge.unlike:
            return k + 4
    return NEVER


def bundled(name: str) -> Wheelset:
    return read_brief(read_toml(find(Path(name)))).wheelset


@pytest.mark.parametrize(
    "wheelset",
    [
        replace(OWN, k_w=4 * OWN.k_w),
        replace(OWN, k_w=2 * OWN.k_w),
        replace(OWN, m_w=0.5 * OWN.m_w, I_w=0.5 * OWN.I_w),
        replace(OWN, m_w=2.0 * OWN.m_w, I_w=2.0 * OWN.I_w),
        replace(OWN, I_w=2.5 * OWN.I_w),
    ],
    ids=["yaw stiffness x 4", "yaw stiffness x 2", "mass x 0.5", "mass x 2", "yaw inertia x 2.5"],
)
def test_a_foreign_wheelset_is_found_within_ten_seconds(wheelset: Wheelset) -> None:
    assert found(played(wheelset)) <= TEN_S


@pytest.mark.parametrize("speed", [15.0, 40.0])
def test_the_designs_wheelset_is_never_doubted(speed: float) -> None:
    assert found(played(OWN, speed, 30.0), speed) == NEVER


@pytest.mark.parametrize(
    "wheelset",
    [
        replace(OWN, M_v=1.15 * OWN.M_v),
        replace(OWN, M_v=0.85 * OWN.M_v),
        replace(OWN, r_0=0.92 * OWN.r_0),
        replace(OWN, gamma=0.3),
        replace(OWN, k_w=1.1 * OWN.k_w, I_w=0.9 * OWN.I_w, m_w=0.9 * OWN.m_w),
    ],
    ids=["load x 1.15", "load x 0.85", "worn", "conicity x 2", "scattered"],
)
def test_load_wear_and_scatter_are_not_doubted(wheelset: Wheelset) -> None:
    assert found(played(wheelset)) == NEVER


@pytest.mark.parametrize("name", ["metro", "locomotive"])
def test_a_wheelset_of_like_stiffness_and_load_over_mass_is_not_told(name: str) -> None:
    """The limit that docs/reference/limits.md states: what differs is the torque's scale, which shows in neither."""
    w = bundled(name)
    assert 0.8 < (w.k_w / w.I_w) / (OWN.k_w / OWN.I_w) < 1.25
    assert 0.7 < (w.M_v / w.m_w) / (OWN.M_v / OWN.m_w) < 1.35
    assert found(played(w)) == NEVER


def test_nothing_is_concluded_in_a_curve_or_with_gaps() -> None:
    foreign = replace(OWN, m_w=0.5 * OWN.m_w, I_w=0.5 * OWN.I_w)
    assert found(played(foreign, curvature=1 / 1500)) == NEVER
    used = np.ones((TEN_S, AXLES), dtype=bool)
    used[::300] = False  # a joint every one and a half seconds
    assert found(played(foreign), used=used) == NEVER


def test_what_was_found_holds_across_a_standstill() -> None:
    judge, x = made(), played(replace(OWN, k_w=4 * OWN.k_w)) / DESIGN.noise_rms[:, None]
    judge.add(x, None, (40.0,) * len(x), SATURATED)
    assert judge.unlike
    for axle in range(AXLES):
        judge.reset(axle)
    assert judge.unlike


@pytest.mark.parametrize("phase", range(4))
def test_blocks_and_ticks_give_the_same(phase: int) -> None:
    x = played(replace(OWN, k_w=4 * OWN.k_w)) / DESIGN.noise_rms[:, None]
    by_block, by_tick = made(), made()
    speeds = (40.0 + 0.001 * np.arange(len(x))).tolist()
    by_block.add(x[:phase], None, speeds[:phase], SATURATED)
    for k in range(phase, len(x), 4):
        by_block.add(x[k : k + 4], None, speeds[k : k + 4], SATURATED)
    for k, row in enumerate(x):
        by_tick.add(row[None], np.ones(AXLES, dtype=bool), speeds[k : k + 1], SATURATED)
    assert np.allclose(by_block.figures, by_tick.figures, rtol=1e-9)
    assert by_block.unlike
    assert by_tick.unlike


def test_a_design_that_says_too_little_of_its_wheelset_judges_nothing() -> None:
    assert likeness(replace(DESIGN, wheelset={"r_0": 0.5}), AXLES) is None
    assert likeness(replace(DESIGN, wheelset=DESIGN.wheelset | {"I_w": 0}), AXLES) is None


def test_a_design_of_long_ticks_judges_nothing() -> None:
    assert likeness(replace(DESIGN, tick_s=0.005), AXLES) is not None
    assert likeness(replace(DESIGN, tick_s=0.01), AXLES) is None  # no band of nothing but noise
