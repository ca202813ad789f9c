"""[fusion]: where the axles stand, and the message that it brings."""

from dataclasses import replace
from pathlib import Path

import pytest

from wrcd import resources
from wrcd.config.config import DEFAULT, load_config, load_packaged
from wrcd.config.describe import describe
from wrcd.core.vocabulary import MESSAGES
from wrcd.errors import InputError
from wrcd.estimator.design import load_design
from wrcd.logs.decoder import decoders
from wrcd.logs.exports import sent_groups

POSITIONS = "[fusion]\npositions_m = [0.0, -2.5, -19, -21.5]\none_way = true\n"
ONE = "one_way = true\n"


def load(folder: Path, text: str) -> list[str | None]:
    file = folder / "train.toml"
    file.write_text(text)
    config = load_config(file)
    return [a.ahead.message if a.ahead else None for a in config.axles]


def test_without_positions_there_is_no_fusion() -> None:
    config = load_packaged(4)
    assert config.positions_m is None
    assert [a.ahead for a in config.axles] == [None] * 4


def test_positions_bring_a_message_for_every_axle(tmp_path: Path) -> None:
    assert load(tmp_path, DEFAULT + POSITIONS) == [f"AdhesionAhead_A{a}" for a in (1, 2, 3, 4)]
    config = load_packaged(2, (0.0, -2.5))
    assert config.positions_m == (0.0, -2.5)
    assert [a.ahead.cycle_us for a in config.axles if a.ahead] == [20_000, 20_000]


@pytest.mark.parametrize(
    ("own", "said"),
    [
        ("[fusion]\npositions_m = [0.0, -2.5]\n" + ONE, "fusion.positions_m: has 2 numbers for 4 axles"),
        ("[fusion]\npositions_m = [0, 1, 2, 1.0]\n" + ONE, "fusion.positions_m: has two axles at one place"),
        ("[fusion]\npositions_m = [0, -1, -2, -401]\n" + ONE, "fusion.positions_m: has axles more than 400 m apart"),
        ("[fusion]\npositions_m = [0, -1, -2, -2.4]\n" + ONE, "fusion.positions_m: has axles less than 0.5 m apart"),
        ("[fusion]\npositions_m = 3\n" + ONE, "fusion.positions_m: takes a list of numbers, not 3"),
        ("[fusion]\n" + ONE, "fusion.positions_m: is missing"),
        (POSITIONS + "place = 1\n", "fusion.place: unknown key"),
        (POSITIONS.replace(ONE, ""), "fusion.one_way: is not true, and vehicle.direction names no signal"),
    ],
)
def test_mistake_is_told_with_its_key(tmp_path: Path, own: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load(tmp_path, DEFAULT + own)


def test_message_is_read_and_exported_as_the_others_are() -> None:
    config = load_packaged(2, (0.0, -2.5))
    groups = {group.name: group for _, group in sent_groups(config)}
    assert [c.name for c in groups["AdhesionAhead_A2"].channels] == list(MESSAGES["ahead"])
    assert "AdhesionAhead_A1" in {message.name for message in decoders(config)}


def test_message_without_positions_is_refused(tmp_path: Path) -> None:
    text = DEFAULT.replace("number = 2\n", 'number = 2\nahead = "AdhesionAhead_A2"\n')
    with pytest.raises(InputError, match=r"axle\[2\].ahead: needs \[fusion\]"):
        load(tmp_path, text)


def test_constant_speed_is_refused(tmp_path: Path) -> None:
    text = DEFAULT.replace('speed = "VehicleSpeed.Speed"\n', "") + "[limits]\nconstant_speed_m_s = 20\n"
    load(tmp_path, text)
    with pytest.raises(InputError, match=r"fusion.positions_m: needs a speed that is heard"):
        load(tmp_path, text + POSITIONS)


def test_design_of_another_tick_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "train.toml"
    file.write_text(DEFAULT + POSITIONS)
    design = replace(load_design(resources.DESIGN), tick_s=0.01)
    monkeypatch.setattr("wrcd.config.config.load_design", lambda _: design)
    with pytest.raises(InputError, match="takes a design with a tick of 5 ms, not 10 ms"):
        load_config(file)


def own_dbc(folder: Path, *without: str) -> str:
    """A configuration of a train's own DBC: the packaged one, whose messages or words of these names are others."""
    text = resources.DBC.read_text(encoding="utf-8")
    for name in without:
        text = text.replace(name, "X" + name[1:])
    (folder / "own.dbc").write_text(text, encoding="utf-8")
    return DEFAULT + '[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n'


def test_dbc_that_can_tell_nothing_is_refused(tmp_path: Path) -> None:
    text = own_dbc(tmp_path, "AdhesionAhead_A", "DropAhead")
    load(tmp_path, text)
    with pytest.raises(InputError, match=r"fusion.positions_m: would be told by nothing"):
        load(tmp_path, text + POSITIONS)


def test_axle_that_nothing_tells_is_a_warning(tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    file.write_text(own_dbc(tmp_path, "AdhesionAhead_A3", "DropAhead") + POSITIONS)
    assert [w for w in load_config(file).warnings if "fusion" in w] == [
        "fusion: axle 3 sends neither AdhesionAhead nor DropAhead: it is never warned"
    ]


def test_check_says_who_leads() -> None:
    lines = describe(load_packaged(3, (-21.5, 0.0, -2.5)))
    assert "fusion         axle 2 leads, axle 3 2.5 m behind, axle 1 21.5 m behind; one way alone" in lines
