"""The innovation gate: what it calls an outlier, and when it asks for a reset."""

import numpy as np

from tests.support.c_parts import Gate
from wrcd.core.terms import MAX_JUMP

GATE_SIGMA, MAX_NET_OUTLIERS = np.array([[4.5], [12.0]]), np.array([[2.0], [8.0]])  # yaw rate, lateral acceleration
MIN_TICKS, COMPARED_TICKS = 20, 3

STILL = np.zeros(2)  # yaw rates


def test_gate_limit_is_gate_sigma_times_the_rms() -> None:
    gate = Gate(1)
    e, there, none = np.ones((4, 2, 1)), np.ones(1, dtype=bool), np.zeros((2, 1), dtype=bool)
    for k in range(MIN_TICKS):
        gate.learn((1 + 2 * (k % 2)) * e, STILL[:1], there, none)  # 1 and 3: a mean square of 5
    usual = 5**0.5
    assert not gate.outliers(0.999 * GATE_SIGMA * usual * e, STILL[:1], there).any()
    assert gate.outliers(1.001 * GATE_SIGMA * usual * e, STILL[:1], there).all()


def test_non_finite_innovation_is_an_outlier_from_the_first_tick() -> None:
    gate = Gate(1)
    e = np.ones((4, 2, 1))
    e[2, 1, 0] = np.inf
    assert (gate.outliers(e, STILL[:1], np.ones(1, dtype=bool))[:, 0] == [False, True]).all()
    e[2, 1, 0] = 1e200
    with np.errstate(all="raise"):
        gate.outliers(e, STILL[:1], np.ones(1, dtype=bool))


def test_yaw_rate_jump_is_an_outlier_until_it_is_old() -> None:
    gate, e, there = Gate(1), np.ones((4, 2, 1)), np.ones(1, dtype=bool)
    none, jump = np.zeros((2, 1), dtype=bool), np.array([1.01 * MAX_JUMP])
    gate.learn(e, STILL[:1], there, none)
    assert not gate.outliers(e, 0.98 * jump, there).any()
    for _ in range(COMPARED_TICKS):
        absurd = gate.outliers(e, jump, there)
        assert (absurd[:, 0] == [True, False]).all()
        upset = gate.learn(e, jump, ~there, absurd)
    assert upset[0]
    assert not gate.outliers(e, jump, there).any()


def test_gate_reset_affects_one_axle_only() -> None:
    gate = Gate(2)
    e, there = np.ones((4, 2, 2)), np.ones(2, dtype=bool)
    for _ in range(MIN_TICKS):
        gate.learn(e, STILL, there, gate.outliers(e, STILL, there))
    assert gate.outliers(100 * e, STILL, there).all()
    gate.reset(0)
    assert (gate.outliers(100 * e, STILL, there) == [[False, True], [False, True]]).all()
    # for as many ticks as at first, and with as many absurd ones before it is upset
    quiet = 1e-3 * e
    for k in range(MIN_TICKS):
        assert not gate.outliers(0.5 * e, STILL, there)[:, 0].any(), k
        gate.learn(quiet, STILL, there, np.zeros((2, 2), dtype=bool))
    assert gate.outliers(0.5 * e, STILL, there)[:, 0].all()
    nobody = np.zeros(2, dtype=bool)
    for channel, most in enumerate(MAX_NET_OUTLIERS[:, 0].astype(int).tolist()):
        one = np.arange(2)[:, None] == np.full(2, channel)
        upset = [bool(gate.learn(e, STILL, nobody, one)[0]) for _ in range(most + 1)]
        assert upset == [False] * most + [True]
        gate.learn(e, STILL, ~nobody, ~one & False)
