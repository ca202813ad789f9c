"""Designs by name or by file: in the configuration, of a replay, of a report; and what a design says of its worlds."""

import json
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.cli.main import main as rig_main
from sim_ecu.resources import PAPER_DESIGN
from sim_ecu.score.run_score import paper_form_of
from tests.support.scenarios import LogOf, held
from wrcd import resources
from wrcd.checksum import checksum
from wrcd.cli.main import main
from wrcd.config.config import DEFAULT, load_config, load_packaged
from wrcd.config.describe import describe
from wrcd.config.packaged_designs import design_path, packaged_designs
from wrcd.core.design import MAX_SENTENCE, MAX_WORLDS, load_design
from wrcd.errors import InputError

LONE_WHEELSET = resources.DESIGNS / "lone-wheelset.design.json"
WORLDS = ["For a multiple unit of 48 t.", "Creep slopes from half to twice those of the friction."]


def changed(file: Path, **keys: Any) -> Path:
    """A copy of the lone wheelset's design, some keys otherwise."""
    document = {**json.loads(LONE_WHEELSET.read_text()), **keys}
    file.write_text(json.dumps({**document, "checksum": checksum(document)}))
    return file


def configured(folder: Path, design: str) -> Path:
    file = folder / "train.toml"
    file.write_text(f'{DEFAULT}[estimator]\ndesign = "{design}"\n')
    return file


def test_every_packaged_design_is_found_by_its_name_and_the_default_is_one() -> None:
    assert resources.DEFAULT_DESIGN in packaged_designs()
    assert design_path(resources.DEFAULT_DESIGN) == resources.DESIGN
    assert {design_path(name) for name in packaged_designs()} == set(resources.DESIGNS.iterdir())
    assert all(load_design(design_path(name)).rules.size for name in packaged_designs())


@pytest.mark.parametrize("given", ["my.json", "lone-wheelset.json", "./mine", "designs/lone-wheelset"])
def test_path_is_a_file_in_the_folder(given: str) -> None:
    assert design_path(given, Path("/srv")) == Path("/srv") / given
    assert design_path("/etc/my", Path("/srv")) == Path("/etc/my")


def test_configuration_names_a_packaged_design_or_a_file_beside_it(tmp_path: Path) -> None:
    assert load_config(configured(tmp_path, "lone-wheelset")).design_file == LONE_WHEELSET
    own = changed(tmp_path / "mine.json", name="mine")
    assert load_config(configured(tmp_path, "mine.json")).design.name == "mine"
    assert load_config(configured(tmp_path, str(own))).design_file == own


def test_unknown_design_in_a_configuration_is_an_error_among_its_others(tmp_path: Path) -> None:
    file = configured(tmp_path, "lone-wheel")
    file.write_text(f"{file.read_text()}[limits]\nmin_speed_m_s = -1\n")
    with pytest.raises(InputError) as error:
        load_config(file)
    first, second = str(error.value).splitlines()
    line = DEFAULT.count("\n") + 2
    assert first.startswith(f"{file}:{line}: estimator.design: ")
    assert "limits.min_speed_m_s" in second


def test_train_with_its_own_dbc_may_name_a_packaged_design(tmp_path: Path) -> None:
    (tmp_path / "own.dbc").write_bytes(resources.DBC.read_bytes())
    file = configured(tmp_path, "lone-wheelset")
    file.write_text(f'{file.read_text()}[dbc]\nfile = "own.dbc"\n')
    assert load_config(file).design_file == LONE_WHEELSET
    file.write_text(f'{DEFAULT}[dbc]\nfile = "own.dbc"\n')
    assert load_config(file, design_file=LONE_WHEELSET).design_file == LONE_WHEELSET
    with pytest.raises(InputError, match=r"dbc\.file: "):
        load_config(file)


def test_name_of_another_packaged_designs_wheelset_is_an_error_that_says_both_ways_out(tmp_path: Path) -> None:
    """A configuration of before, when the lone wheelset's design was the default, names the wheelset 'default'."""
    file = tmp_path / "train.toml"
    file.write_text(f'{DEFAULT}[wheelset]\nname = "default"\n')
    with pytest.raises(InputError) as error:
        load_config(file)
    own = load_design(resources.DESIGN).wheelset["name"]
    renamed, design = f'name = "{own}"', 'design = "lone-wheelset"'
    assert str(error.value).startswith(f"{file}:{DEFAULT.count(chr(10)) + 2}: wheelset.name: is 'default', but")
    assert str(error.value).endswith(
        f"— write in [wheelset]: {renamed}, if the train has that one; for 'default' write in [estimator]: {design}"
    )
    file.write_text(f"{DEFAULT}[wheelset]\n{renamed}\n")
    assert load_config(file).design_file == resources.DESIGN
    file.write_text(f'{DEFAULT}[wheelset]\nname = "default"\n[estimator]\n{design}\n')
    assert load_config(file).design_file == LONE_WHEELSET


