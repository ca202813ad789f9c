"""Tables, pages and pictures: what is shown of values, what is folded, what is escaped, what comes first."""

import math
import re
from html.parser import HTMLParser
from typing import Any

import pytest

from sim_ecu.reporting.page import Folded, Items, Page, PageSection, Part, html, markdown
from sim_ecu.reporting.plots import LOOKS, Picture, fields, goals, legend
from sim_ecu.reporting.table import Row, Table
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
from sim_ecu.reporting.verdicts import MAX_LISTED, Goal, head, table

NAN = math.nan


def figure(value: float, low: float = NAN, high: float = NAN, runs: int = 20) -> Figure:
    return Figure(value, low, high, runs, 100)


class Outline(HTMLParser):
    """Tags in their order, with their attributes, and tags that were not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "source", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


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


TABLE = Table(["a", "b & c"], [Row(["x|\ny", 1]), Row(["z", 2.5], "missed")])


def test_table_as_markdown_and_for_a_terminal() -> None:
    assert TABLE.markdown() == ["| a | b & c |", "|---|---|", "| x\\| y | 1 |", "| z | 2.50 |"]
    assert Table(["a"], [], "title", "note").terminal() == ["title", "a", "note"]
    assert Table(["a", "long"], [["bcd", 1]]).terminal() == ["a    long", "bcd  1"]


def page(**more: Any) -> str:
    return html(Page("a <title>", "A <heading>", **{"sections": [PageSection("", "", ["first"])]} | more))


def test_cell_names_its_column_and_a_row_has_its_mark() -> None:
    shown = page(sections=[PageSection("two words", "what it is", [TABLE, "behind"])])
    assert '<h2 id="two-words">two words</h2>\n<p>What it is.</p>' in shown
    assert '<tr><th scope="row">x|\ny</th><td data-of="b &amp; c">1</td></tr>' in shown
    assert '<tr class="missed"><th scope="row">z</th>' in shown
    assert shown.index("two words</h2>") < shown.index("<table") < shown.index("<p>behind</p>")
    assert '<a href="#two-words">two words</a>' in shown


def test_page_is_sound_escapes_and_asks_for_nothing_outside() -> None:
    wide = Table(["<h>", "v", "c", "d", "e", "f"], [["<1>", 1, 2, 3, 4, 5]], "<t>", "<n>")
    parts: list[Part] = [
        "<s>", Items(["<i>"]), Folded("<f>", ["<in>"]), wide, Table(["a", "b"], [Row(["<0>", figure(1.0)])]),
        Table(["none"], []),
    ]  # fmt: skip
    shown = page(sections=[PageSection("<name>", "<about>", parts)], head=["<head>"], loud=[("<W>", "<text>")])
    outline = Outline(shown)
    assert outline.open == []
    tags = {tag for tag, _ in outline.tags}
    assert not tags & {
        "s",
        "i",
        "v",
        "f",
        "in",
        "h",
        "t",
        "n",
        "name",
        "about",
        "w",
        "text",
        "0",
        "script",
        "iframe",
        "1",
    }
    assert '<table class="wide">' in shown
    assert "url(" not in shown
    for _, of in outline.tags:
        for name in ("src", "srcset", "href"):
            assert (of.get(name) or "#").startswith(("#", "data:"))


def test_warning_comes_first_and_in_the_title() -> None:
    shown = page(loud=[("QUICK", "to look")], head=["a verdict"])
    assert "<title>QUICK a &lt;title&gt;</title>" in shown
    assert '<p class="loud" role="note"><strong>QUICK</strong>: to look</p>\n<p>a verdict</p>' in shown


def test_markdown_of_sections() -> None:
    sections = [
        PageSection("", "", ["one", "two"]),
        PageSection("s", "about it", [TABLE, "behind", Items(["x"])]),
        PageSection("bare", "", ["text"]),
    ]  # fmt: skip
    assert markdown(sections) == [
        "one", "two", "", "**s**: about it", "", *TABLE.markdown(), "", "behind", "", "- x", "", "**bare**", "", "text",
    ]  # fmt: skip


def drawn() -> Picture:
    def make(look: Any) -> Any:
        figure, axes = fields(look, 2, 1.0)
        for ax in axes:
            ax.plot([0, 1], label="line")
        legend(figure, look)
        return figure

    return Picture("A <picture>", "of a line", "It rises.", make)


def test_picture_is_there_in_every_look_with_words() -> None:
    shown = page(pictures=[drawn()])
    outline = Outline(shown)
    (image,) = [of for tag, of in outline.tags if tag == "img"]
    assert image["alt"] == "It rises."
    assert sum(tag == "source" for tag, _ in outline.tags) == len(LOOKS) - 1
    assert len(set(re.findall(r"base64,([^\"]+)", shown))) == len(LOOKS)


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


@pytest.mark.parametrize(
    ("value", "ends", "verdict"),
    [
        (0.91, (0.89, 0.93), MET), (0.91, (0.86, 0.93), MET_CHANCE), (0.91, (0.89, 0.96), MET_CHANCE),
        (0.86, (0.84, 0.88), CHANCE), (0.97, (0.94, 0.99), CHANCE),
        (0.84, (0.82, 0.86), MISSED), (0.98, (0.96, 1.0), MISSED),
    ],
)  # fmt: skip
def test_goal_with_two_ends_is_missed_beyond_either(value: float, ends: tuple[float, float], verdict: str) -> None:
    goal = Goal("x", figure(value, *ends), 0.87, at_least=True, up_to=0.95)
    assert goal.verdict == verdict
    assert "| ≥ 0.87 and ≤ 0.95 |" in "\n".join(table([goal.record()]).markdown())


def test_verdict_is_counted_what_is_missed_named_and_marked() -> None:
    judged = [
        Goal(f"s: goal {k} &", figure(v, v, v, runs), 1.0).record()
        for k, (v, runs) in enumerate([(0, 9), (0, 20), (2, 20)])
    ]
    shown = page(head=head(judged), sections=[PageSection("goals", "", [table(judged)])])
    assert "<p>Of 3 goals 1 met, 1 missed, 1 with too few runs to judge.</p>" in shown
    assert shown.index("<li>s: goal 2 &amp;</li>") < shown.index("<table")
    assert re.findall(r'<tr class="missed"><th scope="row">(.*?)</th>', shown) == ["s: goal 2 &amp;"]
    assert '<td data-of="bound" class="text">≤ 1</td>' in shown
    assert goals(judged).alt == "Verdicts by suite. s: 1 met, 1 missed, 1 too few runs to judge."


@pytest.mark.parametrize(("missed", "folded"), [(MAX_LISTED, False), (MAX_LISTED + 1, True)])
def test_many_missed_goals_are_folded_and_all_there(missed: int, folded: bool) -> None:
    shown = page(head=head([{"what": f"goal {k}", "verdict": MISSED} for k in range(missed)]))
    assert all(f"<li>goal {k}</li>" in shown for k in range(missed))
    assert ("<details>" in shown) == folded
