"""The score's figures, on traces whose answer is known, and the intervals around them."""

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest

from sim_ecu.reporting.values import CHANCE, MET, MISSED, Figure
from sim_ecu.reporting.verdicts import Goal
from sim_ecu.score.metrics import accuracy, bootstrap, change_metrics, honesty
from sim_ecu.score.metrics.accuracy import OURS, gather
from sim_ecu.score.score_goals import goals
from sim_ecu.score.score_play import Trace
from sim_ecu.score.sections import apart
from sim_ecu.score.suites.broken import BOTH_DIE
from wrcd.core.causes import Cause


def trace(mu: np.ndarray, true: np.ndarray, **other: object) -> Trace:
    """50 frames a second, all Valid, of a wheelset that uses 5 %."""
    n = len(mu)
    values: dict[str, Any] = {
        "suite": "grid", "group": "mems", "run": 0, "curve": "A", "sensors": "mems", "speed_m_s": 25.0,
        "judged_from_s": 0.0, "changes_s": (),
        "time_s": 0.02 * np.arange(1.0, n + 1.0), "mu_pct": mu, "validity": np.full(n, "Valid"),
        "cause": np.full(n, ""), "half_width_pp": np.full(n, 2.0), "own_half_width_pp": np.full(n, 1.6),
        "contact": np.full(n, "Adhering"),
        "surface": np.full(n, "Dry"), "true_mu_pct": true, "true_used_pct": np.full(n, 5.0),
        "true_slip": np.full(n, 0.001), "peak_slip": 0.02,
    }  # fmt: skip
    return Trace(**values | other)


def words(n: int, word: str, *places: tuple[slice | int, str]) -> np.ndarray:
    """One word throughout, others at places."""
    out = np.full(n, word, "U16")
    for place, other in places:
        out[place] = other
    return out


def step(n: int, at: int, before: float, after: float) -> np.ndarray:
    return np.where(np.arange(n) < at, before, after)


def values(figures: dict[str, Figure]) -> dict[str, float]:
    return {k: f.value for k, f in figures.items()}


def test_only_valid_frames_are_judged_and_the_others_counted() -> None:
    true = np.full(100, 20.0)
    mu = np.where(np.arange(100) < 10, 90.0, 21.0)
    mu[50] = 40.0
    validity = words(100, "Valid", (slice(0, 6), "Degraded"), (slice(6, 10), "NotAvailable"))
    cause = words(100, "", (slice(0, 6), "Identity"), (slice(6, 10), "Timeout"))
    t = trace(mu, true, validity=validity, cause=cause, baselines={"torque ratio": np.full(100, 5.0)})
    f = gather([t])
    found = values(accuracy.accuracy(f, OURS))
    assert found["mean"] == pytest.approx((89 * 1.0 + 20.0) / 90)
    assert found["below_half"] == pytest.approx(found["mean"])
    assert math.isnan(found["above_0.9"])
    theirs = accuracy.accuracy(f, "torque ratio")["mean"]
    assert theirs.value == pytest.approx(15.0)
    assert (theirs.runs, theirs.count) == (1, 90)
    lost = honesty.not_valid(f)
    assert lost["share"].value == pytest.approx(0.1)
    assert lost["causes"] == pytest.approx({"Identity": 0.06, "Timeout": 0.04})


def test_valid_and_wrong_is_outside_the_interval_and_far_off_among_all_judged_frames() -> None:
    nan = math.nan
    mu, true, half, validity, wrong = zip(
        (23.0, 20.0, 2.0, "Valid", True),  # more than 2 points off
        (6.5, 5.0, 1.0, "Valid", True),  # more than a fifth off
        (nan, 20.0, 2.0, "Valid", True),  # no number
        (23.0, 20.0, nan, "Valid", True),  # no interval
        (23.0, 20.0, 5.0, "Valid", False),  # inside
        (90.0, 20.0, math.inf, "Valid", False),  # no bound claimed
        (21.5, 20.0, 1.0, "Valid", False),  # outside, but near
        (5.9, 5.0, 0.5, "Valid", False),  # the same on a low rail
        (90.0, 20.0, 2.0, "Degraded", False),  # nobody goes by it, but it is counted
        (23.0, nan, 2.0, "Valid", None),  # no truth: not counted
        strict=True,
    )
    t = trace(np.array(mu), np.array(true), half_width_pp=np.array(half), validity=np.array(validity))
    early = trace(np.full(9, 90.0), np.full(9, 20.0), judged_from_s=10.0)
    counted = sum(w is not None for w in wrong)
    found = accuracy.valid_and_wrong(gather([t, early]))
    assert found.count == counted
    assert found.value == pytest.approx(sum(w is True for w in wrong) / counted)
    assert accuracy.accuracy(gather([t]), OURS)["valid_and_wrong"].value == found.value


