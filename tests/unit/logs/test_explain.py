"""Rules and moments in words."""

import csv
import re
from pathlib import Path

import pytest

from sim_ecu.cli.main import main as sim_ecu
from tests.support.scenarios import LogOf, held
from wrcd.cli.main import main as wrcd
from wrcd.core.causes import Cause
from wrcd.core.design import load_design
from wrcd.logs.rule_sentences import condition, sentence
from wrcd.resources import DESIGN


def test_explain_prints_every_rule_with_its_share_of_windows(capsys: pytest.CaptureFixture[str]) -> None:
    design = load_design(DESIGN)
    assert sim_ecu(["design", "--explain"]) == 0
    out = capsys.readouterr().out
    assert design.checksum[:12] in out
    assert len(design.rules) <= 100
    for rule in range(len(design.rules)):
        assert f"{rule + 1}. {sentence(design, rule)}" in out
    assert len(re.findall(r"windows' worth .* 90 % interval", out)) == len(design.rules)
    shares = [float(s) for s in re.findall(r"worth \(([\d.]+) %\)", out)]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) == pytest.approx(100.0, abs=3.0)


def test_rule_sentence_names_its_sets_and_output() -> None:
    design = load_design(DESIGN)
    text = sentence(design, 0)
    assert text.startswith("If residual 1 ")
    for sets, k in zip(design.sets, design.rules[0], strict=True):
        assert sets.names[k] in text
    assert f" % (output {design.bases[0]:.0f})" in text


def test_replay_explain_names_model_and_rule_of_each_slot(log_of: LogOf, tmp_path: Path) -> None:
    log = log_of(held("F"))
    assert wrcd(["replay", str(log), "--explain", "--csv", str(tmp_path / "a.csv"), "-o", str(tmp_path / "a.log")]) == 0
    with (tmp_path / "a.csv").open() as file:
        rows = [r for r in csv.DictReader(file) if r["axle"] == "1"]
    design = load_design(DESIGN)
    last = rows[-1]
    number, text = last["dominant_rule"].split(": ", 1)
    assert text == sentence(design, int(number) - 1)
    assert condition(design, int(number) - 1) in text
    model, name = last["winning_model"].split(": ")
    assert design.model_names[int(model) - 1] == name
    assert 0.0 < float(last["rule_share"]) <= 1.0
    assert rows[0]["dominant_rule"] == ""  # nothing is known yet
    assert rows[0]["cause"] == Cause.INPUT_SILENT.words
    assert {r["cause"] for r in rows if r["validity"] == "NotAvailable"} >= {Cause.WARMING_UP.words}
    assert {r["cause"] for r in rows if r["validity"] == "Valid"} == {""}

    # without being asked for, the table is as it was
    assert wrcd(["replay", str(log), "--csv", str(tmp_path / "b.csv")]) == 0
    assert "dominant_rule" not in (tmp_path / "b.csv").read_text().splitlines()[0]
