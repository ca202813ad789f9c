"""The page as text: escaped, self-contained, small."""

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from tests.support.story import adhesion, axle, story
from tests.support.story_columns import synthetic
from wrcd.config.config import load_packaged
from wrcd.core.causes import Cause, Validity
from wrcd.logs.log_comparison import compare
from wrcd.logs.story_records import Finding, MessageStatistics
from wrcd.report import report_page
from wrcd.report.contents import causes, differences
from wrcd.report.data import tables
from wrcd.report.report_plots import parts, validity_words

MAX_BYTES = 10_000_000
EVIL = '<img src=x onerror="alert(1)"> & \'"</script><script>alert(2)</script>'


class Elements(HTMLParser):
    """All elements of a page with their attributes, and all text outside scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self._inside = tag if tag in ("script", "style") else ""

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if not self._inside:
            self.words.append(data)


@pytest.fixture(scope="module")
def small() -> str:
    return report_page.page(synthetic(30.0, 2), None)


def test_names_from_files_are_text_and_never_elements() -> None:
    story = synthetic(20.0, 1)
    message = MessageStatistics(0x123, EVIL, EVIL, 1, 1.0, 1.0, story.begin_us, 1.0, 0)
    story = replace(
        story, log=Path(EVIL.replace("/", ":")), channel=EVIL, source=EVIL, warnings=(EVIL,), versions={EVIL: EVIL},
        verdict=(Finding("bad", EVIL, 0, story.begin_us, story.end_us), Finding(EVIL, EVIL)),
        bus=replace(story.bus, messages=(message,)), config=replace(story.config, file=EVIL),
    )  # fmt: skip
    found = Elements(report_page.page(story, replace(story, log=Path("b<b>.log"))))
    assert not [a for tag, a in found.found if tag == "img" or any(name.startswith("on") for name in a)]
    assert sum(tag == "script" and "data-table" not in a and "id" not in a for tag, a in found.found) == 3
    assert EVIL in found.words


def test_nothing_is_asked_of_a_network(small: str) -> None:
    found = Elements(small)
    for tag, attributes in found.found:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            assert (attributes.get(name) or "data:").startswith("data:"), (tag, attributes)
    assert "@import" not in small.split("<script")[0]
    policy = next(a["content"] for tag, a in found.found if a.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe-eval" not in policy
    assert "http" not in policy


def test_policy_names_the_hash_of_every_script(small: str) -> None:
    scripts = re.findall(r"<script>(.*?)</script>", small, flags=re.DOTALL)
    assert len(scripts) == 3
    for script in scripts:
        assert f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" in small


def test_verdict_comes_before_plots_and_findings_are_clickable(small: str) -> None:
    assert small.index('id="verdict"') < small.index("<figure")
    assert 'class="fall go" data-axle="1" data-begin="9.300000" data-end="9.700000"' in small


def test_every_plot_has_words_for_who_cannot_see_it(small: str) -> None:
    plots = [a for tag, a in Elements(small).found if a.get("role") == "img"]
    assert len(plots) >= 15
    assert all(a["aria-label"] for a in plots)


def test_page_of_an_axle_without_details_truth_and_inputs_is_whole() -> None:
    story = synthetic(20.0, 1)
    bare = replace(story.axles[0], detail=None, health=None, truth=None)
    story = replace(
        story, axles=(bare,), speed=None, distance=None, torque={}, status=None, rejects=None, link=None, falls=(),
        verdict=(),
    )  # fmt: skip
    text = report_page.page(story, None)
    assert 'data-plot="axle1.time"' in text
    assert 'data-plot="axle1.distance"' not in text
    assert 'data-plot="axle1.residuals"' not in text


def test_log_without_an_adhesion_frame_still_makes_a_page() -> None:
    story = synthetic(20.0, 1)
    a = story.axles[0].adhesion
    nothing = a.part(slice(0))
    story = replace(story, axles=(replace(story.axles[0], adhesion=nothing, events=()),), falls=())
    text = report_page.page(story, None)
    assert 'data-plot="axle1.time"' not in text
    assert "Configuration" in text


@pytest.mark.night
def test_hour_of_four_axles_is_at_most_ten_megabytes() -> None:
    text = report_page.page(synthetic(3600.0, 4), None)
    assert len(text.encode()) <= MAX_BYTES


def test_file_is_the_page_with_the_mark_near_its_start(tmp_path: Path) -> None:
    output = tmp_path / "report.html"
    story = synthetic(10.0, 1)
    report_page.write(story, None, output)
    assert f'content="{report_page.MARK}"' in output.read_text(encoding="utf-8")[:4096]


def test_two_sides_have_a_table_of_differences_and_both_verdicts() -> None:
    text = report_page.page(synthetic(30.0, 1), synthetic(30.0, 1, 2, "other.log"))
    assert "<h2>Differences</h2>" in text
    assert "Verdict of other.log" in text


def test_a_log_against_itself_differs_in_nothing() -> None:
    story = synthetic(30.0, 1)
    for d in differences(story, story):
        assert d.there == d.here or np.isnan(d.here), d
    assert next(d for d in differences(story, story) if "mean distance" in d.what).there == 0.0


def test_shift_of_the_estimate_is_told_where_both_are_valid() -> None:
    story = synthetic(30.0, 1)
    a = story.axles[0]
    other = replace(a, adhesion=replace(a.adhesion, available_pct=a.adhesion.available_pct + np.float32(2.0)))
    found = {
        d.what.split(",")[1].strip(): d
        for d in differences(story, replace(story, axles=(other,)))
        if "available" in d.what
    }
    assert found["mean distance of the two where both are Valid"].there == pytest.approx(2.0, abs=1e-3)
    assert found["median where Valid"].there - found["median where Valid"].here == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("cause", [c for c in Cause if c is not Cause.NONE])
def test_every_cause_has_a_word_in_the_strips(cause: Cause) -> None:
    assert validity_words()[64 + int(cause)][0] == cause.label
    assert validity_words()[int(cause)][1] == "none"


def test_cause_table_says_where_no_frame_came() -> None:
    story = synthetic(20.0, 1)
    a = story.axles[0]
    silent = replace(a.events[0], validity=Validity.NOT_AVAILABLE, cause=Cause.NONE, detail="no frame of wrcd")
    found = causes(replace(story, axles=(replace(a, events=(silent, *a.events[1:])),)))
    assert "no frame of wrcd" in {row[3] for row in found.rows}


def test_one_page_states_one_distance_of_its_two_sides() -> None:
    story, other = synthetic(30.0, 1), synthetic(30.0, 1, 2, "other.log")
    (compared,) = compare(story, other)
    found = {d.what: d.there for d in differences(story, other)}
    assert found["available, mean distance of the two where both are Valid"] == compared.mean_absolute_pp
    assert abs(compared.worst_pp) in [v for name, v in found.items() if "largest distance" in name]


def test_plot_holds_the_whole_interval() -> None:
    made = story(load_packaged(1), axle(adhesion(np.full(500, 38.0), half=12.0)))
    plots = [p for part in parts(tables(made), [1], ("a", "b")) for p in part.plots if p.title.startswith("Adhesion")]
    assert plots
    assert [p.high for p in plots] == [50.0] * len(plots)
