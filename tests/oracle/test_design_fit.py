"""The core's look at a bogie (bogie.c, calm.c, likelihood.c, fit.c) against the model and the fit in numpy."""

import numpy as np
import pytest

from tests.support.bogie_signals import MEMBERS, OWN, TICK_S, Bogie, changed_in_c, response_in_c, ride
from wrcd.core.design import FloatArray
from wrcd.fit.bogie import PRIOR_SIGMA, BogieConstants, response
from wrcd.fit.stretches import Blocks, blocks_of
from wrcd.fit.whittle import UNKNOWNS, BogieFit, Guess

CONSTANTS = np.array(MEMBERS["constants"])
INCOHERENCE = UNKNOWNS.index("incoherence")  # of all blocks in numpy, of each in C
BINS = MEMBERS["first_bin"] + MEMBERS["bins_apart"] * np.arange(26)
BEGIN, STRETCHES = 512, 14  # of the first stretch that has a leading signal of a wheelbase before; of a whole block
FRAME = 1.0 / (1024 * TICK_S)


def of(c: BogieConstants) -> FloatArray:
    return np.array([getattr(c, name) for name in c.__slots__])


def other(k: int) -> dict[str, float]:
    """Logs of all constants that a fit may move, of some vehicle."""
    drawn = np.random.default_rng(k).normal(size=len(PRIOR_SIGMA))
    return {name: float(x) for name, x in zip(PRIOR_SIGMA, 0.7 * drawn, strict=True)}


@pytest.mark.parametrize("vehicle", range(4))
def test_response_is_numpys(vehicle: int) -> None:
    logs = other(vehicle) if vehicle else {}
    c = OWN.changed(logs)
    constants = changed_in_c(CONSTANTS, dict(enumerate(logs.values())))
    np.testing.assert_allclose(constants, of(c), rtol=1e-14)
    for speed, g11, g22 in ((8.5, 4e6, 5e6), (25.0, 3e6, 3.7e6), (60.0, 1e5, 9e6)):
        for later in (0.0, OWN.wheelbase_m / speed, 0.0137):
            for f in (0.05, 1.0, 4.3, 16.0, 60.0):
                ours, theirs = (
                    response_in_c(constants, (speed, g11, g22, later), f),
                    response(c, speed, g11, g22, f, later),
                )
                np.testing.assert_allclose(ours, theirs[0], rtol=1e-9, err_msg=f"{speed} m/s, {f} Hz")


@pytest.fixture(scope="module", params=[25.0, 20.0])
def block(request: pytest.FixtureRequest) -> Bogie:
    """A bogie after its first whole block, at a speed at which a wheelbase is so many ticks."""
    v = request.param
    whole = ride(speeds_m_s=(v,), seconds=60.0)
    return Bogie().run(whole.part(0, BEGIN + 512 * (STRETCHES + 1) + 400))


def blocks(b: Bogie) -> Blocks:
    return Blocks(
        b.cross[None], np.array([b.of("of_speed_m_s")]), np.array([b.of("of_stretches")]), BINS * FRAME, TICK_S
    )


def test_spectra_of_a_block_are_numpys(block: Bogie) -> None:
    """But for a mean and a slope, which numpy takes out: of a Hann window's bins from the sixth on they are little."""
    v = float(block.of("of_speed_m_s"))
    late = round(OWN.wheelbase_m / v / TICK_S)
    whole = ride(speeds_m_s=(v,), seconds=60.0)
    found, _ = blocks_of([whole.part(BEGIN - late).signals], OWN.wheelbase_m)
    theirs = found.every(MEMBERS["bins_apart"])
    assert (block.of("of_stretches"), theirs.stretches[0]) == (STRETCHES, STRETCHES)
    np.testing.assert_allclose(theirs.frequency_hz, BINS * FRAME)
    power = np.sqrt(np.einsum("fii->fi", theirs.cross[0]).real)
    error = np.abs(block.cross - theirs.cross[0]) / (power[:, :, None] * power[:, None, :])
    assert error.max() < 5e-4


@pytest.mark.parametrize("speed_m_s", [23.0, 22.5])
def test_spectra_are_numpys_where_a_wheelbase_lies_between_two_ticks(speed_m_s: float) -> None:
    """numpy reads between ticks by cubics, C turns the spectra, and windows begin a quarter of a tick apart:
    without that turn a tenth is wrong at 16 Hz."""
    whole = ride(speeds_m_s=(speed_m_s,), seconds=60.0)
    b = Bogie().run(whole.part(0, BEGIN + 512 * (STRETCHES + 1) + 400))
    found, _ = blocks_of([whole.part(BEGIN - round(OWN.wheelbase_m / speed_m_s / TICK_S)).signals], OWN.wheelbase_m)
    theirs = found.every(MEMBERS["bins_apart"]).cross[0]
    power = np.sqrt(np.einsum("fii->fi", theirs).real)
    assert (np.abs(b.cross - theirs) / (power[:, :, None] * power[:, None, :])).max() < 0.005