def test_share_that_is_valid_and_wrong_has_an_interval_by_run() -> None:
    runs = [trace(np.where(np.arange(100) < k, 30.0, 20.0), np.full(100, 20.0), run=k) for k in range(12)]
    found = accuracy.valid_and_wrong(gather(runs))
    assert found.value == pytest.approx(0.055)
    assert 0.0 < found.low < 0.05 < 0.06 < found.high < 0.1
    assert found.runs == 12


def test_causes_that_are_as_frequent_stand_by_name() -> None:
    causes = np.array([f"cause {(k * 7) % 60:02d}" for k in range(90)])  # half of them twice
    true = np.full(90, 20.0)
    t = trace(true, true, validity=np.full(90, "Degraded"), cause=causes[::-1])
    often = Counter(causes.tolist())
    assert list(honesty.not_valid(gather([t]))["causes"]) == sorted(often, key=lambda c: (-often[c], c))


def test_frames_before_they_are_judged_do_not_count() -> None:
    mu = np.where(np.arange(100) < 50, 90.0, 20.0)
    f = gather([trace(mu, np.full(100, 20.0), judged_from_s=1.02)])
    found = accuracy.accuracy(f, OURS)
    assert found["mean"].count == 50
    assert values(found) == pytest.approx(
        {"mean": 0.0, "p95": 0.0, "below_half": 0.0, "above_0.9": math.nan, "valid_and_wrong": 0.0}, nan_ok=True
    )


def test_losses_of_valid_are_counted_by_hour_from_where_frames_are_judged() -> None:
    true = np.full(1000, 20.0)  # 20 s; lost before it is judged, then twice, once more until the end
    at = words(
        1000, "Valid", (30, "Degraded"), (slice(100, 140), "Degraded"), (500, "NotAvailable"), (slice(900, 1000), "x")
    )
    t = trace(true, true, validity=at, judged_from_s=1.0)
    assert honesty.losses([t]).value == pytest.approx(3 * 3600 / (951 * 0.02))
    assert honesty.losses([t, trace(true, true, run=1)]).value == pytest.approx(3 * 3600 / (1951 * 0.02))


def test_the_delay_is_to_the_crossing_of_the_geometric_mean() -> None:
    true = step(500, 100, 40.0, 10.0)
    mu = step(500, 130, 40.0, 19.0)  # 0.6 s late, and then on the new side of 20
    mu[110] = 15.0  # one frame across is not yet a crossing
    late = trace(mu, true, changes_s=(2.0,), run=3, baselines={"other": step(500, 105, 40.0, 19.0)})
    seconds, runs = change_metrics.delays([late])
    assert seconds == pytest.approx([0.62])
    assert runs.tolist() == [3]
    assert change_metrics.delays([late], "other")[0] == pytest.approx([0.12])
    never = trace(np.full(500, 25.0), true, changes_s=(2.0,))
    assert change_metrics.delays([never])[0] == pytest.approx([change_metrics.LATEST_S])
    silent = trace(mu, true, changes_s=(2.0,), validity=words(500, "Valid", (slice(100, 500), "Degraded")))
    assert change_metrics.delays([silent])[0] == pytest.approx([change_metrics.LATEST_S])
    across = trace(np.full(500, 15.0), true, changes_s=(2.0,))
    assert np.isnan(change_metrics.delays([across])[0]).all()  # nothing to cross


def test_drop_is_timed_by_its_lie_and_its_settling() -> None:
    """Down from 40 to 10 at 2.00 s; wrcd stays at 40 ± 2 for 0.4 s, at 14 for 0.2 s, then says 10.5."""
    true = step(500, 100, 40.0, 10.0)
    mu = np.concatenate((np.full(120, 40.0), np.full(10, 14.0), np.full(370, 10.5)))
    half = np.where(np.arange(500) < 125, 2.0, 5.0)
    [drop] = change_metrics.drops([trace(mu, true, changes_s=(2.0,), half_width_pp=half, curve="A to C")])
    assert drop.lie_s == pytest.approx(0.5)  # 20 frames at 40 ± 2, five at 14 ± 2
    assert drop.far_s == pytest.approx(0.5)
    assert drop.max_over_pp == pytest.approx(30.0)
    assert drop.settled_s == pytest.approx(0.62)
    assert drop.curve == "A to C"


