"""How a design learns to judge pairs of sensors, on small made-up data; what it then finds is for the score."""

from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.pairs import (
    ACCUSED,
    BROKEN,
    COVERS,
    INTERVAL_SPEEDS,
    LEAST,
    MARGINS,
    PARTNERS,
    WIDER,
    WIDER_COASTING,
    FloatArray,
    Lane,
    Watched,
    _broken,
    _lanes,
    fit,
    intervals,
    tempers,
)
from sim_ecu.design.recordings import Recording
from sim_ecu.jobs.pool import Workers
from wrcd.core.design import Design, HealthModel, load_design
from wrcd.core.terms import CERTAIN, PAIR_FEATURES, SPAN_TICKS, PairState, Regime
from wrcd.resources import DESIGN

TICKS, CONDITIONS = 40 * SPAN_TICKS, 4  # two wheelsets of each
RNG = np.random.default_rng(3)
SIGNALS = RNG.standard_normal((TICKS, 2, 2 * CONDITIONS))
NOISE = 1e-3 * RNG.standard_normal(SIGNALS.shape)


@pytest.mark.parametrize("name", BROKEN)
def test_each_kind_of_broken_pair_is_what_its_name_says(name: str) -> None:
    begins = TICKS // 2 if "die" in name else 0
    broken, sound = _broken(name, SIGNALS, NOISE, 2, begins, 5, 0.005), SIGNALS[:, :, 2]
    np.testing.assert_array_equal(broken[:begins], sound[:begins])
    yaw, lat = (np.array_equal(broken[begins:, c], sound[begins:, c]) for c in (0, 1))
    gyro_loud, accel_loud = (np.std(broken[begins:, c]) > 0.05 for c in (0, 1))
    state = BROKEN[name]
    assert gyro_loud == (state not in (PairState.GYRO_DEAD, PairState.BOTH_DEAD))
    assert accel_loud == (state not in (PairState.ACCEL_DEAD, PairState.BOTH_DEAD))
    if state in (PairState.REVERSED, PairState.GYRO_DEAD):
        assert (yaw, lat) == (False, True)
    if state in (PairState.OTHER_AXLE, PairState.ACCEL_DEAD):
        assert (yaw, lat) == (True, False)
    if state is PairState.WRONG_UNIT:
        assert (yaw, lat) == (name != "in degrees", name == "in degrees")
    if name == "other axle":
        np.testing.assert_array_equal(broken[:, 1], SIGNALS[:, 1, 3])
    if name == "late":
        assert (yaw, lat) in ((True, False), (False, True))


def made() -> list[Lane]:
    design: Design = load_design(DESIGN)
    z, n = SIGNALS.astype(np.float32), 2 * CONDITIONS
    torque, mu = np.zeros((TICKS, n), np.float32), np.full((TICKS, n), 20.0, np.float32)
    r = Recording(z, z, torque, np.full(TICKS, 20.0), mu, np.zeros(n, np.int64), np.ones(n, bool), own_world=True)
    return _lanes(design, r, SIGNALS, NOISE, [False] * n, np.random.default_rng(1))


def test_what_a_pair_is_in_is_said_for_every_tick_and_not_while_it_breaks() -> None:
    lanes = made()
    assert {lane.partner for lane in lanes} == set(range(len(PARTNERS)))
    for lane in lanes:
        turns = np.flatnonzero(np.diff(lane.state)) + 1
        states = lane.state[[0, *turns]].tolist()
        if len(states) > 1:  # it dies on the way
            assert states == [PairState.SOUND, -1, states[-1]]
            assert states[-1] > PairState.SOUND
            assert turns[1] - turns[0] == 2 * SPAN_TICKS
            quiet = lane.z[turns[0] :, :, 0].std(axis=0) < 0.05
            assert quiet.any()
            assert not (lane.z[: turns[0], :, 0].std(axis=0) < 0.05).any()


def watched(x: FloatArray, state: FloatArray, seed: int = 0) -> Watched:
    rng, lanes = np.random.default_rng(seed), x.shape[1]
    return Watched(
        x.astype(np.float16), state.astype(np.int8), (np.arange(lanes) % len(PARTNERS)).astype(np.int8),
        np.zeros(lanes, bool),
        rng.exponential(1.0, 40_000).astype(np.float32), np.full(40_000, Regime.STEADY, np.int8),
        rng.uniform(5.0, 50.0, 40_000).astype(np.float32),
    )  # fmt: skip


