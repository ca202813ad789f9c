"""The suite of named worlds: what it plays, its rows and goals, and another design that is judged whole beside."""

from dataclasses import replace

import numpy as np
import pytest

from sim_ecu import resources as rig
from sim_ecu.design.brief import load_source
from sim_ecu.play.vehicles import load_vehicle
from sim_ecu.reporting.table import markdown
from sim_ecu.reporting.values import MET, MISSED, Figure
from sim_ecu.score.baselines import PAPER
from sim_ecu.score.metrics.accuracy import OURS
from sim_ecu.score.report import judge
from sim_ecu.score.run_score import ScoreRequest, play_one
from sim_ecu.score.score_goals import VALID_AND_WRONG, of_world
from sim_ecu.score.score_play import Trace
from sim_ecu.score.sections import sections
from sim_ecu.score.suites.run import lot_of
from sim_ecu.score.suites.worlds import (
    AS_TRAINED,
    EVERY,
    SWEPT,
    TABLE_RUNS,
    UNSEEN,
    WIDER,
    WORLD_RUNS,
    WORLDS,
    World,
    worlds,
)
from wrcd.resources import DESIGN

SOURCE = load_source(DESIGN)
FRAMES = 100


def trace(group: str, run: int, mu_pct: float, validity: str = "Valid") -> Trace:
    """Two seconds of a rail of 20 %, half of it without much in use."""
    return Trace(
        suite="worlds", group=group, run=run, curve="B", sensors="mems", speed_m_s=25.0, judged_from_s=0.0,
        changes_s=(), time_s=0.02 * np.arange(1.0, FRAMES + 1.0), mu_pct=np.full(FRAMES, mu_pct),
        validity=np.full(FRAMES, validity), cause=np.full(FRAMES, ""), half_width_pp=np.full(FRAMES, 2.0),
        own_half_width_pp=np.full(FRAMES, 1.2), contact=np.full(FRAMES, "Adhering"), surface=np.full(FRAMES, "Wet"),
        true_mu_pct=np.full(FRAMES, 20.0), true_used_pct=np.full(FRAMES, 5.0), true_slip=np.full(FRAMES, 1e-3),
        peak_slip=0.02,
    )  # fmt: skip


def test_every_world_has_its_runs_on_seeds_of_the_lot() -> None:
    for number in (0, 3):
        lot = lot_of(number)
        runs = list(worlds(SOURCE, 1.0, lot))
        assert {(r.suite, r.group) for r in runs} == {("worlds", w.name) for w in EVERY}
        assert all(len({r.number for r in runs if r.group == w.name}) == WORLD_RUNS for w in WORLDS)
        assert all(len({r.number for r in runs if r.group == w.name}) == TABLE_RUNS for w in SWEPT)
        assert all(lot.first_seed <= a.seed < lot.first_seed + lot.seeds for r in runs for a in r.scenario.axles)
    assert len({w.name for w in EVERY}) == len(EVERY)


def test_world_after_calm_running_plays_the_runs_of_the_one_before_it() -> None:
    (after,) = (w for w in WORLDS if w.known)
    runs = list(worlds(SOURCE, 0.2))
    own, before = ([r for r in runs if r.group == name] for name in (after.name, after.known))
    assert len(own) == round(0.2 * WORLD_RUNS)
    said = [[(r.number, r.curves, [a.seed for a in r.scenario.axles]) for r in of] for of in (own, before)]
    assert said[0] == said[1]
    assert [r.before for r in runs if r.group != after.name] == [None] * (len(runs) - len(own))
    calm = own[0].before
    assert calm is not None
    assert calm.duration_s == 360.0
    leading, trailing = calm.axles
    apart = load_vehicle("high-speed-coach").bogie
    assert apart is not None
    assert (leading.position_m - trailing.position_m, leading.runs_on) == (apart.wheelbase_m, trailing.runs_on)