def test_drop_that_ends_valid_is_no_lie_and_settles_when_valid_again() -> None:
    true = step(500, 100, 40.0, 10.0)
    mu = step(500, 120, 40.0, 10.2)
    validity = words(500, "Valid", (slice(100, 150), "Degraded"))
    [drop] = change_metrics.drops([trace(mu, true, changes_s=(2.0,), validity=validity)])
    assert drop.lie_s == 0.0
    assert drop.far_s == 0.0
    assert drop.max_over_pp == pytest.approx(0.2)
    assert drop.settled_s == pytest.approx(1.02)


def test_a_valid_frame_without_an_interval_claims_a_narrow_one() -> None:
    true = step(300, 100, 40.0, 10.0)
    [drop] = change_metrics.drops(
        [trace(step(300, 110, 40.0, 10.0), true, changes_s=(2.0,), half_width_pp=np.full(300, math.nan))]
    )
    assert drop.lie_s == pytest.approx(10 * 0.02)
    f = gather([trace(np.full(10, 20.0), np.full(10, 20.0), half_width_pp=np.full(10, math.nan))])
    assert honesty.coverage(f).value == 0.0


def test_only_changes_down_are_drops_and_each_lasts_to_the_next() -> None:
    true = np.concatenate((np.full(100, 40.0), np.full(100, 10.0), np.full(300, 40.0)))
    t = trace(np.full(500, 40.0), true, changes_s=(2.0, 4.0))
    [drop] = change_metrics.drops([t])
    assert drop.lie_s == pytest.approx(2.0)
    assert drop.settled_s == change_metrics.LATEST_S
    assert change_metrics.settlings([t], OURS)[0] == pytest.approx([change_metrics.LATEST_S])


def test_estimate_that_leaves_its_bound_again_has_not_settled() -> None:
    true = step(500, 100, 40.0, 10.0)
    mu = step(500, 110, 40.0, 10.0)
    mu[115] = 12.0
    [drop] = change_metrics.drops([trace(mu, true, changes_s=(2.0,))])
    assert drop.settled_s == pytest.approx(0.34)


def test_coverage_and_width_by_level() -> None:
    true = np.full(200, 20.0)
    mu = 20.0 + np.where(np.arange(200) % 10 == 0, 3.0, 0.5)
    half = np.where(np.arange(200) < 100, 1.0, 5.0)
    own = np.where(np.arange(200) < 100, 0.9, 3.1)
    found = honesty.confidence(gather([trace(mu, true, half_width_pp=half, own_half_width_pp=own)]))
    assert found["levels"]["Within1pp"]["share"] == 0.5
    assert found["levels"]["Within1pp"]["covers"].value == pytest.approx(0.9)
    assert found["levels"]["Within5pp"]["covers"].value == 1.0
    assert found["covers"].value == pytest.approx(0.95)
    assert found["mean_half_width"].value == pytest.approx(2.0)
    assert found["median_half_width"].value == pytest.approx(0.9)
    assert 0.5 <= found["constant_half_width"].value <= 3.0


def test_an_interval_without_a_bound_is_no_error_and_of_no_use() -> None:
    half = np.where(np.arange(100) < 50, 1.0, math.inf)
    found = honesty.confidence(gather([trace(np.full(100, 30.0), np.full(100, 20.0), half_width_pp=half)]))
    assert found["covers"].value == pytest.approx(0.5)
    assert found["covers_bounded"] == 0.0
    assert found["levels"]["Wider"]["covers"].value == 1.0


