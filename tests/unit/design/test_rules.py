"""The fit of a rule base, on data whose answer is known."""

import numpy as np
import pytest
from scipy.signal import sosfilt

from sim_ecu.design.brief import load_source
from sim_ecu.design.linear import steady_state
from sim_ecu.design.make import LOWEST
from sim_ecu.design.rules import COVERS, RuleBase, adhesion_of, fit, output_of, polynomial
from sim_ecu.physics.wheelset import Wheelset
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.core.design import closed_loop, load_design

SETS = (3, 3, 2)


def data(n: int, seed: int, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Three inputs and an adhesion that curves over them; the noise (relative) is larger where the first is high."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (n, 3))
    output = 50 + 25 * x[:, 0] - 15 * x[:, 1] ** 2 + 5 * x[:, 0] * x[:, 2]
    mu = adhesion_of(output) * np.exp(noise * (1.5 + x[:, 0]) * rng.standard_normal(n))
    return x, mu


def fitted(n: int = 3000, noise: float = 0.0, rules: int = 18, covers: float = COVERS) -> RuleBase:
    x, mu = data(n, 1, noise)
    return fit(x, mu, SETS, rules, np.ones(n), np.arange(n), np.full(n, covers))


def test_local_lines_follow_a_curved_surface() -> None:
    base = fitted()
    x, mu = data(1000, 2)
    assert np.abs(base.mu_pct(x) - mu).mean() < 0.3
    # constants in the same sets could not: their best is the mean in each
    share, _ = base.shares(x)
    constants = np.linalg.lstsq(share, output_of(mu), rcond=None)[0]
    assert np.abs(adhesion_of(share @ constants) - mu).mean() > 3 * np.abs(base.mu_pct(x) - mu).mean()


@pytest.mark.parametrize("covers", [0.78, 0.9])
def test_spreads_cover_what_they_claim_on_fresh_data(covers: float) -> None:
    base = fitted(6000, 0.1, covers=covers)
    x, mu = data(4000, 3, 0.1)
    guess = base.mu_pct(x)
    inside = np.abs(guess - mu) <= base.spread(x) * guess
    assert inside.mean() == pytest.approx(covers, abs=0.04)
    for part in (x[:, 0] < -0.5, x[:, 0] > 0.5):  # where the noise is small, and where it is large
        assert inside[part].mean() == pytest.approx(covers, abs=0.08)
    assert base.spread(x[x[:, 0] > 0.5]).mean() > 2 * base.spread(x[x[:, 0] < -0.5]).mean()


def test_column_without_sets_is_held_above_its_lowest() -> None:
    """In the fit as in its answers; a column with sets is not."""
    n = 3000
    x, mu = data(n, 1)
    x = np.column_stack((x, np.where(np.arange(n) % 5, 0.1 * np.abs(x[:, 0]), -2.0)))  # few windows, far below
    base = fit(x, mu, SETS, 18, np.ones(n), np.arange(n), np.full(n, COVERS), np.array([0.0] * 4))
    assert base.low[3] == 0.0
    assert (base.low[:3] < -0.9).all()
    at_0, below = x.copy(), x.copy()
    at_0[:, 3], below[:, 3] = 0.0, -2.0
    np.testing.assert_array_equal(base.mu_pct(below), base.mu_pct(at_0))
    np.testing.assert_array_equal(base.spread(below), base.spread(at_0))


def test_packaged_designs_bounds_are_those_of_the_fit() -> None:
    assert (load_design(LONE_DESIGN).low >= LOWEST).all()


def test_few_rules_are_those_that_speak_for_most() -> None:
    base = fitted(rules=6)
    x, _ = data(1000, 4)
    _, firing = base.shares(x)
    assert len(base.rules) == 6
    assert (firing > 0.05).mean() > 0.9


def test_spreads_come_from_conditions_that_the_fit_has_not_seen() -> None:
    """Of few conditions the fit knows every one by heart: halved by windows, their errors would seem small."""
    x, mu = data(12, 5, 0.3)
    condition = np.repeat(np.arange(12), 60)
    windows = x[condition] + 0.02 * np.random.default_rng(5).standard_normal((720, 3))
    by_condition, by_window = (
        fit(windows, mu[condition], SETS, 18, np.ones(720), group, np.full(720, COVERS)).spread(windows)
        for group in (condition, np.arange(720))
    )
    assert np.median(by_condition) > 3 * np.median(by_window)


def test_the_polynomial_is_the_outputs_meaning_and_falls_throughout() -> None:
    n = np.linspace(0, 100, 501)
    mu = np.polyval(polynomial(), n)
    assert len(polynomial()) == 7
    assert mu == pytest.approx(adhesion_of(n), rel=0.003)
    assert np.all(np.diff(mu) < 0)


@pytest.mark.parametrize("model", range(4))
def test_noise_alone_leaves_the_residual_that_is_taken_off(model: int) -> None:
    design = load_design(LONE_DESIGN)
    speed = float(design.speeds_m_s[20])
    point = load_source(LONE_DESIGN).points[model]
    gains = steady_state(Wheelset(), point, speed, design.tick_s, (3e-4, 0.01))
    W = gains.whiten(point)
    assert design.noise_power[20, model] == pytest.approx(gains.noise_power(W, design.lowpass, (3e-4, 0.01)), rel=1e-4)
    # each sensor alone: what is left of its noise behind the bank and the low-pass is its column of the table
    rng = np.random.default_rng(1)
    Phi, K, H, whiten = (a[20, model] for a in (design.Phi, design.K, design.H, design.whiten))
    for channel, rms in enumerate(design.noise_rms):
        z = np.zeros((2500, 2, 40))
        z[:, channel] = rms * rng.standard_normal((2500, 40))
        x, w = np.zeros((design.states, 40)), np.empty(z.shape)
        for k, row in enumerate(z):
            w[k] = whiten @ (row - H @ x)
            x = closed_loop(Phi, K, H) @ x + Phi @ K @ row
        power = np.square(sosfilt(design.lowpass.copy(), w, axis=0)[500:]).mean(axis=(0, 2)).sum()
        assert power == pytest.approx(design.noise_power[20, model, channel], rel=0.1)


def test_fit_tells_how_far_it_is() -> None:
    x, mu = data(3000, 1)
    told: list[tuple[str, float]] = []
    fit(
        x, mu, SETS, 18, np.ones(len(x)), np.arange(len(x)), np.full(len(x), COVERS),
        progress=lambda what, share: told.append((what, share)),
    )  # fmt: skip
    shares = [share for _, share in told]
    assert {what for what, _ in told} == {"rule base"}
    assert len(shares) > 5
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
