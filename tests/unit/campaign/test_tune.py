"""`sim-ecu tune` from end to end, small: real candidates, designs and runs, in processes of their own."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sim_ecu.campaign.tune import finalists, go, played
from sim_ecu.campaign.tune.designs import Designs, save
from sim_ecu.cli import main
from sim_ecu.design.brief import read_brief
from sim_ecu.design.make import Brief, in_papers_form
from sim_ecu.design.source import Source
from sim_ecu.score.suites.run import Run
from wrcd.errors import InputError
from wrcd.settings import read_toml

TINY = "[design]\ngrid = 48\nmax_rules = 16\n[plan]\nspeeds = 2\nper_speed = 12\n"
SECONDS = {"grid": 2.5, "drops": 5.6, "dry-hours": 1.0}
ENOUGH = 7  # runs of a suite that an interval needs


def short(make: Callable[..., list[Run]], runs: int) -> Callable[..., list[Run]]:
    """So many runs of each suite, of one axle, and not to their ends."""

    def made(*given: Source | int) -> list[Run]:
        every = make(*given)
        return [_cut(r, seconds) for s, seconds in SECONDS.items() for r in [r for r in every if r.suite == s][:runs]]

    return made


def _cut(r: Run, seconds: float) -> Run:
    return replace(r, scenario=replace(r.scenario, duration_s=seconds, axles=r.scenario.axles[:1]), curves=r.curves[:1])


def test_command_searches_plays_and_says_whether_it_reaches_a_design(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(finalists, "training", short(played.training, 1))
    monkeypatch.setattr(go, "test", short(played.test, 1))
    tiny, out = tmp_path / "tiny.toml", tmp_path / "out"
    tiny.write_text(TINY)
    command = ["tune", "--config", str(tiny), "-o", str(out), "--over", "points", "--budget", "2", "--played", "2"]
    command += ["--jobs", "1"]
    assert main(command) == 1
    said = capsys.readouterr().out
    result = json.loads((out / "tune.json").read_text())
    assert result["played"][0]["name"] == "start"
    assert result["chosen"] in result["front"]
    assert len(result["played"]) == 2
    assert result["candidates"]["best"] <= result["candidates"]["start"]
    assert set(result["test"]["differences"]) == {"start", "tuned"}
    assert result["test"]["verdict"] == "cannot tell"  # by one run of a suite
    assert f"{out / 'tuned.design.json'}: cannot tell" in said
    brief = read_brief(read_toml(out / "brief.toml"))
    assert (brief.max_rules, brief.plan.speeds) == (16, 2)
    assert "mean error (pp)" in (out / "brief.toml").read_text()
    # the same question: only what a kill would have lost is worked out again, and the answer is the same
    kept = [out / name for name in ("journal.jsonl", "brief.toml", "tuned.design.json")]
    journal, *files = (f.read_bytes() for f in kept)
    kept[0].write_bytes(journal[: journal.index(b"\n", journal.index(b"\n") + 1) - 5])  # half of the second candidate
    assert main(command) == 1
    assert sorted(kept[0].read_bytes().splitlines()) == sorted(journal.splitlines())
    assert [f.read_bytes() for f in kept[1:]] == files
    again = json.loads((out / "tune.json").read_text())
    assert again | {"seconds": 0} == result | {"seconds": 0}
    # a design against itself, on enough runs: the start's, which all three are
    monkeypatch.setattr(go, "test", short(played.test, ENOUGH))
    itself = tmp_path / "itself.json"
    itself.write_bytes(Path(result["played"][0]["design"]).read_bytes())
    capsys.readouterr()
    assert main([*command, "--budget", "1", "--played", "1", "--against", str(itself)]) == 0
    assert "tuned.design.json: equals" in capsys.readouterr().out
    assert len(kept[0].read_bytes().splitlines()) == len(journal.splitlines()) + 3 * (ENOUGH - 1)  # each played once


def test_search_alone_writes_a_brief_of_the_papers_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tiny, out = tmp_path / "tiny.toml", tmp_path / "out"
    tiny.write_text("[plan]\nspeeds = 2\nper_speed = 2\n")
    command = ["tune", "--form", "paper", "--config", str(tiny), "--over", "noise", "--budget", "1", "--played", "0"]
    assert main([*command, "--jobs", "1", "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "1 candidate," in said
    assert "the matching residual" in said
    assert read_brief(read_toml(out / "brief.toml")).points == in_papers_form(Brief()).points  # the start itself
    assert not (out / "tuned.design.json").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--over", "noise,gain"], "--over: there is no 'gain'"),
        (["--over", "weights", "--form", "paper"], "--over: the paper's form has no weights"),
        (["--budget", "0"], "--budget: takes a whole number from 1 on"),
        (["--played", "-1"], "--played: takes a whole number from 0 on"),
        (["--seed", "40"], "--seed: takes a whole number from 0 to 39"),
        (["--config", "tramway"], "--config: there is no wheelset 'tramway'"),
        (["--config", "metro", "--against", "{design}"], "--against: has m_w"),
    ],
)
def test_what_cannot_be_searched_is_said_before_any_work(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from wrcd.resources import DESIGN

    out = tmp_path / "out"
    assert main(["tune", "-o", str(out), *(a.format(design=DESIGN) for a in arguments)]) == 2
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_folder_that_is_a_file_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "out"
    file.write_text("")
    assert main(["tune", "-o", str(file)]) == 2
    assert "-o: cannot be made" in capsys.readouterr().err


def test_designs_that_cannot_be_kept_are_an_error(tmp_path: Path) -> None:
    (tmp_path / "designs").write_text("")
    with pytest.raises(InputError, match="designs: cannot be made: File exists"):
        Designs(tmp_path / "designs", lambda *_: None)
    (tmp_path / "tune.json").mkdir()
    with pytest.raises(InputError, match=r"tune\.json: cannot be written"):
        save(tmp_path / "tune.json", lambda partly: partly.write_text(""))


@pytest.mark.parametrize(
    "arguments", [["--search"], ["--search", "--budget", "600", "-o", "noise.toml"], ["--jobs", "2", "-o", "a.json"]]
)
def test_design_says_where_its_search_is_now(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", *arguments]) == 2
    assert "sim-ecu tune --over noise,weights --budget 600 --played 0" in capsys.readouterr().err