def test_row_of_a_world_has_both_designs() -> None:
    first = next(w for w in WORLDS if w.family == AS_TRAINED and w.tied)
    second = next(w for w in WORLDS if w.family == WIDER)
    traces = [trace(first.name, k, 21.5) for k in range(12)]
    for k, t in enumerate(traces):
        t.beside["was"] = trace(first.name, k, 25.0) if k < 6 else trace(first.name, k, 20.0, "Degraded")
    result = judge([*traces, *(trace(second.name, k, 20.5) for k in range(12))], SOURCE)
    lines = "\n".join(markdown(sections(result))).splitlines()
    rows = [line for line in lines if line.startswith((f"| {first.name} |", f"| {second.name} |"))]
    ours, was, other = ([cell.strip() for cell in row.strip("|").split("|")] for row in rows)
    assert ours[:3] == [first.name, AS_TRAINED, OURS]
    assert [cell.split(" (")[0] for cell in ours[3:]] == [
        "1.50", "1.50", "1.50", "100.0", "0.0", "100.0", "0.0", "0", "12",
    ]  # fmt: skip
    assert was[:3] == [first.name, AS_TRAINED, "was"]
    assert [cell.split(" (")[0] for cell in was[3:]] == [
        "5.00", "5.00", "5.00", "0.0", "0.0", "50.0", "50.0", "0", "12",
    ]  # fmt: skip
    assert other[:3] == [second.name, second.family, OURS]
    judged = {g["what"]: g["verdict"] for g in result["goals"]}
    assert judged[f"worlds: {first.name}, mean error"] == MISSED  # 1.5, not 1.3
    assert judged[f"worlds: {first.name}, mean error below half"] == MET
    assert judged[f"worlds: {second.name}, Valid and wrong, share of frames"] == MET


def test_goals_of_a_world_are_those_of_its_name_family_and_slopes() -> None:
    def bounds(name: str, family: str, tied: bool) -> dict[str, tuple[float, bool]]:
        found = of_world(World(name, family, tied))
        goals = {path[-1]: goal(figure=Figure(0, 0, 0, 20, 20)) for path, goal in found.items()}
        return {name: (g.bound, g.at_least) for name, g in goals.items()}

    def least(holds: float) -> dict[str, tuple[float, bool]]:
        return {"own_covers": (holds, True), "valid": (0.95, True)}

    trained = least(0.87) | {"losses": (20.0, False)}
    own = trained | {"valid_and_wrong": (0.005, False)}
    assert bounds("its own vehicle", AS_TRAINED, True) == own | {"mean": (1.3, False), "below_half": (1.7, False)}
    assert bounds("w", AS_TRAINED, False) == trained | {"mean": (1.9, False), "below_half": (2.3, False)}
    assert bounds("w", WIDER, True) == bounds("w", WIDER, False) == least(0.8)
    assert bounds("w", UNSEEN, True) == least(0.7)
    assert set(VALID_AND_WRONG) < {w.name for w in WORLDS}


@pytest.mark.parametrize("suite", ["worlds", "harsh"])
def test_another_design_has_a_core_of_its_own_in_worlds_alone(suite: str) -> None:
    run = next(worlds(SOURCE, 0.05))
    short = replace(run, suite=suite, scenario=replace(run.scenario, duration_s=3.0, axles=run.scenario.axles[:2]))
    beside = (("again", DESIGN), ("other", rig.PAPER_DESIGN), (PAPER, rig.PAPER_DESIGN))
    ours, _ = play_one(ScoreRequest(DESIGN, beside), short)
    assert ours.baselines == {}
    assert set(ours.beside) == ({"again", "other"} if suite == "worlds" else set())
    if suite == "worlds":
        again, other = ours.beside["again"], ours.beside["other"]
        assert (ours.validity == "Valid").any()
        for name in ("time_s", "mu_pct", "validity", "half_width_pp", "own_half_width_pp", "true_mu_pct"):
            np.testing.assert_array_equal(getattr(again, name), getattr(ours, name))
        assert not np.array_equal(other.mu_pct, ours.mu_pct, equal_nan=True)
        assert not np.array_equal(other.own_half_width_pp, ours.own_half_width_pp, equal_nan=True)
