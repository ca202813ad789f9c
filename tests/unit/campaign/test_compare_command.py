"""`sim-ecu compare` at the command line: tables, page, JSON, exit statuses."""

import json
from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from tests.support.compared import folder, inputs, steps
from tests.support.pages import ROOT, blocks


@pytest.fixture
def _folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder(Path("before"), inputs(design="before.json"), steps(own=1))
    folder(Path("after"), inputs(design="after.json"), steps(0.3, own=2))
    folder(Path("again"), inputs(design="again.json"), steps(own=3))


@pytest.mark.usefixtures("_folders")
@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("before after", 0),
        ("before after --fail-on worse", 1),
        ("after before --fail-on worse", 0),
        ("after before --fail-on any", 1),
        ("before again --fail-on any", 0),
        ("before after --figures slip --fail-on worse", 0),
        ("before after --alpha 1e-4 --fail-on any", 1),
    ],
)
def test_exit_status_says_what_was_asked(line: str, status: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", *line.split()]) == status
    assert ("Nothing differs" in capsys.readouterr().out) == ("again" in line)


@pytest.mark.usefixtures("_folders")
def test_gate_that_could_judge_nothing_does_not_pass(capsys: pytest.CaptureFixture[str]) -> None:
    for design in ("old", "new"):
        folder(Path(design), inputs(seeds=range(1, 4), design=design), steps(9.0 * (design == "new")))
    assert main(["compare", "old", "new"]) == 0
    assert main(["compare", "old", "new", "--fail-on", "worse"]) == 2
    captured = capsys.readouterr()
    assert "Nothing differs" not in captured.out
    assert "--fail-on: no comparison could be judged, for too few worlds" in captured.err


@pytest.mark.usefixtures("_folders")
@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("before never", "never: is no campaign's folder"),
        ("before after --alpha 1", "--alpha: takes a number between 0 and 1, not 1"),
        ("before after --figures eror", "--figures: 'eror' is no figure"),
        ("before after --figures ,", "--figures: names no figure"),
        ("before after --json never/a.json", "--json: no such folder"),
        ("before after --html .", "--html: is a folder"),
    ],
)
def test_bad_input_is_one_line_and_2(line: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", *line.split()]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.usefixtures("_folders")
def test_commands_of_the_page_give_tables_page_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    page_of = ROOT / "docs/how-to/compare-two-designs.md"
    for step in (b for b in blocks(page_of) if b.body.startswith("sim-ecu compare")):
        for command in step.commands:
            words = command.split()
            assert words[:2] == ["sim-ecu", "compare"]
            assert main(words[1:]) == (1 if "--fail-on" in words else 0)
    assert "| mean_error_pp | pp |" in capsys.readouterr().out
    found = json.loads(Path("compare.json").read_text(encoding="utf-8"))
    worse = [c for c in found["comparisons"] if c["verdict"] == "worse"]
    assert {(c["suite"], c["figure"]) for c in worse} == {("leaf", "mean_error_pp"), ("leaf", "valid")}
    assert len(found["worst_of_second"]) == 10
    page = Path("compare.html").read_text(encoding="utf-8")
    assert page.count("<img ") == 2
    assert "first_seed = " in page
    assert "://" not in page.replace("http://www.w3.org", "")
    assert "**" not in page