def at_its_best(b: Bogie) -> tuple[FloatArray, FloatArray]:
    """numpy's Fisher matrix and gradient where C has looked last, of what C has in its sum."""
    fit = BogieFit(blocks(b), OWN)
    of_block = b.of("of_block")
    unknowns = np.append(b.of("at"), of_block[2])
    fit._expected = b.of("expected").reshape(1, -1, 2)
    guess = Guess(unknowns, of_block[None, :2], b.of("powers").reshape(1, -1, 2))
    scores = fit._scores(fit._judged(guess))
    prior = 1 / fit.sigma**2
    prior[INCOHERENCE] = 0.0  # is the block's
    F, g = scores.fisher - np.diag(prior), scores.gradient + unknowns * prior
    taken = F[:-1, -1] / F[-1, -1]
    return F[:-1, :-1] - np.outer(taken, F[-1, :-1]), g[:-1] - taken * g[-1]


def test_what_a_block_adds_is_numpys_fisher_matrix_and_gradient(block: Bogie) -> None:
    F, g = at_its_best(block)
    scale = np.sqrt(np.diag(F))
    assert (block.of("pass"), block.of("weight")) == (0, STRETCHES)
    np.testing.assert_allclose(block.information / np.outer(scale, scale), F / np.outer(scale, scale), atol=5e-5)
    np.testing.assert_allclose((block.of("score") - F @ block.of("at")) / scale, g / scale, atol=1e-4)


def test_block_is_looked_at_where_it_is_likeliest(block: Bogie) -> None:
    """Steps end where they are a thirtieth of a log."""
    held = dict.fromkeys(UNKNOWNS[:INCOHERENCE], 1e-6)
    theirs = BogieFit(blocks(block), OWN, held)
    theirs.run()
    ours = block.of("of_block")
    best = np.append(theirs.best.guess.slopes[0], theirs.logs["incoherence"])
    np.testing.assert_allclose(ours, best, atol=0.03)


def test_ratio_and_the_two_answers_are_those_of_the_sum(block: Bogie) -> None:
    S, score = block.information, block.of("score")
    answers = {of: np.linalg.solve(S + np.diag(1 / np.square(MEMBERS[f"{of}_sigma"])), score) for of in ("own", "free")}
    np.testing.assert_allclose(block.of("free"), answers["free"], rtol=1e-6, atol=1e-9)
    assert block.of("ratio") == pytest.approx(float((answers["free"] - answers["own"]) @ score), rel=1e-6)
    assert block.of("bias_pp") == pytest.approx(float(answers["free"] @ MEMBERS["bias"]), rel=1e-6)
    variance = np.linalg.inv(S + np.diag(1 / np.square(MEMBERS["free_sigma"])))
    assert block.of("bias_sigma_pp") ** 2 == pytest.approx(
        np.asarray(MEMBERS["bias"]) @ variance @ MEMBERS["bias"], rel=1e-6
    )


def test_sum_of_many_blocks_finds_what_the_fit_finds() -> None:
    """One look at each block, against climbing on all of them: alike within what either knows."""
    true = {"primary_yaw_N_m_rad": float(np.log(2.0)), "gamma": 0.2}
    whole = ride(OWN.changed(true), (25.0, 12.5), seconds=82.0)
    ours = Bogie().run(whole)
    found, _ = blocks_of([whole.signals], OWN.wheelbase_m)
    theirs = BogieFit(found.every(MEMBERS["bins_apart"]), OWN)
    theirs.run(steps=20)
    sigma = np.sqrt(np.diag(np.linalg.inv(ours.information + np.diag(1 / np.square(MEMBERS["free_sigma"])))))
    for name in ("primary_yaw_N_m_rad", "gamma", "secondary_yaw_damping_N_m_s_rad"):
        k = UNKNOWNS.index(name)
        assert ours.of("free")[k] == pytest.approx(theirs.logs[name], abs=1.5 * sigma[k]), name
        assert ours.of("free")[k] == pytest.approx(true.get(name, 0.0), abs=2.5 * sigma[k]), name
