"""The posterior over what may be wrong with a pair of sensors: its recursion, by a model that is made up here.

That the packaged designs find what they should is for tests/unit/core/test_sound_sensors.py and `sim-ecu score`.
"""

from dataclasses import replace

import numpy as np
import pytest

from wrcd.estimator.design import CERTAIN, COLUMNS, PAIR_FEATURES, PAIR_STATES, FloatArray, HealthModel
from wrcd.estimator.trust.health import FEATURES, SPAN_TICKS, SPANS, PairHealth, PairState, evidence, updated

TICK_S = 0.005
NOISE = np.array([3e-4, 0.01])
STATES = len(PairState)
CORRELATION = 6  # the newest span's, below 1.5 Hz: after six powers


def model(kept: float = 0.9, hazard: float = 0.0) -> HealthModel:
    """Two signals against each other speak for a reversed one, as much as those with each other against it."""
    hidden, out = np.zeros((FEATURES, 1)), np.zeros((1, STATES))
    hidden[CORRELATION], out[0, PairState.REVERSED] = 1.0, -2.0
    prior = np.full(STATES, 1e-3)
    prior[PairState.SOUND] = 1.0 - 7e-3
    return HealthModel(
        middle=np.zeros(FEATURES), scale=np.ones(FEATURES), hidden=hidden, hidden_bias=np.zeros(1), out=out,
        out_bias=np.zeros(STATES), temper=np.ones(STATES), log_prior=np.log(prior / prior[0]), kept=kept, hazard=hazard,
    )  # fmt: skip


def signals(ticks: int, sign: float, seed: int = 1) -> FloatArray:
    """(ticks, 2, 1): a slow signal in both, with or against each other."""
    slow = np.cumsum(np.random.default_rng(seed).standard_normal(ticks))
    slow -= np.linspace(slow[0], slow[-1], ticks)
    noise = np.random.default_rng(seed + 1).standard_normal((ticks, 2, 1))
    return np.asarray(NOISE[:, None] * (noise + slow[:, None, None] * np.array([[1.0], [sign]])))


def looked(health: PairHealth, z: FloatArray, used: list[bool]) -> PairHealth:
    n = z.shape[2]
    for k, row in enumerate(z, 1):
        health.pairs.step(row, np.array(used))
        if k % SPAN_TICKS == 0:
            health.look(20.0, np.full(n, 0.05), np.zeros((n, COLUMNS)))
    return health


def one() -> PairHealth:
    return PairHealth(model(), NOISE, TICK_S, 1, 2.5)


def test_pair_is_what_leads_when_it_is_not_more_likely_sound() -> None:
    assert one().state.tolist() == [PairState.SOUND]
    assert looked(one(), signals(2400, 1.0), [True]).state.tolist() == [PairState.SOUND]
    wrong = looked(one(), signals(2400, -1.0), [True])
    assert wrong.state.tolist() == [PairState.REVERSED]
    f = wrong.figures(0)
    assert (f.state, f.low < -0.9, f.probability > 0.5, f.sound < 0.5) == (PairState.REVERSED, True, True, True)
    assert f.yaw_rms > 2.0


def test_without_evidence_the_odds_go_back_to_the_prior_and_no_further() -> None:
    m = model(kept=0.9)
    odds = np.full((1, STATES), 5.0)
    odds[0, PairState.SOUND] = 0.0
    for _ in range(10):
        odds = updated(m, odds, np.zeros((1, FEATURES)))
    expected = m.log_prior + 0.9**10 * (np.r_[0.0, np.full(7, 5.0)] - m.log_prior)
    np.testing.assert_allclose(odds[0], expected)


def test_no_evidence_makes_a_state_so_certain_that_it_never_ends() -> None:
    m = replace(model(kept=1.0), temper=np.full(STATES, 50.0))
    x = np.zeros((1, FEATURES))
    x[0, CORRELATION] = -1.0
    odds = m.log_prior[None]
    for _ in range(100):
        odds = updated(m, odds, x)
    assert odds[0, PairState.REVERSED] == CERTAIN


def test_hazard_lets_a_state_begin_that_was_ruled_out() -> None:
    x = np.zeros((1, FEATURES))
    odds = np.r_[0.0, np.full(7, -CERTAIN)][None]
    assert updated(model(1.0, 1e-3), odds, x)[0, 1] > updated(model(1.0, 0.0), odds, x)[0, 1] + 0.5


def test_evidence_is_relative_to_a_sound_pair() -> None:
    m = replace(model(), out_bias=np.arange(STATES, dtype=float) + 3.0)
    assert evidence(m, np.zeros((1, FEATURES)))[0].tolist() == list(range(STATES))


def test_what_was_found_stays_while_there_is_no_data() -> None:
    wrong = looked(one(), signals(2400, -1.0), [True])
    before = wrong.log_odds.copy()
    wrong.reset(0)
    looked(wrong, np.full((480, 2, 1), np.nan), [False])
    np.testing.assert_array_equal(wrong.log_odds, before)
    few = signals(SPAN_TICKS, -1.0)
    for k, row in enumerate(few):
        wrong.pairs.step(row, np.array([k < SPAN_TICKS // 3]))
    wrong.look(20.0, np.array([0.05]), np.zeros((1, COLUMNS)))
    np.testing.assert_array_equal(wrong.log_odds, before)


@pytest.mark.parametrize("case", ["sound", "doubted", "silent", "none"])
def test_partner_counts_that_has_data_and_is_not_doubted(case: str) -> None:
    z = np.concatenate([signals(960, 1.0)] * (1 if case == "none" else 2), axis=2)
    n = z.shape[2]
    health = PairHealth(replace(model(kept=1.0), temper=np.zeros(STATES)), NOISE, TICK_S, n, 2.5)
    if case == "doubted":
        health.log_odds[1, PairState.LATE] = CERTAIN
    looked(health, z, [True, case != "silent"][:n])
    of_partner = health._mean(SPANS[-1])[13:37, 0]
    assert of_partner.any() == (case == "sound")


def test_model_is_of_as_many_features_and_states_as_the_design_is_read_for() -> None:
    assert (PAIR_FEATURES, len(PAIR_STATES)) == (FEATURES, STATES)
    assert PairState.GYRO_DEAD.words == "the gyro dead"
    assert PairState.LATE.words == "one later than it says"


def test_sums_that_are_no_numbers_move_no_odds() -> None:
    health = one()
    health.pairs._mean[0, 0] = np.nan
    before = health.log_odds.copy()
    np.testing.assert_array_equal(looked(health, signals(960, -1.0), [True]).log_odds, before)


def test_without_a_model_no_pair_is_doubted() -> None:
    assert looked(PairHealth(None, NOISE, TICK_S, 1, 2.5), signals(960, -1.0), [True]).state.tolist() == [
        PairState.SOUND
    ]