def test_replay_takes_a_design_in_place_of_the_configurations(log_of: LogOf, tmp_path: Path) -> None:
    log = str(log_of(held("F")))
    other = changed(tmp_path / "other.json", polynomial=[0.5, 10.0])
    config = str(configured(tmp_path, "other.json"))
    made = {}
    for name, options in {
        "own": ["--config", str(configured(tmp_path, "lone-wheelset"))],
        "named": ["--design", "lone-wheelset"],
        "instead": ["--config", config, "--design", "lone-wheelset"],
        "file": ["--design", str(other)],
    }.items():
        configured(tmp_path, "lone-wheelset" if name == "own" else "other.json")
        out = tmp_path / f"{name}.log"
        assert main(["replay", log, *options, "-o", str(out)]) == 0
        made[name] = out.read_bytes()
    assert made["own"] == made["named"] == made["instead"] != made["file"]


def test_replay_into_the_design_is_refused(log_of: LogOf, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = changed(tmp_path / "mine.json")
    assert main(["replay", str(log_of(held("F"))), "--design", str(own), "-o", str(own)]) == 2
    assert "is the design itself" in capsys.readouterr().err


def test_design_for_another_wheelset_than_the_configuration_states_is_refused_by_replay(
    log_of: LogOf, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "train.toml"
    file.write_text(f'{DEFAULT}[wheelset]\nname = "metro"\n')
    assert main(["replay", str(log_of(held("F"))), "--config", str(file), "--design", "lone-wheelset"]) == 2
    assert "wheelset.name: is 'metro', but the design file" in capsys.readouterr().err


def test_only_a_packaged_design_has_the_papers_form_beside_it(tmp_path: Path) -> None:
    assert paper_form_of(LONE_WHEELSET) == PAPER_DESIGN
    assert paper_form_of(resources.DESIGNS / "none.design.json") is None
    assert paper_form_of(tmp_path / "lone-wheelset.design.json") is None


def test_check_and_explain_print_the_worlds_of_a_design(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = changed(tmp_path / "mine.json", name="mine", worlds=WORLDS)
    lines = describe(load_config(configured(tmp_path, "mine.json")))
    at = next(k for k, line in enumerate(lines) if line.startswith("wheelset "))
    assert lines[at + 1 : at + 3] == [f"worlds         {WORLDS[0]}", f"               {WORLDS[1]}"]
    assert f"design         {own}: mine, " in lines[at - 3]
    assert rig_main(["design", "--explain", str(own)]) == 0
    said = capsys.readouterr().out
    assert "\nFor the wheelset default: axle load 147.1 kN" in said
    assert "\nThe worlds that it was trained in:\n" + "".join(f"  {world}\n" for world in WORLDS) in said


def test_design_without_worlds_has_none(tmp_path: Path) -> None:
    document = json.loads(LONE_WHEELSET.read_text())
    document.pop("worlds", None)
    file = tmp_path / "old.json"
    file.write_text(json.dumps({**document, "checksum": checksum(document)}))
    assert load_design(file).worlds == ()
    assert not [x for x in describe(load_config(configured(tmp_path, "old.json"))) if x.startswith("worlds")]


def test_check_says_where_a_design_judges_no_sensors(tmp_path: Path) -> None:
    document = json.loads(LONE_WHEELSET.read_text())
    del document["health"]
    (tmp_path / "mine.json").write_text(json.dumps({**document, "checksum": checksum(document)}))
    assert "sensors        not judged: the design has no part for it" in describe(
        load_config(configured(tmp_path, "mine.json"))
    )
    assert not [x for x in describe(load_packaged(1)) if x.startswith("sensors ")]


@pytest.mark.parametrize(
    "worlds", ["one", [3], [""], ["two\nlines"], ["x" * (MAX_SENTENCE + 1)], ["x"] * (MAX_WORLDS + 1), {"a": "b"}, None]
)
def test_worlds_that_are_no_short_sentences_are_refused(tmp_path: Path, worlds: object) -> None:
    with pytest.raises(InputError, match="worlds: "):
        load_design(changed(tmp_path / "mine.json", worlds=worlds))
    full = ["x" * MAX_SENTENCE] * MAX_WORLDS
    assert load_design(changed(tmp_path / "mine.json", worlds=full)).worlds == tuple(full)
