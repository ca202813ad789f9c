"""The estimator over ticks: what it says, what it doubts, and that nothing else moves it."""

from dataclasses import fields, replace

import numpy as np
import pytest

from tests.support.estimator_runs import EVERY, PER_S, RATIO, estimates, tick, track
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.stepped import SteppedEstimator, pair_states, tick_of
from wrcd.core.design import Design, FloatArray, load_design
from wrcd.core.estimator import step_through
from wrcd.core.records import Estimate, Ticks
from wrcd.core.terms import MAX_AXLES, MODELS, EstimateDoubt, PairState

HOLD_TICKS = 4  # that innovations wait


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(LONE_DESIGN)


@pytest.fixture(scope="module")
def sweep(design: Design) -> list[Estimate]:
    """Torque from nothing to much more than a slippery rail bears, its signals those of little, under rules that say
    half of what they should; one answer a time."""
    usual = replace(design, polynomial=0.5 * design.polynomial)
    z = track(24.0, curve="D", torque_Nm=1500.0)
    ratio = np.repeat(np.linspace(0.0, 0.25, 12), 2 * PER_S)
    return list(estimates(SteppedEstimator(usual, 1), z, ratio))[PER_S // EVERY :]


def test_more_in_use_than_is_said_widens_the_interval_down_to_it(sweep: list[Estimate]) -> None:
    """What has been in use for a moment counts; at a step up that is what was in use before it."""
    known = [e for e in sweep if np.isfinite(e.mu_available_pct[0])]
    more = [e for e in known if e.used_pct[0] > e.mu_from_rules_pct[0] + 0.1]
    assert len(more) > 20
    pinned = [e.mu_available_pct[0] == pytest.approx(e.used_pct[0]) for e in more]
    assert np.mean(pinned) > 0.75  # more than the newest part says counts after 0.4 s
    most = 0.0
    for e in known:
        most, said = max(most, float(e.used_pct[0])), float(e.mu_from_rules_pct[0])
        assert said - 1e-9 <= e.mu_available_pct[0] <= max(said, most) + 1e-9
        # the interval reaches down to what the rules say, wherever they are overruled; no factor makes it much narrower
        assert e.half_width_pp[0] >= 0.75 * (e.mu_available_pct[0] - said)


def test_a_contradiction_is_relative_to_the_adhesion(sweep: list[Estimate]) -> None:
    """Beyond a fifth of what is said: on a slippery rail two points more in use are much, on a dry one nothing."""
    said = np.array([e.mu_from_rules_pct[0] for e in sweep])
    used = np.array([e.used_pct[0] for e in sweep])
    contradicted = np.array([bool(e.contradicted[0]) for e in sweep])
    assert contradicted.any()
    assert np.all(used[contradicted] > 1.2 * said[contradicted] + 0.3)
    assert (used - said)[contradicted].min() < 6.0
    assert contradicted[used > 3.0 * said + 0.3].all()


def newest(e: SteppedEstimator, z: FloatArray, ratio: float = RATIO) -> Estimate:
    """The last estimate of a run."""
    for k, row in enumerate(z):
        e.step(tick(k, row, ratio))
    return e.estimate()


def test_a_track_is_not_doubted(design: Design) -> None:
    doubts = [int(e.doubt[0]) for e in estimates(SteppedEstimator(design, 1), track(12.0))][PER_S // EVERY :]
    assert np.mean(np.array(doubts) == EstimateDoubt.NONE) > 0.98


@pytest.mark.parametrize("factor", [0.7, 1.0, 1.5])
def test_sensors_that_give_their_noise_alone_are_found_dead(design: Design, factor: float) -> None:
    """Whatever their noise is: it is measured."""
    noise = np.random.default_rng(1).standard_normal((10 * PER_S, 2, MAX_AXLES))
    estimator = SteppedEstimator(design, MAX_AXLES)
    list(estimates(estimator, factor * design.noise_rms[:, None] * noise))
    assert np.mean(pair_states(estimator) == PairState.BOTH_DEAD) > 0.9


def elsewhere(design: Design, decades: float) -> Design:
    """One whose training had residuals so much larger: a track is further from what its rules are of."""
    further = np.r_[np.full(MODELS, decades), np.zeros(len(design.low) - MODELS)]
    return replace(design, low=design.low + further, high=design.high + further)


def test_residuals_unlike_training_widen_the_interval_then_are_doubted(design: Design) -> None:
    """The further, the wider over the adhesion."""
    z, width = track(4.0), []
    for decades in (0.5, 1.0, 3.0):
        strict, lenient = (replace(elsewhere(design, decades), beyond=b) for b in (0.01, 100.0))
        beyond = newest(SteppedEstimator(strict, 1), z).doubt[0] == EstimateDoubt.BEYOND_TRAINING
        assert beyond == (decades > 0.5)
        found = newest(SteppedEstimator(lenient, 1), z)
        assert found.doubt[0] in (EstimateDoubt.NONE, EstimateDoubt.SHORT)
        width.append(float((found.half_width_pp / found.mu_available_pct)[0]))
    assert 1.2 * width[0] < width[1] < width[2]


def test_without_a_rule_for_it_the_answer_is_unknown(design: Design) -> None:
    """Of all rules only those for the highest torque are left; the train coasts."""
    torque = design.rules[:, 4]
    kept = np.flatnonzero(torque == torque.max())
    names = ("rules", "bases", "slopes", "spreads", "spread_slopes", "typical_pct")
    fewer = replace(design, consequents=(), **{n: getattr(design, n)[kept] for n in names})
    found = newest(SteppedEstimator(fewer, 1), track(4.0), ratio=0.0)
    assert found.doubt[0] == EstimateDoubt.NO_RULE
    assert found.rule[0] == 0
    assert np.isnan(found.mu_available_pct[0])
    assert np.isnan(found.half_width_pp[0])


def test_estimate_with_many_pulses_is_doubted(design: Design) -> None:
    z = np.array(track(4.0))
    for k in range(PER_S, len(z), 20):  # a pulse every tenth of a second, of both signals
        z[k : k + 6, 1, 0] += 6.0 * np.sin(np.pi * (np.arange(min(6, len(z) - k)) + 0.5) / 3)
        z[k + 4 : k + 10, 0, 0] += 0.12
    found = newest(SteppedEstimator(design, 1), z)
    assert found.doubt[0] == EstimateDoubt.HARSH


@pytest.mark.parametrize(
    ("held", "doubt"),
    [(0.1, EstimateDoubt.GAPS), (0.36, EstimateDoubt.GAPS), (0.44, EstimateDoubt.NONE), (0.6, EstimateDoubt.NONE)],
)
def test_estimate_with_many_gaps_is_doubted(design: Design, held: float, doubt: EstimateDoubt) -> None:
    """Measurements in a share of every quarter of a second, on both sides of the limit of the window; also so few that
    there is no residual."""
    z = np.array(track(4.0))
    is_gap = np.arange(len(z)) % 50 >= held * 50
    z[PER_S:][is_gap[PER_S:]] = np.nan
    assert newest(SteppedEstimator(design, 1), z).doubt[0] == doubt


def test_gains_do_not_toggle_with_the_speeds_noise(design: Design) -> None:
    """Near an edge of the old steps of 0.1 m/s the innovations are those of a constant speed."""
    z = track(6.0)
    noise = np.repeat(0.005 * np.random.default_rng(2).standard_normal(len(z) // 4), 4)
    runs = []
    for more in (np.zeros(len(z)), noise):
        e, innovations = SteppedEstimator(design, 1), []
        for k, row in enumerate(z):
            innovations.append(e.step(tick(k, row, speed=29.15 + more[k])).innovations)
        runs.append((np.array(innovations)[PER_S:], e.estimate()))
    (constant, a), (noisy, b) = runs
    rms = np.sqrt(np.square(constant).mean(axis=0))
    assert np.all(np.sqrt(np.square(noisy - constant).mean(axis=0)) < 2e-3 * rms)
    assert b.mu_available_pct == pytest.approx(a.mu_available_pct, abs=0.1)


def test_lost_measurement_moves_the_estimate_by_little(design: Design) -> None:
    """At no moment of the seconds after it: the answer does not hop from one window to another."""
    z = track(12.0)
    lossy = np.array(z)
    lossy[3 * PER_S :: 3 * PER_S, 0] = np.nan
    runs = [list(estimates(SteppedEstimator(design, 1), x)) for x in (z, lossy)]
    mu, width = (
        np.array([[getattr(e, name)[0] for e in run] for run in runs])[:, PER_S // EVERY :]
        for name in ("mu_available_pct", "half_width_pp")
    )
    assert np.all(np.abs(mu[1] - mu[0]) < 0.4 * width[0])
    assert np.median(np.abs(mu[1] - mu[0])) < 0.05


def same(a: Estimate, i: int, b: Estimate, j: int, rel: float = 0.0) -> bool:
    """Whether axle i of one estimate is axle j of another, in every field."""
    return all(
        np.allclose(getattr(a, f.name)[i], getattr(b, f.name)[j], rtol=rel, atol=rel, equal_nan=True)
        for f in fields(Estimate)
    )


def test_axles_do_not_disturb_each_other(design: Design) -> None:
    z = np.concatenate([track(5.0, seed=s) for s in (1, 2, 3)], axis=2)
    together, alone = SteppedEstimator(design, 3), SteppedEstimator(design, 1)
    rng = np.random.default_rng(1)
    for k, row in enumerate(z):
        spoilt = np.array(row)
        if rng.random() < 0.05:
            spoilt[:, 0] = np.nan  # its neighbours lose measurements and have pulses
        if k % 200 < 6:
            spoilt[1, 2] += 1.5 * (-1.0) ** (k % 2)
        ratios = np.array([0.05 if k < 500 else 0.2, RATIO, 0.3])
        together.step(tick(k, spoilt, ratios))
        alone.step(tick(k, row[:, 1:2]))
        if k == 600:
            together.reset(0)
    a, b = together.estimate(), alone.estimate()
    assert same(a, 1, b, 0, 1e-9)
    assert not same(a, 0, b, 0, 1e-9)


def test_reset_axle_equals_a_new_estimator(design: Design) -> None:
    z = track(6.0)
    used, fresh = SteppedEstimator(design, 1), SteppedEstimator(design, 1)
    for k in range(3 * PER_S):
        used.step(tick(k, 3.0 * z[k], ratio=0.3, speed=26.0))
    used.reset(0)
    pairs = zip(*(estimates(e, z[3 * PER_S :], first=3 * PER_S) for e in (used, fresh)), strict=True)
    assert all(same(a, 0, b, 0) for a, b in pairs)


def test_sensor_bias_does_not_change_the_first_window(design: Design) -> None:
    z, bias = track(1.2), np.array([[0.0087], [0.5]])  # half a degree per second, 50 mg
    plain, biased = newest(SteppedEstimator(design, 1), z), newest(SteppedEstimator(design, 1), z + bias)
    assert biased.residuals == pytest.approx(plain.residuals, rel=1e-6)
    assert biased.mu_available_pct == pytest.approx(plain.mu_available_pct, abs=1e-3)


def test_missing_channel_does_not_change_the_offset(design: Design) -> None:
    e = SteppedEstimator(design, 1)
    for k in range(50):
        e.step(tick(k, np.array([[2.0], [5.0 if k % 2 else np.nan]])))
    assert e._axle["offset_mean"].tolist() == [[2.0, 5.0]]
    e.reset(0)
    e.step(tick(50, np.array([[7.0], [7.0]])))
    assert e._axle["offset_mean"].tolist() == [[7.0, 7.0]]


def white(ticks: int, axles: int = 1) -> FloatArray:
    return np.asarray([[0.01], [0.3]] * np.random.default_rng(5).standard_normal((ticks, 2, axles)))


@pytest.mark.parametrize("missing", [0, 1])
@pytest.mark.parametrize("speed", [10.0, 25.0, 50.0])
def test_missing_channel_keeps_every_filter_stable(design: Design, missing: int, speed: float) -> None:
    """Corrected by one channel with its part of a gain made for two, model 4 would double with every tick."""
    estimator, largest, z = SteppedEstimator(design, 1), [], white(400)
    z[200:230, missing] = np.nan
    for k, row in enumerate(z):
        estimator.step(tick(k, row, 0.2, speed))
        largest.append(float(np.abs(estimator._axle["bank_x"]).max()))
    assert max(largest[200:]) <= 2.0 * max(largest[:200])


def test_tick_after_a_gap_stays_out_of_the_window(design: Design) -> None:
    """With the two ticks of the gap. Before tick 130 noise is taken for pulses now and then."""
    estimator, live, z = SteppedEstimator(design, 1), [], white(180 + HOLD_TICKS)
    z[150:152] = np.nan
    for k, row in enumerate(z):
        live.append(bool(estimator.step(tick(k, row, 0.2)).live[0]))
    assert not live[0]  # nor does the very first one go in
    assert live[130 + HOLD_TICKS :] == [True] * 20 + [False] * 3 + [True] * 27


def test_a_word_of_no_adhesion_at_all_is_still_remembered(design: Design) -> None:
    none = replace(design, polynomial=np.zeros_like(design.polynomial), adhesion_range_pct=(0.0, 100.0))
    e = SteppedEstimator(none, 1)
    list(estimates(e, track(3.0)))
    assert np.isfinite(e._axle["memory"]).all()


def test_step_through_stops_where_it_is_asked_to_and_resets_where_it_may(design: Design) -> None:
    z = track(4.0).copy()
    z[500:510, 0] += 0.4  # so many outliers that the axle needs a reset
    ticks = Ticks(7, z, np.isfinite(z), np.linspace(0.1, 0.15, len(z))[:, None], [25.0] * len(z))
    one, other, stops = SteppedEstimator(design, 1), SteppedEstimator(design, 1), [3, 602, 603, 700]
    needs_reset: list[bool] = []
    for k, stop in enumerate(step_through(one, ticks, stops, resets=True)):
        assert stop == [*stops, len(z) - 1][k]
        for at in range(len(needs_reset), stop + 1):
            needs_reset.append(bool(other.step(tick_of(ticks, at)).needs_reset[0]))
            if needs_reset[-1]:
                other.reset(0)
        assert one.state == other.state
    assert any(needs_reset)
