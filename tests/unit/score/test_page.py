"""The score's page: what comes first, what a reader without pictures gets, what stays silent."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_ecu.reporting.values import MET, MET_CHANCE, MISSED, TOO_FEW, Figure
from sim_ecu.reporting.verdicts import MIN_QUICK_RUNS, Goal
from sim_ecu.score import run_score
from sim_ecu.score.score_goals import goals
from sim_ecu.score.score_pictures import pictures
from sim_ecu.score.score_play import Trace

FRAMES = 200


def trace(suite: str = "grid", run: int = 1, valid: bool = True, mu: float = 20.0) -> Trace:
    """Four seconds of one axle that is 1 percentage point off."""
    time_s = np.linspace(0.0, 0.02 * (FRAMES - 1), FRAMES)
    words = np.full(FRAMES, "Valid" if valid else "Degraded")
    return Trace(
        suite=suite, group="mems", run=run, curve="C", sensors="mems", speed_m_s=25.0, judged_from_s=1.0,
        changes_s=(2.0,), time_s=time_s, mu_pct=np.full(FRAMES, mu), validity=words, cause=np.full(FRAMES, "None"),
        half_width_pp=np.full(FRAMES, 2.0), own_half_width_pp=np.full(FRAMES, 1.5),
        contact=np.full(FRAMES, "Adhering"), surface=np.full(FRAMES, "Wet"), true_mu_pct=np.full(FRAMES, 21.0),
        true_used_pct=np.full(FRAMES, 5.0), true_slip=np.full(FRAMES, 1e-4), peak_slip=1e-2,
        baselines={"torque ratio": np.full(FRAMES, 5.0)},
    )  # fmt: skip


def figure(value: float, runs: int) -> Figure:
    return Figure(value, value - 0.1, value + 0.1, runs, 1000)


def result(quick: bool = False, verdicts: tuple[str, ...] = (MET, MISSED)) -> dict[str, Any]:
    found = [
        Goal(f"dry-hours: goal {k}", figure(1.0, 12), 1.0).record() | {"verdict": v} for k, v in enumerate(verdicts)
    ]
    dry = {
        "episodes": 0, "seconds": figure(0.0, 12), "hours": 1.0, "valid_hours": 1.0, "at_most_per_hour": 3.0,
        "not_valid_of": {
            "all": {"share": figure(0.01, 12), "accused": figure(0.0, 12), "causes": {"Harsh": 0.01}},
        },
    }  # fmt: skip
    return {
        "run": {"quick": quick}, "design": {"name": "a <design>", "checksum": "0" * 64, "window_s": 1.0},
        "seeds": "Seeds.", "suites": {"dry-hours": dry}, "goals": found,
    }  # fmt: skip


def page(found: dict[str, Any], traces: list[Trace]) -> str:
    return run_score._page(found, traces)


def test_pictures_come_before_tables() -> None:
    shown = page(result(), [trace(), trace("transitions")])
    assert shown.count("<img") == 4
    assert shown.rindex("<img") < shown.index("<table")


def test_words_of_a_picture_have_its_figures() -> None:
    alts = {p.title: p.alt for p in pictures(result(), [trace()])}
    assert alts["Goals"] == "Verdicts by suite. dry-hours: 1 met, 1 missed."
    assert alts["Estimate against truth, grid"] == (
        "150 Valid frames. Within 3 percentage points of the truth are 100 % of those of wrcd, 0 % of those of torque "
        "ratio."
    )
    assert alts["Error by utilisation, grid"].endswith("by utilisation: 0.15: 1.00.")


@pytest.mark.parametrize("quick", [True, False])
def test_quick_score_says_so_first(quick: bool) -> None:
    text = page(result(quick), [])
    assert ("<title>QUICK" in text) is quick
    assert ('role="note"><strong>QUICK</strong>' in text) is quick
    assert text.count("a twelfth of the runs") == quick


def test_quick_score_judges_nothing_that_has_few_runs() -> None:
    dry = {"dry-hours": result()["suites"]["dry-hours"] | {"seconds": figure(9.0, MIN_QUICK_RUNS - 1)}}
    few, many = figure(0.0, 12), {"dry-hours": dry["dry-hours"] | {"seconds": figure(9.0, MIN_QUICK_RUNS)}}
    assert [g.verdict for g in goals(dry, few)] == [MISSED, MET_CHANCE]
    assert [g.verdict for g in goals(dry, few, quick=True)] == [TOO_FEW, TOO_FEW]
    assert [g.verdict for g in goals(many, None, quick=True)] == [MISSED]


@pytest.mark.parametrize(
    "traces",
    [
        [], [trace(valid=False)], [trace()], [replace(trace(), mu_pct=np.full(FRAMES, np.nan))],
        [trace("transitions", valid=False)], [replace(trace(), baselines={})],
    ],
)  # fmt: skip
def test_page_of_empty_figures_raises_no_warning(traces: list[Trace]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert page(result(), traces).endswith("</html>\n")