def test_factor_makes_the_interval_hold_as_much_as_it_shall_and_unseen_regimes_are_wider_than_the_rules_own() -> None:
    part = watched(np.zeros((2, 4, PAIR_FEATURES)), np.zeros((2, 4)))
    found = intervals([part])["factors"]
    np.testing.assert_allclose(found[Regime.STEADY], -WIDER * np.log(1.0 - COVERS), rtol=0.06)
    np.testing.assert_array_equal(found[Regime.COASTING], np.full(len(INTERVAL_SPEEDS), WIDER_COASTING))
    narrow = intervals([replace(part, off=0.01 * part.off)])["factors"]
    np.testing.assert_array_equal(narrow[Regime.STEADY], np.full(len(INTERVAL_SPEEDS), WIDER * LEAST))


def pairs(spans: int, lanes: int, seed: int) -> Watched:
    """Half of them reversed, which one feature shows; in every twentieth span it shows it of sound ones."""
    rng = np.random.default_rng(seed)
    kinds = np.where(np.arange(lanes) < lanes // 2, PairState.SOUND, PairState.REVERSED)
    state = np.broadcast_to(kinds, (spans, lanes))
    x = 0.1 * rng.standard_normal((spans, lanes, PAIR_FEATURES))
    x[:, :, 0] += np.where((state == PairState.REVERSED) | (rng.random(state.shape) < 0.05), 1.0, -1.0)
    return watched(x, state, seed)


def test_network_tells_the_states_apart_and_one_that_never_came_is_not_found() -> None:
    model = fit([pairs(40, 32, seed) for seed in range(6)])
    assert model["temper"][PairState.REVERSED] > 0.0
    assert model["out_bias"][PairState.LATE] == -CERTAIN
    assert model["prior"].sum() == pytest.approx(1.0)


@pytest.mark.usefixtures("jobs_here")
def test_networks_that_are_fitted_side_by_side_are_the_same() -> None:
    parts = [pairs(20, 16, seed) for seed in range(4)]
    told: list[float] = []
    one = fit(parts, lambda _what, share: told.append(share))
    for name, found in fit(parts, workers=Workers(None)).items():
        np.testing.assert_array_equal(found, one[name])
    assert told == [0.2, 0.4, 0.6, 0.8, 1.0]


def test_evidence_counts_as_far_as_sound_pairs_stay_unaccused() -> None:
    hidden, out = np.zeros((PAIR_FEATURES, 1)), np.zeros((1, len(PairState)))
    hidden[0], out[0, PairState.REVERSED] = 1.0, 4.0
    s = len(PairState)
    prior = np.r_[0.0, np.full(s - 1, np.log(1e-4))]
    middle, scale = np.zeros(PAIR_FEATURES), np.ones(PAIR_FEATURES)
    model = HealthModel(middle, scale, hidden, np.zeros(1), out, np.zeros(s), np.zeros(s), prior, 0.97, 1e-6)
    x = -np.ones((100, 400, PAIR_FEATURES))
    honest = tempers([(model, [watched(x, np.zeros((100, 400)))])])[PairState.REVERSED]
    x[:, : len(PARTNERS), 0] = 1.0  # of one sound pair with each partner it says that it is reversed: of few, bad luck
    assert tempers([(model, [watched(x, np.zeros((100, 400)))])])[PairState.REVERSED] == honest
    x[:, : max(2 * len(PARTNERS), round(10 * ACCUSED * 400)), 0] = 1.0
    misled = tempers([(model, [watched(x, np.zeros((100, 400)))])])[PairState.REVERSED]
    assert 0.0 <= misled < honest
    out[0, PairState.ACCEL_DEAD] = 4.0  # alike, and of it less counts
    both = tempers([(model, [watched(-np.ones((100, 400, PAIR_FEATURES)), np.zeros((100, 400)))])])
    assert both[PairState.ACCEL_DEAD] == pytest.approx(MARGINS[PairState.ACCEL_DEAD] * both[PairState.REVERSED])
