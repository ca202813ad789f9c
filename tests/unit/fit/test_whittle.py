"""The fit finds constants in cross-spectra that the model made, whatever the track."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from sim_ecu.play.vehicles import load_vehicle
from wrcd.fit.bogie import BogieConstants
from wrcd.fit.stretches import Blocks
from wrcd.fit.whittle import UNKNOWNS, BogieFit, Guess, run_trimmed

NOMINAL = BogieConstants.of(asdict(load_vehicle("multiple-unit")))
SPEEDS_M_S = np.array([10.0, 14.0, 19.0, 25.0, 32.0, 38.0])
FREQUENCIES_HZ = np.linspace(1.0, 16.0, 24)
TRUE = {
    "gamma": 0.25, "primary_yaw_N_m_rad": -0.5, "secondary_yaw_damping_N_m_s_rad": 0.8, "primary_lateral_N_m": 0.2,
    "lead_1": 0.003, "askew_2": 0.02, "speed_scale": -0.02, "yaw_noise_1": 0.5,
}  # fmt: skip


def made(stretches: float = 400.0) -> Blocks:
    """Return the cross-spectra that the model makes of TRUE on a rough track, without chance."""
    empty = Blocks(
        np.tile(np.eye(4, dtype=np.complex128), (len(SPEEDS_M_S), len(FREQUENCIES_HZ), 1, 1)), SPEEDS_M_S,
        np.full(len(SPEEDS_M_S), stretches), FREQUENCIES_HZ,
    )  # fmt: skip
    fit = BogieFit(empty, NOMINAL)
    unknowns = np.array([TRUE.get(name, 0.0) for name in UNKNOWNS])
    waves = FREQUENCIES_HZ[None, :] / SPEEDS_M_S[:, None]  # 1/m
    powers = np.stack((np.log(1e-8 * waves**-3.2), np.log(1e-8 * waves**-2.5)), axis=2)
    slopes = np.stack((np.linspace(-0.4, 0.4, len(SPEEDS_M_S)), np.full(len(SPEEDS_M_S), -0.1)), axis=1)
    judged = fit._judged(Guess(unknowns, slopes, powers))
    return replace(empty, cross=judged.L @ judged.L.conj().swapaxes(2, 3))


@pytest.fixture(scope="module")
def fit() -> BogieFit:
    found = BogieFit(made(), NOMINAL)
    found.run()
    return found


@pytest.mark.parametrize("name", TRUE)
def test_fit_finds_what_the_model_was_made_with(fit: BogieFit, name: str) -> None:
    k = UNKNOWNS.index(name)
    sigma = float(np.sqrt(fit.covariance[k, k]))
    assert sigma < 0.5 * fit.sigma[k]
    assert fit.logs[name] == pytest.approx(TRUE[name], abs=max(2 * sigma, 1e-4))


def test_fit_explains_its_spectra(fit: BogieFit) -> None:
    np.testing.assert_allclose(fit.misfit, 0.0, atol=0.01)
    assert fit.incoherence == pytest.approx(0.03, rel=0.05)
    assert fit.constants.gamma == pytest.approx(NOMINAL.gamma * np.exp(0.25), rel=0.02)


def test_more_stretches_tell_more() -> None:
    few, many = (BogieFit(made(n), NOMINAL) for n in (40.0, 400.0))
    k = UNKNOWNS.index("gamma")
    assert few.covariance[k, k] > 2 * many.covariance[k, k]


def test_known_constant_is_kept() -> None:
    found = BogieFit(made(), NOMINAL, {"gamma": 1e-4})
    found.run(steps=10)
    assert abs(found.logs["gamma"]) < 0.01


def test_block_with_what_no_track_explains_is_left_out() -> None:
    blocks = made(20.0)
    power = np.einsum("fii->fi", blocks.cross[2]).real
    blocks.cross[2] += 0.3 * power[:, :, None] * np.eye(4)
    found = BogieFit(blocks, NOMINAL)
    assert run_trimmed(found) == 20
    assert 19.0 not in found.blocks.speed_m_s
