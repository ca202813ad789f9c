"""Conditions of a bogie: both wheelsets run in one simulation, and count as one condition."""

from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.cases import TORQUE, Condition, Group, Plan, draw, following, in_a_hurry, simulate_group
from sim_ecu.design.features import Features, features
from sim_ecu.design.recordings import record
from sim_ecu.physics.contact import CURVES, CreepCurve
from sim_ecu.physics.track import SPECTRA
from sim_ecu.play.vehicles import load_vehicle
from wrcd.core.design import load_design
from wrcd.core.terms import COLUMNS, LENGTH, PARTNER
from wrcd.resources import DESIGN

W = load_vehicle("multiple-unit")
assert W.bogie is not None
APART_M = W.bogie.wheelbase_m
PLAN = Plan(seed=5, speeds=2, per_speed=8, seconds=3.0)
TICK_S = 0.005


def condition(seed: int, utilisation: float) -> Condition:
    return Condition(20.0, CURVES["C"], SPECTRA["erri-low"], utilisation, np.nan, seed)


def test_both_wheelsets_of_a_bogie_move_as_each_does_beside_one_that_is_not_recorded() -> None:
    pairs = [(replace(c, ahead_m=APART_M), replace(c, trailing=True)) for c in (condition(1, 0.4), condition(2, 0.8))]
    together = simulate_group(W, [c for pair in pairs for c in pair], 0.5, TICK_S)
    for k, (leading, trailing) in enumerate(pairs):
        np.testing.assert_array_equal(together[:, :, 2 * k], simulate_group(W, [leading], 0.5, TICK_S)[:, :, 0])
        np.testing.assert_array_equal(together[:, :, 2 * k + 1], simulate_group(W, [trailing], 0.5, TICK_S)[:, :, 0])


def test_second_wheelset_has_the_rail_of_the_first_and_half_of_them_another_torque() -> None:
    rng, c, other = np.random.default_rng(0), condition(1, 0.4), condition(2, -0.8)
    turns = [following(c, other, APART_M, rng, trailing=True) for _ in range(200)]
    assert {first for first, _ in turns} == {replace(c, ahead_m=APART_M)}
    others = [second.utilisation == other.utilisation for _, second in turns]
    assert 60 < sum(others) < 140
    own = {name: getattr(c, name) for name in TORQUE}
    assert {replace(second, **own) for _, second in turns} == {replace(c, trailing=True)}


def test_plan_of_a_bogie_has_as_many_wheelsets_as_it_says() -> None:
    for group in draw(replace(PLAN, per_speed=9), W):
        assert [c.trailing for c in group.conditions] == [False, True] * 4
        assert [c.seed for c in group.conditions[::2]] == [c.seed for c in group.conditions[1::2]]
        assert [c.curve for c in group.conditions[::2]] == [c.curve for c in group.conditions[1::2]]


def test_a_plan_in_a_hurry_has_fewer_conditions_and_a_small_one_stays() -> None:
    assert in_a_hurry(PLAN) == PLAN
    assert in_a_hurry(Plan()) == replace(Plan(), per_speed=in_a_hurry(Plan()).per_speed)
    assert 3 * in_a_hurry(Plan()).per_speed < Plan().per_speed


@pytest.mark.parametrize(("before", "begins_s"), [(None, 0.5), (CURVES["B"], 0.775)])
def test_what_is_ahead_meets_another_rail_earlier(before: CreepCurve | None, begins_s: float) -> None:
    c = replace(condition(1, 0.4), before=before, changes_at_s=0.85, ahead_m=APART_M)
    second = replace(c, ahead_m=0.0, trailing=True)
    plan = replace(PLAN, seconds=1.0)
    r = record(W, plan, TICK_S, lambda *_: None, groups=[Group(20.0, 0.0, (c, second))])[0]
    assert r.first[0] == round(begins_s / TICK_S)
    assert r.first[1] == round((0.5 if before is None else 0.9) / TICK_S)


def test_windows_of_both_wheelsets_of_a_bogie_belong_to_one_condition() -> None:
    """Else errors would be judged on windows that the rules have nearly seen."""
    plan = replace(PLAN, speeds=1, per_speed=4, worlds=False)
    data, _ = features(load_design(DESIGN), record(W, plan, TICK_S, lambda *_: None), plan)
    assert set(data.condition.tolist()) == {0, 1}


def test_windows_beside_a_partner_on_another_track_keep_their_truth_and_condition(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = replace(PLAN, speeds=1, per_speed=6, worlds=False)
    recordings = record(W, plan, TICK_S, lambda *_: None)
    found = []
    for share in (0.0, 1.0):
        monkeypatch.setattr("sim_ecu.design.features.ELSEWHERE", share)
        data, _ = features(load_design(DESIGN), recordings, plan)
        one_length = np.isclose(data.inputs[:, LENGTH], np.log10(data.window_s), atol=0.005)
        near = np.abs(data.inputs[one_length][:, PARTNER]).mean(axis=1)
        found.append((set(zip(data.condition.tolist(), data.mu_pct.tolist(), strict=True)), near))
    (beside, together), (elsewhere, apart) = found
    assert beside == elsewhere
    assert apart.mean() < together.mean()


def test_window_counts_more_in_the_own_world_and_where_it_is_whole_and_steady() -> None:
    inputs = np.zeros((4, COLUMNS))
    inputs[:, 4], inputs[:, 5] = np.log10(0.05), np.log10(20.0)
    inputs[1, LENGTH] = inputs[3, LENGTH] = np.log10(0.5)
    inputs[3, 4] = np.log10(0.005)  # half a per cent of the available ten: hardly in use
    data = Features(inputs, np.full(4, 10.0), np.arange(4), np.array([False, False, True, False]), 1.0)
    whole, short, own, edge = data.importance(replace(PLAN, own_weight=2.0))
    assert whole > short > edge > 0.0
    assert own == 2.0 * whole
