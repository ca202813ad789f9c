"""Tables and verdicts: what is shown of values, and what a goal's interval says."""

import math

import pytest

from sim_ecu.reporting.table import Chapter, Table, markdown
from sim_ecu.reporting.values import (
    CHANCE,
    MET,
    MET_CHANCE,
    MISSED,
    TOO_FEW,
    Figure,
    Rounded,
    Share,
    Value,
    plain,
    text,
)
from sim_ecu.reporting.verdicts import Goal, table

NAN = math.nan


def figure(value: float, low: float = NAN, high: float = NAN, runs: int = 20) -> Figure:
    return Figure(value, low, high, runs, 100)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("a word", "a word"), (3, "3"), (1.234, "1.23"), (NAN, "–"), (math.inf, "inf"), (Rounded(1.2345, 3), "1.234"),
        (figure(1.0, 0.5, 1.5), "1.00 (0.50–1.50)"), (figure(1.0), "1.00"), (figure(NAN), "–"),
        (Rounded(figure(1.0, 0.5, 1.5), 1), "1.0 (0.5–1.5)"), (Share(0.123), "12.3 %"), (Share(NAN), "–"),
        (Share(figure(0.5, 0.4, 0.6)), "50.0 (40.0–60.0) %"), (Share(figure(0.5)), "50.0 %"), (Share(figure(NAN)), "–"),
    ],
)  # fmt: skip
def test_value_is_shown_with_its_interval_if_it_has_one(value: Value, shown: str) -> None:
    assert text(value) == shown


def test_json_has_records_as_tables_and_null_for_what_is_no_number() -> None:
    found = {1: (figure(0.5), NAN), "x": [math.inf, True]}
    assert plain(found) == {
        "1": [{"value": 0.5, "low": None, "high": None, "runs": 20, "count": 100}, None], "x": [None, True],
    }  # fmt: skip


TABLE = Table(["a", "b & c"], [["x|\ny", 1], ["z", 2.5]])


def test_table_as_markdown() -> None:
    assert TABLE.markdown() == ["| a | b & c |", "|---|---|", "| x\\| y | 1 |", "| z | 2.50 |"]


def test_markdown_of_sections() -> None:
    sections = [
        Chapter("", "", ["one", "two"]),
        Chapter("s", "about it", [TABLE, "behind"]),
        Chapter("bare", "", ["text"]),
    ]  # fmt: skip
    assert markdown(sections) == [
        "one", "two", "", "**s**: about it", "", *TABLE.markdown(), "", "behind", "", "**bare**", "", "text",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("goal", "verdict"),
    [
        (Goal("x", figure(0.5, 0.4, 0.6), 1.0), MET), (Goal("x", figure(0.9, 0.8, 1.1), 1.0), MET_CHANCE),
        (Goal("x", figure(1.1, 0.9, 1.2), 1.0), CHANCE), (Goal("x", figure(1.1, 0.9, 1.2), 1.0, never=True), MISSED),
        (Goal("x", figure(1.1, 1.05, 1.2), 1.0), MISSED), (Goal("x", figure(1.1, 1.05, 1.2), 1.0, True), MET),
        (Goal("x", figure(1.1), 1.0), MISSED), (Goal("x", figure(0.5, runs=9), 1.0), TOO_FEW),
    ],
)  # fmt: skip
def test_goal_is_judged_by_its_interval(goal: Goal, verdict: str) -> None:
    assert goal.verdict == verdict


def test_bound_of_a_goal_stands_with_its_sign() -> None:
    rows = [Goal("x", figure(0.9), 0.87, at_least=True).record(), Goal("y", figure(0.9), 1.0).record()]
    assert [line.split("|")[3].strip() for line in table(rows).markdown()[2:]] == ["≥ 0.87", "≤ 1"]
