"""Two campaigns beside each other: what is paired, what is claimed, what is said of the rest."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.campaign.campaign_folder import CAMPAIGN, RESULTS, read_results
from sim_ecu.campaign.comparison.compare import (
    BETTER,
    CHANCE,
    DIFFERS,
    SAME,
    TOO_FEW,
    WORSE,
    Comparison,
    Result,
    compare,
)  # fmt: skip
from sim_ecu.campaign.comparison.shown import tables
from sim_ecu.campaign.comparison.worst import toml, worst
from sim_ecu.campaign.definition import load_campaign
from sim_ecu.campaign.kind import Metric, Type
from sim_ecu.jobs.job import Scalar
from tests.support.compared import FIGURES, folder, inputs, kind, steps
from wrcd.errors import InputError


def compared(first: Path, second: Path, names: list[str] | None = None, alpha: float = 0.05) -> Result:
    return compare(read_results(first), read_results(second), names, alpha, lambda _what, _share: None)


def of(result: Result, suite: str, figure: str) -> Comparison:
    return next(c for c in result.comparisons if (c.suite, c.figure.name) == (suite, figure))


def said(result: Result) -> str:
    return "\n".join(tables(result, worst(result)))


def test_worse_design_is_found_in_the_suite_where_it_is(tmp_path: Path) -> None:
    a = folder(tmp_path / "a", inputs(design="a.json"), steps(own=1))
    b = folder(tmp_path / "b", inputs(design="b.json"), steps(0.3, own=2))
    result = compared(a, b)
    assert {f: of(result, "leaf", f).verdict for f in ("mean_error_pp", "valid", "slip")} == {
        "mean_error_pp": WORSE, "valid": WORSE, "slip": DIFFERS,
    }  # fmt: skip
    assert {c.verdict for c in result.comparisons if c.suite == "dry"} <= {CHANCE, SAME, TOO_FEW}
    assert {of(compared(b, a), "leaf", f).verdict for f in ("mean_error_pp", "valid")} == {BETTER}
    found = of(result, "leaf", "mean_error_pp").found
    assert found.low < 0.3 < found.high
    assert found.difference == pytest.approx(0.3, abs=0.05)
    text = said(result)
    assert "Worse: leaf (mean_error_pp, valid). Differs: leaf (slip)." in text
    assert "Inputs that differ as a whole: design (a.json and b.json)." in text
    assert "Not compared, for they are no numbers or only one side has them: cause." in text


def test_same_design_on_other_seeds_is_within_chance_and_without_pairs(tmp_path: Path) -> None:
    a = folder(tmp_path / "a", inputs(design="a.json"), steps())
    b = folder(tmp_path / "b", inputs(design="a.json", seeds=range(101, 121)), steps())
    result = compared(a, b)
    assert result.claims == []
    assert of(result, "leaf", "mean_error_pp").count == (20, 20)
    assert not of(result, "leaf", "mean_error_pp").paired
    assert "Nothing differs by more than chance" in said(result)


def test_equal_campaigns_are_the_same(tmp_path: Path) -> None:
    a, b = (folder(tmp_path / n, inputs(design="a.json"), steps()) for n in "ab")
    result = compared(a, b)
    assert {c.verdict for c in result.comparisons} == {SAME}
    assert result.judged == 0
    assert worst(result) == ([], [])


def test_versions_of_the_code_are_paired_and_told(tmp_path: Path) -> None:
    a = folder(tmp_path / "a", inputs(), steps(), code="a" * 32)
    b = folder(tmp_path / "b", inputs(), steps(0.5), code="b" * 32)
    result = compared(a, b)
    assert of(result, "leaf", "mean_error_pp").verdict == WORSE
    assert "Their code differs: aaaaaaaaaaaa and bbbbbbbbbbbb." in said(result)


def test_few_seeds_are_too_few_worlds_however_many_points_they_have(tmp_path: Path) -> None:
    every = [{"rail": "leaf", "design": "x", "speed": float(v), "seed": 1} for v in range(30)]
    a, b = (
        folder(tmp_path / name, [i | {"design": name} for i in every],
               lambda i: {"mean_error_pp": i["speed"] % 7 + 0.1 * (i["design"] == "b")})
        for name in "ab"
    )  # fmt: skip
    result = compared(a, b)
    assert (of(result, "leaf", "mean_error_pp").clusters, of(result, "leaf", "mean_error_pp").verdict) == (1, TOO_FEW)
    assert result.judged == 0
    assert "Not judged, for too few worlds: 1 that differ, in leaf (1). A claim among 1 takes 6 worlds" in said(result)
    assert "Nothing differs" not in said(result)


@pytest.mark.parametrize("paired", [True, False])
def test_worlds_that_a_claim_takes_are_more_than_those_that_tell(tmp_path: Path, paired: bool) -> None:
    """Ten pairs of which four differ are four; of two samples the fewer worlds count."""
    seeds = range(1, 11 if paired else 4)
    every = inputs(("leaf",), seeds, design="x")
    other = inputs(("leaf",), seeds if paired else range(101, 104), design="b")

    def value(i: Mapping[str, Any]) -> dict[str, Scalar]:
        return {"mean_error_pp": 0.1 * i["seed"] + (i["design"] == "b") * (i["seed"] <= 4 or not paired)}

    result = compared(folder(tmp_path / "a", every, value), folder(tmp_path / "b", other, value))
    found = of(result, "leaf", "mean_error_pp")
    assert (found.verdict, found.count[0]) == (TOO_FEW, len(seeds))
    took, have = (4, 6) if paired else (3, 4)
    assert found.found.worlds == took
    words = "worlds in which a pair differs" if paired else "worlds a side"
    assert f"A claim among 1 takes {have} {words}, of which these have {took} at most: run more" in said(result)


def test_suite_of_too_few_worlds_is_named_beside_what_is_claimed(tmp_path: Path) -> None:
    few = [*inputs(("leaf",), design="a"), *inputs(("dry",), range(1, 4), design="a")]
    a = folder(tmp_path / "a", few, steps(own=1))
    b = folder(tmp_path / "b", [i | {"design": "b"} for i in few], lambda i: steps(0.3, own=2, rail=i["rail"])(i))
    text = said(compared(a, b))
    assert "Worse: leaf (mean_error_pp, valid). Differs: leaf (slip)." in text
    assert "Not judged, for too few worlds: 3 that differ, in dry (3)." in text


def test_better_of_the_jobs_that_are_left_is_no_better(tmp_path: Path) -> None:
    def told(job: Mapping[str, Any]) -> dict[str, Scalar]:
        if job["design"] == "b" and job["seed"] > 16:
            return {"mean_error_pp": math.nan}
        return {"mean_error_pp": 5.0 + job["seed"] % 3 - (job["design"] == "b")}

    a, b = (folder(tmp_path / name, inputs(("leaf",), design=name), told) for name in "ab")
    result = compared(a, b)
    assert of(result, "leaf", "without mean_error_pp").found.difference == pytest.approx(4 / 20)
    assert of(result, "leaf", "mean_error_pp").verdict == DIFFERS
    assert not [c for c in result.comparisons if c.figure.name == "valid"]  # neither side has any number


def test_bound_of_many_comparisons_hides_no_large_difference(tmp_path: Path) -> None:
    """As strict as ten thousand comparisons make it."""
    a = folder(tmp_path / "a", inputs(("leaf",), range(1, 31), design="a"), steps(own=1))
    b = folder(tmp_path / "b", inputs(("leaf",), range(1, 31), design="b"), steps(9.0, own=2))
    assert of(compared(a, b, alpha=1e-5), "leaf", "mean_error_pp").verdict == WORSE


def test_alpha_that_no_draws_can_tell_is_refused(tmp_path: Path) -> None:
    a, b = (folder(tmp_path / name, inputs(), steps()) for name in "ab")
    with pytest.raises(InputError, match=r"--alpha: 1e-09 among up to 14 comparisons .* fewer --figures"):
        compared(a, b, alpha=1e-9)


def test_lots_are_compared_run_by_run(tmp_path: Path) -> None:
    """Runs of a number share their conditions, whatever their lot: the worlds are the runs."""
    lots = kind(cluster=("lot", "seed"))
    a, b = (folder(tmp_path / str(lot), inputs(lot=lot), steps(own=lot), lots) for lot in (0, 1))
    result = compared(a, b)
    assert of(result, "leaf", "mean_error_pp").paired
    assert of(result, "leaf", "mean_error_pp").clusters == 20
    assert result.claims == []


def test_rows_of_one_side_are_named(tmp_path: Path) -> None:
    a = folder(tmp_path / "a", inputs(("leaf", "dry")), steps())
    b = folder(tmp_path / "b", inputs(("leaf", "snow"), range(1, 19)), steps())
    result = compared(a, b)
    assert [s.name for s in result.matched.suites] == ["leaf"]
    assert of(result, "leaf", "mean_error_pp").count == (18, 18)
    assert [len(side) for side in result.matched.alone] == [22, 18]
    assert '`rail = "dry", seed = 1`' in said(result)


def test_input_of_one_side_is_named_and_does_not_part_the_pairs(tmp_path: Path) -> None:
    a = folder(tmp_path / "a", inputs(), steps())
    b = folder(tmp_path / "b", inputs(lot=3), steps())
    result = compared(a, b)
    assert of(result, "leaf", "mean_error_pp").count == (20, 20)
    assert "Inputs that only the second has: lot." in said(result)


def test_endings_are_a_comparison_of_their_own(tmp_path: Path) -> None:
    well = steps()
    a = folder(tmp_path / "a", inputs(design="a"), well)
    b = folder(tmp_path / "b", inputs(design="b"), lambda i: {} if i["rail"] == "dry" and i["seed"] > 8 else well(i))
    result = compared(a, b)
    assert (of(result, "dry", "not done").verdict, of(result, "leaf", "not done").verdict) == (WORSE, SAME)
    assert of(result, "dry", "not done").found.second == pytest.approx(12 / 20)
    assert of(result, "dry", "mean_error_pp").count == (8, 8)
    jobs, others = worst(result)
    assert [(w.figure, w.first, w.second) for w in jobs] == [("ending", "done", "failed")] * 10
    assert others == []


def test_worst_jobs_are_those_that_differ_most_each_way(tmp_path: Path) -> None:
    def told(job: Mapping[str, Any]) -> dict[str, Scalar]:
        by = {3: 5.0, 7: 2.0, 9: -4.0}.get(job["seed"], 0.0) if job["design"] == "b.json" else 0.0
        return {"mean_error_pp": 10.0 + by + job["seed"] % 4, "valid": 1.0}

    a, b = (folder(tmp_path / n, inputs(("leaf",), design=f"{n}.json"), told) for n in "ab")
    second, first = worst(compared(a, b))
    assert [w.inputs["seed"] for w in second] == [3, 7]
    assert [(w.inputs["seed"], w.inputs["design"]) for w in first] == [(9, "a.json")]
    assert '# the other: "a.json"' in second[0].toml
    read_back = tomllib.loads(second[0].toml)
    assert read_back == {"kind": "drive", "first_seed": 3, "fixed": {"rail": "leaf", "design": "b.json"}}


def test_worst_jobs_without_pairs_are_beside_the_other_sides_median(tmp_path: Path) -> None:
    def told(job: Mapping[str, Any]) -> dict[str, Scalar]:
        return {} if job["seed"] == 105 else {"mean_error_pp": {7: 9.0, 103: 8.0}.get(job["seed"], 1.0)}

    a, b = (folder(tmp_path / str(k), inputs(("leaf",), range(k, k + 20)), told) for k in (1, 101))
    second, first = worst(compared(a, b))
    assert [(w.inputs["seed"], w.first, w.second) for w in second] == [(105, "", "failed"), (103, 1.0, 8.0)]
    assert [(w.inputs["seed"], w.first, w.second) for w in first] == [(7, 9.0, 1.0)]


def test_worst_job_as_toml_is_a_campaign_of_that_job(tmp_path: Path) -> None:
    asked: dict[str, Scalar] = {"suite": "paper", "group": "held at the peak", "run": 3, "lot": 1}
    file = tmp_path / "worst.toml"
    file.write_text(toml("score", asked, {"design": "b.json"}))
    assert [job.inputs for job in load_campaign(file).jobs] == [asked]


def test_fewer_figures_are_corrected_for_less(tmp_path: Path) -> None:
    a = folder(tmp_path / "a", inputs(design="a"), steps(own=1))
    b = folder(tmp_path / "b", inputs(design="b"), steps(own=2))
    one, every = compared(a, b, ["mean_error_pp"]), compared(a, b)
    assert {c.figure.name for c in one.comparisons} == {"mean_error_pp", "not done"}
    assert one.judged == 2 < every.judged
    with pytest.raises(
        InputError, match=r"--figures: 'cause' is no figure with numbers .* figures: mean_error_pp, valid, slip"
    ):
        compared(a, b, ["cause"])


def test_figure_of_one_version_is_named(tmp_path: Path) -> None:
    more = kind(figures=(*FIGURES, Metric("wear", Type.NUMBER, "energy", "kJ", "less")))
    a = folder(tmp_path / "a", inputs(), steps())
    b = folder(tmp_path / "b", inputs(), lambda i: {"wear": 1.0, **steps()(i)}, more)
    assert compared(a, b).left_out == ("cause", "wear")


@pytest.mark.parametrize(
    ("rail", "of_kind", "words"),
    [("leaf", "play", r"is of the kind play, and .* of drive — compare two of one kind"),
     ("dry", "drive", "shares no rail with")],
)  # fmt: skip
def test_campaigns_that_have_nothing_in_common_are_refused(tmp_path: Path, rail: str, of_kind: str, words: str) -> None:
    a = folder(tmp_path / "a", inputs(("leaf",)), steps())
    b = folder(tmp_path / "b", inputs((rail,)), steps(), kind(of_kind))
    with pytest.raises(InputError, match=words):
        compared(a, b)


def test_kind_without_suites_or_seeds_is_compared_as_one(tmp_path: Path) -> None:
    logs = replace(kind("log", cluster=()), suite="")
    every = [{"rail": f"{k}.log"} for k in range(10)]
    a = folder(tmp_path / "a", every, lambda i: {"mean_error_pp": float(len(i["rail"]))}, logs)
    b = folder(tmp_path / "b", every, lambda i: {"mean_error_pp": len(i["rail"]) + 1.0}, logs)
    result = compared(a, b)
    assert (of(result, "all", "mean_error_pp").verdict, of(result, "all", "mean_error_pp").count) == (WORSE, (10, 10))
    other = folder(tmp_path / "c", [{"rail": f"new{k}.log"} for k in range(12)], lambda i: {"mean_error_pp": 9.0}, logs)
    assert of(compared(a, other), "all", "mean_error_pp").count == (10, 12)


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (lambda f: (f / CAMPAIGN).unlink(), r"is no campaign's folder — name the folder of"),
        (lambda f: (f / CAMPAIGN).write_text("{"), r"campaign.json: cannot be read: JSONDecodeError"),
        (lambda f: (f / CAMPAIGN).write_text('{"format": "x"}'), r"has the format x, not wrcd-campaign/2"),
        (lambda f: (f / CAMPAIGN).write_text('{"format": "wrcd-campaign/1"}'), r"json: cannot be read: KeyError"),
        (lambda f: (f / CAMPAIGN).write_text((f / CAMPAIGN).read_text().replace('"number"', "1")), r"AttributeError"),
        (lambda f: (f / RESULTS).unlink(), r"results.parquet: is not there: the campaign has not come to its end"),
        (lambda f: (f / RESULTS).write_bytes(b"PAR1"), r"results.parquet: cannot be read"),
    ],
)  # fmt: skip
def test_folder_that_cannot_be_read_is_bad_input(tmp_path: Path, break_it: Any, message: str) -> None:
    a = folder(tmp_path / "a", inputs(), steps())
    break_it(a)
    with pytest.raises(InputError, match=message):
        read_results(a)