def test_false_lows_are_counted_and_timed_where_valid() -> None:
    surface = words(3600, "Dry", (slice(100, 200), "Low"), (300, "VeryLow"), (slice(400, 500), "Wet"))
    surface[600:700] = "Low"
    validity = words(3600, "Valid", (slice(600, 700), "Degraded"))
    one = trace(np.full(3600, 30.0), np.full(3600, 38.0), surface=surface, validity=validity, run=1)
    none = trace(np.full(3600, 30.0), np.full(3600, 38.0), run=2)
    found = honesty.false_lows([one, none])
    assert found["episodes"] == 2
    assert found["seconds"].value == pytest.approx(101 * 0.02)
    assert math.isnan(found["seconds"].low)  # two runs tell nothing
    others = [trace(np.full(9, 30.0), np.full(9, 38.0), run=k) for k in range(3, 6)]
    assert honesty.false_lows([one, none, *others])["seconds"].low == 0.0  # it may be one run in five, or none
    assert found["hours"] == pytest.approx(2 * 3600 * 0.02 / 3600)
    assert found["valid_hours"] == pytest.approx((2 * 3600 - 100) * 0.02 / 3600)
    assert honesty.false_lows([none])["at_most_per_hour"] == pytest.approx(-math.log(0.05) / 0.02)


def test_dead_sensor_is_timed_until_it_is_found() -> None:
    found = trace(np.full(500, 9.0), np.full(500, 9.0), validity=words(500, "Valid", (slice(160, 500), "Degraded")))
    wavers = words(500, "Valid", (slice(160, 490), "Degraded"))
    back = trace(np.full(500, 9.0), np.full(500, 9.0), validity=wavers, run=1)
    after = honesty.valid_after([found, back], 2.0)
    assert after["most"].value == pytest.approx(1.2 + 0.2)
    assert after["median"].value == pytest.approx(1.2)
    assert honesty.found_out([found, back]).value == 0.5


def test_contact_is_judged_where_it_can_be_told() -> None:
    n = 100
    used = np.where(np.arange(n) < 50, 10.0, 18.0)  # 0.5 and 0.9 of 20 %
    contact = np.where(np.arange(n) < 40, "Adhering", "Saturated")
    f = gather([trace(np.full(n, 20.0), np.full(n, 20.0), true_used_pct=used, contact=contact)])
    found = accuracy.contact_right(f)
    assert found["right"].value == pytest.approx(0.8)
    assert found["right"].count == 50
    assert math.isnan(found["saturated_right"].value)


def test_within_means_valid_and_within_a_point_or_a_tenth() -> None:
    f = gather([trace(np.array([43.0, 6.0, 8.0, 5.0]), np.array([40.0, 5.0, 5.0, 5.0]))])
    assert accuracy.within(f)["share"].value == pytest.approx(0.75)
    assert accuracy.within(f)["worst"].value == pytest.approx(3.0)
    validity = words(4, "Valid", (3, "Degraded"))
    f = gather([trace(np.array([43.0, 6.0, 8.0, 5.0]), np.array([40.0, 5.0, 5.0, 5.0]), validity=validity)])
    assert accuracy.within(f)["share"].value == pytest.approx(0.5)
    assert accuracy.within(f)["worst"].value == math.inf


def test_intervals_come_from_runs_and_not_from_frames() -> None:
    """40 runs of 100 frames that are all alike within a run: as uncertain as 40 numbers, not as 4000."""
    rng = np.random.default_rng(0)
    level = rng.standard_normal(40)
    runs = np.repeat(np.arange(40), 100)
    found = bootstrap.mean(np.repeat(level, 100), runs)
    assert found.value == pytest.approx(level.mean())
    expected = 2 * 1.645 * level.std() / math.sqrt(40)
    assert found.high - found.low == pytest.approx(expected, rel=0.15)
    assert (found.runs, found.count) == (40, 4000)
    quantile = bootstrap.quantile(np.repeat(level, 100), runs, 0.5)
    assert quantile.value == np.sort(level)[19]
    assert quantile.low < quantile.value < quantile.high
    assert math.isnan(bootstrap.mean(level[:1], np.zeros(1, int)).low)


def test_intervals_of_ratios_of_few_runs_hold_the_truth() -> None:
    """Runs of unequal length, whose errors go with each other in two worlds."""
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(200):
        runs = np.repeat(np.arange(10), rng.integers(20, 60, 10))
        level = rng.lognormal(0.0, 0.5, 10)[runs]
        worse = level * rng.lognormal(0.0, 0.3, 10)[runs] * 1.2
        f = bootstrap.ratio(worse, runs, level, runs)
        held += f.low <= 1.2 * math.exp(0.045) <= f.high
    assert 0.85 <= held / 200 <= 0.97


