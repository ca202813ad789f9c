"""The posterior over what may be wrong with a pair of sensors: its recursion, by a model that is made up here.

That the packaged designs find what they should is for test_sound_sensors.py and `sim-ecu score`.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.support.c_parts import Pairs
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.stepped import health_figures, log_odds, pair_states
from wrcd.core.design import FloatArray, HealthModel, load_design
from wrcd.core.estimator import evidence
from wrcd.core.terms import CERTAIN, COLUMNS, PAIR_FEATURES, PAIR_OWN, SPAN_TICKS, PairState

NOISE = np.array([3e-4, 0.01])
STATES = len(PairState)
CORRELATION = 6  # the newest span's, below 1.5 Hz: after six powers


def model(kept: float = 0.9, hazard: float = 0.0) -> HealthModel:
    """Two signals against each other speak for a reversed one, as much as those with each other against it."""
    hidden, out = np.zeros((PAIR_FEATURES, 1)), np.zeros((1, STATES))
    hidden[CORRELATION], out[0, PairState.REVERSED] = 1.0, -2.0
    prior = np.full(STATES, 1e-3)
    prior[PairState.SOUND] = 1.0 - 7e-3
    return HealthModel(
        middle=np.zeros(PAIR_FEATURES), scale=np.ones(PAIR_FEATURES), hidden=hidden, hidden_bias=np.zeros(1), out=out,
        out_bias=np.zeros(STATES), temper=np.ones(STATES), log_prior=np.log(prior / prior[0]), kept=kept, hazard=hazard,
    )  # fmt: skip


def signals(ticks: int, sign: float, seed: int = 1) -> FloatArray:
    """(ticks, 2, 1): a slow signal in both, with or against each other."""
    slow = np.cumsum(np.random.default_rng(seed).standard_normal(ticks))
    slow -= np.linspace(slow[0], slow[-1], ticks)
    noise = np.random.default_rng(seed + 1).standard_normal((ticks, 2, 1))
    return np.asarray(NOISE[:, None] * (noise + slow[:, None, None] * np.array([[1.0], [sign]])))


def looked(pairs: Pairs, z: FloatArray, used: list[bool]) -> Pairs:
    n = z.shape[2]
    for k, row in enumerate(z, 1):
        pairs.step(row, used)
        if k % SPAN_TICKS == 0:
            pairs.look(20.0, np.full(n, 0.05), np.zeros((n, COLUMNS)))
    return pairs


def pairs_of(axles: int, health: HealthModel) -> Pairs:
    return Pairs(axles, replace(load_design(LONE_DESIGN), noise_rms=NOISE, health=health))


def one(health: HealthModel | None = None) -> Pairs:
    return pairs_of(1, model() if health is None else health)


def odds(pairs: Pairs) -> FloatArray:
    return np.asarray(log_odds(pairs.estimator)[0])


def state(pairs: Pairs) -> PairState:
    return PairState(pair_states(pairs.estimator)[0])


def test_pair_is_what_leads_when_it_is_not_more_likely_sound() -> None:
    assert state(one()) is PairState.SOUND
    assert state(looked(one(), signals(2400, 1.0), [True])) is PairState.SOUND
    wrong = looked(one(), signals(2400, -1.0), [True])
    assert state(wrong) is PairState.REVERSED
    f = health_figures(wrong.estimator, 0)
    assert (f.state, f.low < -0.9, f.probability > 0.5, f.sound < 0.5) == (PairState.REVERSED, True, True, True)
    assert f.yaw_rms > 2.0


def test_without_evidence_the_odds_go_back_to_the_prior_and_no_further() -> None:
    m = replace(model(kept=0.9), temper=np.zeros(STATES))
    pairs = one(m)
    begin = np.r_[0.0, np.full(7, 5.0)]
    pairs.state["log_odds"] = begin
    looked(pairs, signals(10 * SPAN_TICKS, -1.0), [True])
    np.testing.assert_allclose(odds(pairs), m.log_prior + 0.9**10 * (begin - m.log_prior))


def test_no_evidence_makes_a_state_so_certain_that_it_never_ends() -> None:
    m = replace(model(kept=1.0), temper=np.full(STATES, 50.0))
    assert odds(looked(one(m), signals(100 * SPAN_TICKS, -1.0), [True]))[PairState.REVERSED] == CERTAIN


def test_hazard_lets_a_state_begin_that_was_ruled_out() -> None:
    after = []
    for hazard in (1e-3, 0.0):
        pairs = one(replace(model(1.0, hazard), temper=np.zeros(STATES)))
        pairs.state["log_odds"] = np.r_[0.0, np.full(7, -CERTAIN)]
        after.append(odds(looked(pairs, signals(SPAN_TICKS, 1.0), [True]))[1])
    assert after[0] > after[1] + 0.5


def test_evidence_is_relative_to_a_sound_pair() -> None:
    m = replace(model(), out_bias=np.arange(STATES, dtype=float) + 3.0)
    assert evidence(m, np.zeros((2, PAIR_FEATURES))).tolist() == [list(range(STATES))] * 2


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_evidence_is_a_networks_whatever_precision_it_was_fitted_in(precision: type[np.floating[Any]]) -> None:
    """scikit-learn's of features in single precision is in single precision."""
    rng, f, h = np.random.default_rng(1), PAIR_FEATURES, 5
    given = (rng.standard_normal(shape).astype(precision) for shape in ((f, h), (h,), (h, STATES)))
    hidden, bias, out = (np.asarray(0.3 * of) for of in given)
    m = replace(model(), hidden=hidden, hidden_bias=bias, out=out)
    x = rng.standard_normal((20, f))
    says = np.tanh(np.clip(x, -5.0, 5.0) @ m.hidden.astype(np.float64) + bias) @ out.astype(np.float64)
    assert evidence(m, x) == pytest.approx(says - says[:, :1], abs=1e-9)


