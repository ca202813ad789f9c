"""What a reader of the report is told: values, explanations, two sides."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

from tests.browser.chromium import Opened, opened
from tests.browser.reading import chips, curves, frame, moment, plot, settle, shown_range
from tests.support.story_columns import BEGIN_US, synthetic
from wrcd.core.causes import Validity
from wrcd.logs.rule_sentences import sentence
from wrcd.logs.story_records import Story, Times
from wrcd.report import report_page as report

MAX_POINTS_PER_PX = 6  # of a curve: two a bin, a bin each two pixels, and what is drawn beyond both sides


def newest(time_us: Times, seconds: float) -> int:
    return int(np.searchsorted(time_us, BEGIN_US + round(seconds * 1e6), side="right")) - 1


def test_click_on_a_fall_zooms_there_and_explains_it(shown: Opened, story: Story) -> None:
    page = shown.page
    page.locator("button.fall", has_text="axle 2").first.click()
    settle(page)
    low, high = shown_range(page)
    assert 0.0 < low < 9.3
    assert 9.7 < high < 20.0
    assert moment(page) == pytest.approx(9.7, abs=0.001)
    axle, design, text = story.axles[1], story.config.design, page.locator("#explanation").inner_text()
    assert f"available {axle.adhesion.available_pct[newest(axle.adhesion.time_us, 9.7)]:.2f} %" in text
    assert axle.detail is not None
    row = newest(axle.detail.time_us, 9.7)
    rule, winner = int(axle.detail.rule[row]), int(axle.detail.winner[row])
    assert f"Rule {rule}: {sentence(design, rule - 1)}" in text
    assert f"Model {winner} ({design.model_names[winner - 1]}) fits best" in text
    assert "km/h" in text
    assert page.locator('#axles button[aria-checked="true"]').inner_text() == "axle 2"


def test_cursor_says_why_an_axle_is_not_valid(shown: Opened, story: Story) -> None:
    page = shown.page
    event = next(e for e in story.axles[0].events if e.validity is Validity.DEGRADED)
    page.locator("#overview table tr", has_text=event.cause.label).first.locator("button.go").click()
    settle(page)
    text = page.locator("#explanation").inner_text()
    assert "Degraded" in text
    assert f"{event.cause.label}: {event.cause.words}: {event.detail}." in text


def test_values_beside_curves_are_the_storys(shown: Opened, story: Story) -> None:
    page, a = shown.page, story.axles[0].adhesion
    box, (left, width) = plot(page, "axle1.time"), frame(page, "axle1.time")
    for seconds in (12.0, 33.3, 47.7):
        page.mouse.move(box["x"] + left + width * seconds / 60.0, box["y"] + 60)
        settle(page)
        assert moment(page) == pytest.approx(seconds, abs=0.1)
        place = newest(a.time_us, moment(page))
        near = slice(max(0, place - 1), place + 2)  # the moment is told to a millisecond
        for name, column in (("available", a.available_pct), ("in use", a.used_pct)):
            said = next(c for c in chips(page, "axle1.time") if c.startswith(name)).removeprefix(name).strip()
            assert said in {f"{v:.1f}" if np.isfinite(v) else "" for v in column[near]}


def test_cursor_in_a_gap_finds_no_frame(shown: Opened) -> None:
    page = shown.page
    box, (left, width) = plot(page, "axle1.time"), frame(page, "axle1.time")
    page.mouse.move(box["x"] + left + width * 22.5 / 60.0, box["y"] + 60)
    settle(page)
    assert "No Adhesion frame here" in page.locator("#explanation").inner_text()


def test_two_sides_are_drawn_and_explained(browser: Browser, story: Story, tmp_path: Path) -> None:
    output = tmp_path / "two.html"
    report.write(story, synthetic(60.0, 2, 2, "other.log"), output)
    with opened(browser, output) as found:
        page = found.page
        assert page.locator("#differences table tbody tr").count() >= 20
        page.locator("#verdict button.fall").first.click()
        settle(page)
        legend = chips(page, "axle1.time")
        assert any(re.fullmatch(r"available, run\.log [\d.]+", c) for c in legend)
        assert any(re.fullmatch(r"available, other\.log [\d.]+", c) for c in legend)
        text = page.locator("#explanation").inner_text()
        assert text.index("run.log") < text.index("other.log")
        assert found.complaints == []


def test_whole_log_is_drawn_by_bins_that_keep_extremes_and_a_zoom_by_frames(browser: Browser, tmp_path: Path) -> None:
    story = synthetic(900.0, 1)
    a = story.axles[0].adhesion
    a.available_pct[20_000] = 48.0  # one frame of 45 000
    output = tmp_path / "long.html"
    report.write(story, None, output)
    with opened(browser, output) as found:
        page = found.page
        box = plot(page, "axle1.time")
        whole = curves(page, "axle1.time")
        assert all(len(ys) <= MAX_POINTS_PER_PX * box["width"] for ys in whole)
        assert max(max(ys) for ys in whole[1:]) == pytest.approx(48.0, abs=0.006)
        page.locator("button.fall").first.click()
        plot(page, "axle1.time")
        low, high = shown_range(page)
        seconds = (a.time_us - BEGIN_US) / 1e6
        there = a.used_pct[(seconds > low) & (seconds < high)]
        drawn = np.array(curves(page, "axle1.time")[1])
        assert len(there) <= len(drawn) <= 2.0 * len(there)
        assert np.isin(np.rint(there * 100.0), np.rint(drawn * 100.0)).mean() > 0.99
        assert found.complaints == []


def test_html_in_names_and_texts_runs_nothing(browser: Browser, story: Story, tmp_path: Path) -> None:
    name = "<img src=x onerror=document.title='bad'>.log"
    evil = tuple(replace(e, detail="<b id=evil>x</b>") for e in story.axles[0].events)
    output = tmp_path / "evil.html"
    report.write(replace(story, log=Path(name), axles=(replace(story.axles[0], events=evil),)), None, output)
    with opened(browser, output) as found:
        page = found.page
        assert page.locator("h1").inner_text() == name
        page.keyboard.press("n")
        page.keyboard.press("n")
        settle(page)
        assert page.locator("#evil").count() == 0
        assert page.title() == f"{name}: wrcd report"
        assert found.complaints == []
