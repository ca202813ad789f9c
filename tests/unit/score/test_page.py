"""The score's page: what comes first, what a reader without pictures gets, what stays silent."""

import re
import warnings
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from sim_ecu.score.goals import MET, MIN_QUICK_RUNS, MISSED, TOO_FEW, Goal, goals
from sim_ecu.score.metrics.bootstrap import Figure
from sim_ecu.score.page import MAX_LISTED, page, verdict
from sim_ecu.score.page_pictures import LOOKS, pictures
from sim_ecu.score.page_tables import sections
from sim_ecu.score.play import Trace

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
        {"what": f"dry-hours: goal {k}", "figure": figure(1.0, 12), "bound": 1.0, "at_least": False, "verdict": v}
        for k, v in enumerate(verdicts)
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


class Outline(HTMLParser):
    """Tags in their order, with their attributes, and tags that were not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "source"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_pictures_come_before_tables() -> None:
    tags = [tag for tag, _ in Outline(page(result(), [trace()])).tags]
    assert tags.index("img") < tags.index("table")
    assert "img" not in tags[tags.index("table") :]


def test_page_is_sound_and_asks_for_nothing_outside() -> None:
    outline = Outline(page(result(), [trace()]))
    assert outline.open == []
    for tag, of in outline.tags:
        assert tag not in ("script", "link", "iframe")
        for name in ("src", "srcset", "href"):
            assert (of.get(name) or "#").startswith(("#", "data:image/png;base64,"))
    assert "url(" not in page(result(), [])


def test_every_picture_has_words_and_a_source_for_each_look() -> None:
    outline = Outline(page(result(), [trace(), trace("transitions")]))
    images = [of for tag, of in outline.tags if tag == "img"]
    assert len(images) == 4
    for of in images:
        assert len(of["alt"] or "") > 30
    assert sum(tag == "source" for tag, _ in outline.tags) == len(images) * (len(LOOKS) - 1)
    looks = {re.findall(r"base64,(.{4000})", str(of))[0] for tag, of in outline.tags if tag in ("img", "source")}
    assert len(looks) == len(images) * len(LOOKS)


def test_words_of_a_picture_have_its_figures() -> None:
    alts = {p.title: p.alt for p in pictures(result(), [trace()])}
    assert alts["Goals"] == "Verdicts by suite. dry-hours: 1 met, 1 missed."
    assert alts["Estimate against truth, grid"] == (
        "150 Valid frames. Within 3 percentage points of the truth are 100 % of those of wrcd, 0 % of those of torque "
        "ratio."
    )
    assert alts["Error by utilisation, grid"].endswith("by utilisation: 0.15: 1.00.")


def test_verdict_is_counted_and_what_is_missed_is_named() -> None:
    text = page(result(verdicts=(MET, MET, MISSED, TOO_FEW)), [])
    said = (
        "Of 4 goals <strong>2</strong> met, <strong>1</strong> missed, <strong>1</strong> with too few runs to judge."
    )
    assert said in text
    assert "<li>dry-hours: goal 2</li>" in text
    assert text.index("<li>dry-hours: goal 2</li>") < text.index("<table")


@pytest.mark.parametrize(("missed", "folded"), [(MAX_LISTED, False), (MAX_LISTED + 1, True)])
def test_many_missed_goals_are_folded_and_all_there(missed: int, folded: bool) -> None:
    text = "".join(verdict([{"what": f"goal {k} &", "verdict": MISSED} for k in range(missed)]))
    assert all(f"<li>goal {k} &amp;</li>" in text for k in range(missed))
    assert ("<details>" in text) == folded


@pytest.mark.parametrize("quick", [True, False])
def test_quick_score_says_so_first(quick: bool) -> None:
    text = page(result(quick), [])
    assert ("<title>QUICK" in text) is quick
    assert ('role="note"><strong>QUICK</strong>' in text) is quick
    assert text.count("a twelfth of the runs") == quick


def test_name_of_a_design_is_text() -> None:
    assert "<design>" not in page(result(), [])


def test_quick_score_judges_nothing_that_has_few_runs() -> None:
    dry = {"dry-hours": result()["suites"]["dry-hours"] | {"seconds": figure(9.0, MIN_QUICK_RUNS - 1)}}
    assert next(g.verdict for g in goals(dry)) == MISSED
    assert [g.verdict for g in goals(dry, quick=True)] == [TOO_FEW, TOO_FEW]
    many = {"dry-hours": dry["dry-hours"] | {"seconds": figure(9.0, MIN_QUICK_RUNS)}}
    assert [g.verdict for g in goals(many, quick=True)] == [MISSED, TOO_FEW]


def test_goal_of_few_runs_is_too_few_to_judge() -> None:
    assert Goal("x", figure(0.5, 9), 1.0).verdict == "too few to judge"


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


def test_cell_names_its_column() -> None:
    lines = ["first", "", "**suite**: what it is", "", "| a | b & c |", "|---|---|", "| x | 1 |", "", "behind"]
    (_, before), (name, inside) = sections(lines)
    assert before == ["<p>first</p>"]
    assert name == "suite"
    assert inside[0] == "<p>What it is.</p>"
    assert '<tr><th scope="row">x</th><td data-of="b &amp; c">1</td></tr>' in inside
    assert inside[-1] == "<p>behind</p>"


def test_row_of_a_missed_goal_is_marked() -> None:
    rows = [line for line in page(result(), []).splitlines() if "dry-hours: goal" in line and "<tr" in line]
    assert [row.startswith('<tr class="missed">') for row in rows] == [False, True]
