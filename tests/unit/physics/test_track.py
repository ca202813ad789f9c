"""Tracks of named spectra: what they are drawn from, and that a place on one is always the same."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from sim_ecu.physics.track import (
    ALIGNMENT,
    CROSS_LEVEL,
    GAUGE,
    LONGEST_M,
    QUALITY,
    RAILS_M,
    SHORTEST_M,
    SPACING_M,
    SPECTRA,
    Densities,
    Spectrum,
    Track,
    between_nodes,
    deviation,
    irregularity,
)
from sim_ecu.physics.wheelset import FloatArray

COLUMNS = (ALIGNMENT, CROSS_LEVEL, GAUGE)
WHOLE_M = (0.1, 1e5)  # wavelengths that hold all of a density
# Standard deviation of alignment over 3 to 25 m, mm. UIC 518's QN1 is 0.7 at 300 km/h and 1.2 at 120 km/h.
BANDS_MM = {"erri-low": 0.71, "erri-high": 1.21, "fra-4": 4.27, "fra-5": 2.14, "fra-6": 1.43, "china-hs": 0.26}
# TB/T 3352-2014: from a wave number f (1/m) on, level and exponent of mm^2/(1/m) over f; cross-level is a height.
CHINA = {
    ALIGNMENT: ((0.045, 0.1234), (3.9513e-3, 1.1047e-2, 7.5633e-4), (1.867, 1.5354, 2.8171)),
    CROSS_LEVEL: ((0.0258, 0.1163), (3.6148e-3, 4.3685e-2, 4.5867e-3), (1.7278, 1.0461, 2.0939)),
    GAUGE: ((0.109, 0.2938), (5.4978e-2, 5.0701e-3, 1.8778e-4), (0.8282, 1.9037, 4.5948)),
}
# Nodes of seed 1 on a good track with 1 m behind the origin: number, y_t, dy_t/dx.
AS_EVER = (
    (0, 1.065696105348e-03, 7.050249434624e-04),
    (20, 1.372105787603e-03, 4.251664865194e-04),
    (2068, -1.083960874625e-03, 4.921810679408e-04),
    (3000, 1.569869323491e-03, 5.378353459989e-04),
)


def density(parts: Densities, omega: FloatArray) -> FloatArray:
    return np.asarray(sum(d.at(omega) for d in parts))


@pytest.mark.parametrize("name", SPECTRA)
def test_a_track_has_the_densities_of_its_spectrum(name: str) -> None:
    nodes = np.concatenate([Track(SPECTRA[name], seed).reach(30_000.0) for seed in range(2)])
    for column, parts in zip(COLUMNS, SPECTRA[name].quantities, strict=True):
        y, slope = nodes[:, column], nodes[:, column + 1]
        if not parts:
            assert not y.any()
            assert not slope.any()
            continue
        assert y.std() == pytest.approx(deviation(parts, *WHOLE_M), rel=0.1)
        f, power = welch(y, fs=1 / SPACING_M, nperseg=16384)
        omega = 2 * math.pi * f
        for lo, hi in ((0.05, 0.3), (0.3, 1.5), (1.5, 8.0)):
            band = (omega > lo) & (omega < hi)
            ratio = power[band] / (2 * math.pi * density(parts, omega[band]))
            assert ratio.mean() == pytest.approx(1.0, abs=0.12)
        wide = np.geomspace(1e-4, 1e4, 20_000)
        assert slope.var() == pytest.approx(np.trapezoid(wide**2 * density(parts, wide), wide), rel=0.03)


@pytest.mark.parametrize("name", BANDS_MM)
def test_alignment_of_3_to_25_m_is_as_large_as_published(name: str) -> None:
    assert 1e3 * deviation(SPECTRA[name].alignment) == pytest.approx(BANDS_MM[name], abs=0.007)
    f, power = welch(Track(SPECTRA[name], 11).reach(20_000.0)[:, ALIGNMENT], fs=1 / SPACING_M, nperseg=16384)
    band = (f >= 1 / LONGEST_M) & (f <= 1 / SHORTEST_M)
    assert 1e3 * math.sqrt(power[band].sum() * f[1]) == pytest.approx(BANDS_MM[name], rel=0.08)


@pytest.mark.parametrize(
    ("name", "column", "square_mm2", "omega_s", "ratio"),
    [
        # A_v / b^2 at Omega = Os is halved by Os and hardly changed by Or
        ("erri-low", CROSS_LEVEL, 0.4032 / 0.75**2, 0.438, 0.5), ("erri-high", GAUGE, 0.1032, 0.438, 0.5),
        # 4 k A_v Oc^2 / ((O^2 + Oc^2)(O^2 + Os^2)) with k = 1/4, a height over 1.5 m
        ("fra-4", CROSS_LEVEL, 53.76 / 1.5**2, 1.1312, 0.5), ("fra-6", GAUGE, 3.39, 0.438, 0.5),
    ],
)  # fmt: skip
def test_cross_level_is_an_angle_and_gauge_a_width(
    name: str, column: int, square_mm2: float, omega_s: float, ratio: float
) -> None:
    parts = SPECTRA[name].quantities[COLUMNS.index(column)]
    c2 = 0.8245**2
    expected = square_mm2 * 1e-6 * ratio * c2 / ((omega_s**2 + c2) * omega_s**2)
    assert density(parts, np.array([omega_s]))[0] == pytest.approx(expected, rel=0.005)


@pytest.mark.parametrize("column", COLUMNS)
def test_parts_fitted_to_the_chinese_powers_deviate_little(column: int) -> None:
    """By what track.py says of them, over the wavelengths that move a wheelset."""
    changes, levels, exponents = CHINA[column]

    def published(f: FloatArray) -> FloatArray:
        """In m^2 or rad^2 over rad/m."""
        at = np.searchsorted(changes, f, side="right")
        of = 1e-6 / RAILS_M**2 if column == CROSS_LEVEL else 1e-6
        return np.asarray(np.array(levels)[at] / f ** np.array(exponents)[at] * of / (2 * math.pi))

    parts = SPECTRA["china-hs"].quantities[COLUMNS.index(column)]
    f = np.geomspace(1 / 60.0, 1 / 3.0, 2000)
    assert density(parts, 2 * math.pi * f) == pytest.approx(published(f), rel=0.14)
    f = np.geomspace(1 / LONGEST_M, 1 / SHORTEST_M, 2000)
    exact = math.sqrt(np.trapezoid(published(f), 2 * math.pi * f))
    assert deviation(parts) == pytest.approx(exact, rel=0.01)


def test_the_alignment_of_a_seed_is_what_it_always_was() -> None:
    nodes = Track(QUALITY["good"], 1, behind_m=1.0).reach(150.0)
    for at, y, slope in AS_EVER:
        assert nodes[at, :2].tolist() == pytest.approx([y, slope], rel=1e-9)


def test_cross_level_and_gauge_leave_the_alignment_of_a_seed() -> None:
    alone, whole = (Track(SPECTRA[name], 5, behind_m=20.0).reach(20_000.0) for name in ("good", "erri-low"))
    assert np.array_equal(whole[:, :2], alone[:, :2])
    assert np.abs(np.corrcoef(whole[:, COLUMNS].T) - np.eye(3)).max() < 0.1


@pytest.mark.parametrize("name", ["good", "erri-high", "china-hs"])
def test_a_place_does_not_depend_on_how_a_track_is_asked_for(name: str) -> None:
    far, near, late = (Track(SPECTRA[name], 9, behind_m) for behind_m in (70.0, 1.0, 0.0))
    near.reach(10.0)
    near.reach(900.0)
    assert near.start_m == pytest.approx(-1.0)
    assert np.array_equal(far.reach(900.0)[1380:], near.nodes[: len(far.nodes) - 1380])
    for behind_m in (0.5, 70.0, 30.0):
        late.ensure_behind(behind_m)
    assert late.start_m == far.start_m == pytest.approx(-70.0)
    assert np.array_equal(late.reach(900.0), far.nodes)


@pytest.mark.parametrize("column", [ALIGNMENT, CROSS_LEVEL])
def test_what_lies_behind_the_origin_belongs_to_the_same_process(column: int) -> None:
    """The covariance across it is that of any two places so far apart, and the slope is that of the profile."""
    parts = SPECTRA["erri-low"].quantities[COLUMNS.index(column)]
    only = Spectrum("one quantity", *(parts if c == column else () for c in COLUMNS))
    y = np.array([Track(only, seed, behind_m=4.0).reach(4.0)[[0, 80, 160], column] for seed in range(1200)])
    omega = np.geomspace(1e-5, 1e3, 40_000)
    rho = [np.trapezoid(density(parts, omega) * np.cos(omega * apart), omega) for apart in (0.0, 4.0, 8.0)]
    assert np.cov(y.T)[0] / rho[0] == pytest.approx(np.array(rho) / rho[0], abs=0.13)
    assert np.cov(y.T)[2, 1] / rho[0] == pytest.approx(rho[1] / rho[0], abs=0.13)
    nodes = Track(only, 3, behind_m=50.0).reach(50.0)[:2001, column : column + 2]
    off = np.abs(np.gradient(nodes[:, 0], SPACING_M) - nodes[:, 1])[1:-1]
    assert off[:990].mean() == pytest.approx(off[1010:].mean(), rel=0.3)
    assert off.mean() < 0.15 * nodes[:, 1].std()
    assert off[990:1010].max() < 5 * off.std()


@pytest.mark.parametrize("column", COLUMNS)
def test_between_nodes_lies_a_cubic_with_its_slope(column: int) -> None:
    nodes = Track(SPECTRA["fra-4"], 2).reach(50.0)
    part = nodes[100:].copy()  # as a ride has it: node k at k - 100
    for at in (10.01, 12.345, 33.33):
        k = round(at / SPACING_M)
        place = k * SPACING_M
        before, there, after, value = (
            between_nodes(part, -100, 100, len(nodes), d, column) for d in (place - 1e-6, place, place + 1e-6, at)
        )
        assert there == pytest.approx(nodes[k, column], rel=1e-9)
        assert (after - before) / 2e-6 == pytest.approx(nodes[k, column + 1], rel=1e-4)
        assert column or value == irregularity(nodes, at)
