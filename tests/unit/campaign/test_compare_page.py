"""The script of docs/how-to/compare-two-designs.md, as the page has it, on two Parquet folders."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sim_ecu.campaign.kinds.score import SCORE
from tests.support.pages import run_by
from tests.support.processes import ROOT

PAGE = ROOT / "docs/how-to/compare-two-designs.md"
(STEP,) = run_by("tests/unit/campaign/test_compare_page.py", "docs/how-to/compare-two-designs.md")
TIMEOUT_S = 120


def rows(worlds: int, seed: int, **shifts: float) -> pd.DataFrame:
    """Runs of two suites in so many worlds; a world moves all of its figures, a seed a little of each."""
    rng, world = np.random.default_rng(seed), np.random.default_rng(1).normal(size=worlds)
    out = [
        {"suite": suite, "group": "a", "lot": lot % 2, "run": lot // 2, "ending": "done"}
        | {f: world[lot] + 0.1 * rng.normal() + shifts.get(f, 0.0) for f, t in SCORE.figures.items() if t is float}
        for suite in ("dead", "grid") for lot in range(worlds)
    ]  # fmt: skip
    return pd.DataFrame(out).sample(frac=1.0, random_state=seed)  # in any order


def compared(folder: Path, before: pd.DataFrame, after: pd.DataFrame) -> pd.DataFrame:
    """What the script prints."""
    script = re.search(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert script
    (folder / "compare.py").write_text(script[1])
    for name, found in (("before", before), ("after", after)):
        (folder / name / "rows").mkdir(parents=True)
        half = len(found) // 2
        for k, part in enumerate((found[:half], found[half:])):
            part.to_parquet(folder / name / "rows" / f"part-{k}.parquet")
    command = STEP.commands[0].replace("python ", f"{sys.executable} ")
    said = subprocess.run(command.split(), cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S, check=True)
    head, *lines = said.stdout.splitlines()[1:]
    names = ["figure", "before", "after", "change", "low", "high", "worlds", "p", "corrected p"]
    assert head.split() == " ".join(names).split()
    return pd.DataFrame([line.split() for line in lines], columns=names).set_index("figure").astype(float)


def test_difference_is_found_in_the_figure_that_has_one_and_its_interval_holds_it(tmp_path: Path) -> None:
    found = compared(tmp_path, rows(20, 2), rows(20, 3, mean_error_pp=0.3))
    assert found["worlds"].tolist() == [20] * len(found)
    moved = found.loc["mean_error_pp"]
    assert moved["corrected p"] < 0.001
    assert moved["low"] < 0.3 < moved["high"]
    assert moved["high"] - moved["low"] < 0.2  # of pairs: the worlds differ by ten times as much
    assert (found.drop("mean_error_pp")["corrected p"] > 0.05).all()
    assert (found["corrected p"] >= found["p"]).all()


def test_equal_sides_make_no_claim_and_runs_that_failed_are_left_out_in_pairs(tmp_path: Path) -> None:
    before, after = rows(12, 2), rows(12, 2)
    after.loc[(after["suite"] == "dead") & (after["lot"] == 0) & (after["run"] == 0), list(SCORE.figures)[:9]] = None
    after.loc[after["run"] == 1, list(SCORE.figures)[:9]] = None
    found = compared(tmp_path, before, after)
    assert found.loc["valid", "worlds"] == 10  # two worlds have no run left, one has one
    assert found["change"].tolist() == [0.0] * len(found)
    assert found["corrected p"].tolist() == [1.0] * len(found)


def test_change_that_is_the_same_in_all_worlds_is_found_and_has_no_interval(tmp_path: Path) -> None:
    before, after = rows(12, 2), rows(12, 2)
    before["mean_error_pp"], after["mean_error_pp"] = 1.0, 2.0
    found = compared(tmp_path, before, after)
    assert found.loc["mean_error_pp", "corrected p"] < 0.05
    assert found[["low", "high"]].isna().all(axis=None)


@pytest.mark.parametrize("name", ["FIGURES", "PAIRED", "WORLD"])
def test_columns_of_the_script_are_those_of_the_kind(name: str) -> None:
    (line,) = (line for line in PAGE.read_text().splitlines() if line.startswith(f"{name} = "))
    columns = {*SCORE.figures} if name == "FIGURES" else {f.name for f in SCORE.factors}
    assert set(ast.literal_eval(line.partition("=")[2].partition("#")[0].strip())) <= columns