def test_what_was_found_stays_while_there_is_no_data() -> None:
    wrong = looked(one(), signals(2400, -1.0), [True])
    before = odds(wrong).copy()
    wrong.reset(0)
    looked(wrong, np.full((480, 2, 1), np.nan), [False])
    np.testing.assert_array_equal(odds(wrong), before)
    few = signals(SPAN_TICKS, -1.0)
    for k, row in enumerate(few):
        wrong.step(row, [k < SPAN_TICKS // 3])
    wrong.look(20.0, np.array([0.05]), np.zeros((1, COLUMNS)))
    np.testing.assert_array_equal(odds(wrong), before)


@pytest.mark.parametrize("case", ["sound", "swapped", "doubted", "silent", "none"])
def test_partner_counts_that_has_data_and_is_not_doubted(case: str) -> None:
    z = np.concatenate([signals(960, 1.0)] * (1 if case == "none" else 2), axis=2)
    n = z.shape[2]
    pairs = pairs_of(n, replace(model(kept=1.0), temper=np.zeros(STATES)))
    if case == "doubted":
        pairs.state["log_odds"][1, PairState.LATE] = CERTAIN
    if case == "swapped":  # both are accused, and what speaks for it is in the other's signals
        pairs.state["log_odds"][1, PairState.OTHER_AXLE] = CERTAIN
    looked(pairs, z, [True, case != "silent"][:n])
    features = pairs.estimator.features()[0]
    of_partner, now = features[2 * PAIR_OWN :][:24], features[-6:]  # of the shorter mean, after its own; of the longer
    assert of_partner.any() == now.any() == (case in ("sound", "swapped"))
    assert features[-12:-6].any()  # own signals a wheelbase apart need none


def test_sums_that_are_no_numbers_move_no_odds() -> None:
    pairs = one()
    pairs.state["pair_mean"][0, 0] = np.nan
    before = odds(pairs).copy()
    np.testing.assert_array_equal(odds(looked(pairs, signals(960, -1.0), [True])), before)