def test_intervals_end_where_the_figure_does() -> None:
    """A share lies between 0 and 1, an error is not below 0."""
    hits = np.arange(8) < 7
    assert bootstrap.mean(hits, np.arange(8)).high == 1.0
    errors = np.where(np.arange(8) == 0, 5.0, 0.0)
    assert bootstrap.mean(errors, np.arange(8)).low == 0.0
    assert bootstrap.mean(errors - 1e-9, np.arange(8)).low < 0.0


def test_pairs_are_compared_more_sharply_than_their_means() -> None:
    rng = np.random.default_rng(2)
    runs = np.arange(30)
    nominal = rng.exponential(1.0, 30)
    worse = nominal * 1.3 + 0.01 * rng.standard_normal(30)
    ratio = bootstrap.ratio(worse, runs, nominal, runs)
    assert ratio.value == pytest.approx(1.3, abs=0.02)
    assert ratio.high - ratio.low < 0.05
    assert bootstrap.ratio(worse, runs + 100, nominal, runs).high > 1.5  # unpaired
    less = bootstrap.difference(worse, runs, nominal, runs)
    assert less.low < 0.3 * nominal.mean() < less.high


def test_a_share_of_all_or_none_is_not_certain() -> None:
    every = bootstrap.share(np.ones(80, bool), np.arange(80) // 4)
    assert every.value == every.high == 1.0
    assert every.low == pytest.approx(0.05 ** (1 / 20))
    none = bootstrap.share(np.zeros(80, bool), np.arange(80) // 4)
    assert none.high == pytest.approx(1 - 0.05 ** (1 / 20))


def test_the_largest_has_happened_and_has_no_interval() -> None:
    found = bootstrap.largest(np.array([1.0, 5.0, 2.0, 3.0]), np.array([0, 0, 1, 2]))
    assert (found.value, found.runs, found.count) == (5.0, 3, 4)
    assert math.isnan(found.low)
    assert Goal("x", found, 4.9, min_runs=3, never=True).verdict == MISSED
    assert Goal("x", found, 5.0, min_runs=3, never=True).verdict == MET


def figure(value: float, low: float, high: float, runs: int = 50) -> Figure:
    return Figure(value, low, high, runs, 1000)


def test_what_must_not_happen_is_no_matter_of_chance_once_it_has() -> None:
    """Seconds of a dry rail called low, a worst case, a share that must be whole."""
    assert Goal("x", figure(0.6, 0.0, 1.2), 0.0, never=True).verdict == MISSED
    assert Goal("x", figure(0.99, 0.95, 1.0), 1.0, at_least=True, never=True).verdict == MISSED
    assert Goal("x", figure(0.99, 0.95, 1.0), 1.0, at_least=True).verdict == CHANCE
    most = {"most": figure(9.0, 0.0, 9.0)}
    beyond = {
        "paper": {"within": {"worst": figure(9.0, 0.0, 9.0)}}, "dry-hours": {"seconds": figure(0.6, 0.0, 1.2)},
        "dead": {"groups": {BOTH_DIE: {"valid_s": most}}},
    }  # fmt: skip
    assert [g.verdict for g in goals(beyond, None)] == [MISSED] * 3


def test_better_is_better_where_intervals_are_apart() -> None:
    ours = figure(1.0, 0.9, 1.1)
    assert apart(ours, figure(1.5, 1.2, 1.8)) == "better"
    assert apart(ours, figure(1.2, 1.0, 1.4)) == "better, intervals overlap"
    assert apart(ours, figure(0.95, 0.8, 1.1)) == "not better, intervals overlap"
    assert apart(ours, figure(0.5, 0.4, 0.6)) == "worse"


def test_frames_that_accuse_a_sensor_are_counted_and_those_that_know_too_little_are_not() -> None:
    causes = np.array(["GyroReversed", "AccelSmall", "SensorsSilent", "TooLittleData", "GyroReversed", ""])
    validity = np.array(["Degraded"] * 4 + ["Valid"] * 2)  # a Valid frame accuses nobody, whatever was said before
    f = gather([trace(np.full(6, 20.0), np.full(6, 20.0), cause=causes, validity=validity)])
    assert honesty.not_valid(f)["accused"].value == pytest.approx(3 / 6)
    assert set(honesty.ACCUSING) <= {c.label for c in Cause}
