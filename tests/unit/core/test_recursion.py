"""The estimator's recursive filters against scipy's."""

import numpy as np
import pytest
from scipy.signal import butter, ellip, sosfilt

from tests.support.c_parts import Sections
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.core.design import FloatArray, load_design, stable

FILTERS = {
    "low-pass": ellip(5, 0.5, 60, 14, fs=200, output="sos"),
    "high-pass": butter(4, 25, "highpass", fs=200, output="sos"),
    "one section": butter(1, 5, fs=200, output="sos"),
}


def run(sos: FloatArray, u: FloatArray) -> FloatArray:
    """Tick by tick over u (ticks, channels)."""
    sections = Sections(sos, u.shape[1])
    return np.stack([sections.step(row) for row in u])


@pytest.mark.parametrize("name", FILTERS)
def test_sections_filter_as_scipy_does(name: str) -> None:
    sos = np.asarray(FILTERS[name])
    u = np.random.default_rng(1).standard_normal((2000, 8)) + 5.0
    assert run(sos, u) == pytest.approx(sosfilt(sos, u, axis=0), abs=1e-11)


def test_filters_of_the_design_pass_their_band() -> None:
    """The track's hunting passes the low-pass, and vibration does not; for the high-pass it is the other way round."""
    design = load_design(LONE_DESIGN)
    t = np.arange(4000) * design.tick_s
    hunting, vibration = np.sin(2 * np.pi * 3 * t), np.sin(2 * np.pi * 50 * t)
    for sos, kept, lost in ((design.lowpass, hunting, vibration), (design.highpass, vibration, hunting)):
        out = run(sos, np.stack((kept, lost), axis=1))[1000:]
        assert np.ptp(out[:, 0]) > 0.85 * 2
        assert np.ptp(out[:, 1]) < 0.02 * 2
        assert stable(sos)


def test_unstable_section_is_an_error() -> None:
    for sos in FILTERS.values():
        assert stable(np.asarray(sos))
        wild = np.array(sos)
        wild[0, 4:] = [-2.01, 1.005]
        assert not stable(wild)
    unscaled = np.array(FILTERS["one section"])
    unscaled[0, 3] = 2.0
    assert not stable(unscaled)
