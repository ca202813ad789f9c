"""CAMPAIGN.toml: which jobs it asks for, and what is said of a mistake."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.campaign.definition import Campaign, load_campaign
from sim_ecu.jobs import digests
from tests.support.trial_kind import Write
from wrcd import resources
from wrcd.errors import InputError, InputErrors


def inputs(campaign: Campaign) -> list[dict[str, Any]]:
    return [dict(job.inputs) for job in campaign.jobs]


def test_full_factorial_has_every_combination_with_every_seed(write: Write) -> None:
    file = write("seeds = 2\nfirst_seed = 7", "level = 3", 'x = [1, 2.5]\nmode = ["plain", "fancy"]')
    found = load_campaign(file)
    assert [(i["x"], i["mode"], i["seed"]) for i in inputs(found)] == [
        (x, mode, seed) for x in (1.0, 2.5) for mode in ("plain", "fancy") for seed in (7, 8)
    ]
    assert {i["level"] for i in inputs(found)} == {3}
    assert list(found.columns.items()) == [("level", int), ("x", float), ("mode", str), ("seed", int)]
    assert found.title == "c"


def test_range_has_its_steps_from_end_to_end(write: Write) -> None:
    factor = "x = { from = 1, to = 100, steps = 3, log = true }\nlevel = { from = 0, to = 4, steps = 3 }"
    found = inputs(load_campaign(write(factor=factor)))
    assert [i["x"] for i in found][::3] == [1.0, 10.0, 100.0]
    assert [i["level"] for i in found][:3] == [0, 2, 4]


@pytest.mark.parametrize("log", [False, True])
def test_range_ends_where_it_is_said_to_however_many_digits_that_has(write: Write, log: bool) -> None:
    low, high = 0.100000000049, 0.99999999999
    factor = f"x = {{ from = {low}, to = {high}, steps = 2, log = {str(log).lower()} }}"
    first, second = (float(i["x"]) for i in inputs(load_campaign(write(factor=factor))))
    assert low <= first < second <= high


@pytest.mark.parametrize("method", ["random", "latin"])
def test_drawn_points_lie_in_their_ranges_and_follow_from_draw_alone(write: Write, method: str) -> None:
    factor = (
        'x = { from = 2, to = 4 }\n"scenario.speed" = { from = 10, to = 1000, log = true }\nmode = ["plain", "fancy"]'
    )
    head = f'method = "{method}"\npoints = 40'
    found = load_campaign(write(head, factor=factor))
    assert len(found.jobs) == 40
    assert all(2 <= i["x"] <= 4 and 10 <= i["scenario.speed"] <= 1000 for i in inputs(found))
    assert {i["mode"] for i in inputs(found)} == {"plain", "fancy"}
    assert load_campaign(write(head, factor=factor)).jobs == found.jobs
    other = load_campaign(write(f"{head}\ndraw = 2", factor=factor))
    assert [i["x"] for i in inputs(other)] != [i["x"] for i in inputs(found)]
    again = load_campaign(write(f"{head}\nfirst_seed = 2", factor=factor))
    assert inputs(again) == [i | {"seed": 2} for i in inputs(found)]


def test_latin_hypercube_has_one_point_in_each_stretch_of_a_range(write: Write) -> None:
    found = load_campaign(write('method = "latin"\npoints = 20', factor="x = { from = 0, to = 20 }"))
    assert sorted(int(i["x"]) for i in inputs(found)) == list(range(20))


def test_points_that_are_drawn_twice_run_once(write: Write) -> None:
    assert len(load_campaign(write('method = "random"\npoints = 50', factor="x = [1, 2, 3]")).jobs) == 3


def test_key_of_a_job_is_of_its_files_contents_and_the_code(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "a.txt").write_text("one")
    file = write(fixed='file = "own/a.txt"', factor="x = [1]")
    first = load_campaign(file).jobs[0]
    assert first.inputs["file"] == "own/a.txt"  # as it is written, wherever the campaign lies
    assert first.given["file"] == str(tmp_path / "own/a.txt")
    assert load_campaign(file).jobs[0].key == first.key
    (tmp_path / "own" / "a.txt").write_text("another")
    assert load_campaign(file).jobs[0].key != first.key
    (tmp_path / "own" / "a.txt").write_text("one")
    monkeypatch.setattr(digests, "code", lambda: "other")
    assert load_campaign(file).jobs[0].key != first.key


OF_KINDS = {
    "play": 'kind = "play"\n[fixed]\nscenario = "dry"\n',
    "drive": 'kind = "drive"\n[fixed]\nscenario = "brake-greasy"\ndaemon = true\n',
    "score": 'kind = "score"\n[fixed]\nsuite = "drops"\ngroup = "down"\nrun = 0\n',
}


@pytest.mark.parametrize("kind", OF_KINDS)
def test_design_with_a_suffix_is_a_file_beside_the_campaign(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text(f'{OF_KINDS[kind]}design = "mine.json"\n')
    with pytest.raises(InputError, match=r"mine\.json: "):
        load_campaign(file)
    shutil.copy(resources.DESIGN, tmp_path / "mine.json")
    (job,) = load_campaign(file).jobs
    assert list(job.files) == [str(tmp_path / "mine.json")]
    (tmp_path / "mine.json").write_text("{}")
    with pytest.raises(InputError, match=r"mine\.json: "):  # it is this one that is read
        load_campaign(file)


@pytest.mark.parametrize("kind", OF_KINDS)
def test_packaged_scenario_and_design_are_no_files_of_a_job(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text(f'{OF_KINDS[kind]}design = "lone-wheelset"\n')
    (job,) = load_campaign(file).jobs
    assert not job.files


@pytest.mark.parametrize("kind", OF_KINDS)
def test_unknown_design_of_a_campaign_is_an_error_at_its_line(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text(f'{OF_KINDS[kind]}design = "lone-wheel"\n')
    line = len(file.read_text().splitlines())
    with pytest.raises(InputError, match=rf"c.toml:{line}: fixed.design: "):
        load_campaign(file)


def test_keys_of_a_table_may_be_written_without_quotes(write: Write) -> None:
    file = write(fixed="scenario.speed = 20.0", factor="x = [1]\nscenario.on = [true, false]")
    found = inputs(load_campaign(file))
    assert [(i["scenario.speed"], i["scenario.on"]) for i in found] == [(20.0, True), (20.0, False)]


@pytest.mark.parametrize(
    ("head", "fixed", "factor", "words"),
    [
        ("seed = 3", "", "x = [1]", "c.toml:2: seed: "),
        ("points = 3", "", "x = [1]", "c.toml:2: points: "),
        ("draw = 3", "", "x = [1]", "c.toml:2: draw: "),
        (
            'method = "latn"',
            "",
            "x = [1]",
            "c.toml:2: method: ",
        ),
        ('method = "latin"', "", "x = { from = 1, to = 2 }", "c.toml: points: "),
        ("seeds = 0", "", "x = [1]", "c.toml:2: seeds: "),
        ("limit_s = 0", "", "x = [1]", "c.toml:2: limit_s: "),
        ("", "modus = 1", "x = [1]", "c.toml:4: fixed.modus: "),
        ("", "seed = 1", "x = [1]", "c.toml:4: fixed.seed: "),
        ("", 'mode = "fany"', "x = [1]", "c.toml:4: fixed.mode: "),
        ("", "level = 1.5", "x = [1]", "c.toml:4: fixed.level: "),
        ("", "x = 1", "x = [1]", "c.toml:6: factor.x: "),
        ("", '"scenario.a" = 1\nscenario.a = 2', "x = [1]", "c.toml:5: fixed.scenario.a: "),
        ("", "", 'x = [1]\n"scenario.a" = [1]\nscenario.a = [2]', "factor.scenario.a: "),
        ("", "", "level = [1]", "factor.x: "),
        ("", "", "x = 1", "c.toml:6: factor.x: "),
        ("", "", "x = []", "c.toml:6: factor.x: "),
        ("", "", "x = [1, 2, 1.0]", "c.toml:6: factor.x: "),
        ("", "", "x = [nan]", "c.toml:6: factor.x: "),
        ("", "", 'x = ["a"]', "c.toml:6: factor.x: "),
        ("", "", "x = { from = 1, to = 2 }", "c.toml:6: factor.x.steps: "),
        ("", "", "x = { from = 1, to = 2, step = 3 }", "c.toml:6: factor.x.step: "),
        ("", "", "x = { from = 2, to = 1, steps = 2 }", "c.toml:6: factor.x.from: "),
        (
            "",
            "",
            "x = { from = 0, to = 1, steps = 2, log = true }",
            "factor.x.from: ",
        ),
        ("", "", 'x = [1]\n"scenario.a" = [1, "b"]', "c.toml:7: factor.scenario.a: "),
        ("", "", "x = [1]\non = { from = 1, to = 2, steps = 2 }", "factor.on: "),
        ("", "", "x = [1, 200]", "c.toml:6: factor.x: "),
        ("", '"scenario.seed" = 1', "x = [1]", "c.toml:4: fixed.scenario.seed: "),
        ("", "", "x = [1]\nlevel = { from = 1.5, to = 2, steps = 2 }", "factor.level: "),
        ("", 'file = "never.txt"', "x = [1]", "never.txt: "),
        ("seeds = 1000000", "", "x = [1, 2]", "c.toml: there are 2000000 jobs"),
    ],
)
def test_mistake_is_told_with_its_place(write: Write, head: str, fixed: str, factor: str, words: str) -> None:
    with pytest.raises(InputError) as e:
        load_campaign(write(head, fixed, factor))
    assert words in str(e.value)
    assert not isinstance(e.value, InputErrors)


def test_all_mistakes_are_told_at_once(write: Write) -> None:
    with pytest.raises(InputErrors) as e:
        load_campaign(write("seeds = 0\npoint = 3", "modus = 1\nlevel = true", "x = []"))
    assert [error.line for error in e.value.errors] == [2, 3, 5, 6, 8]


@pytest.mark.parametrize(
    ("text", "words"),
    [('kind = "trail"', "c.toml:1: kind: "),
     ("", "c.toml: kind: ")],
)  # fmt: skip
def test_kind_that_is_none_is_told(tmp_path: Path, trial: None, text: str, words: str) -> None:
    file = tmp_path / "c.toml"
    file.write_text(text)
    with pytest.raises(InputError) as e:
        load_campaign(file)
    assert words in str(e.value)
