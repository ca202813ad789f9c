"""[fusion]: where the axles stand, and the message that it brings."""

from pathlib import Path

import pytest

from wrcd.config import DEFAULT, load_config, load_packaged
from wrcd.core.vocabulary import MESSAGES
from wrcd.errors import InputError
from wrcd.tools.export.groups import sent_groups
from wrcd.tools.said import said

POSITIONS = "[fusion]\npositions_m = [0.0, -2.5, -19, -21.5]\n"


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
        ("[fusion]\npositions_m = [0.0, -2.5]\n", "fusion.positions_m: has 2 numbers for 4 axles"),
        ("[fusion]\npositions_m = [0, 1, 2, 1.0]\n", "fusion.positions_m: has two axles at one place"),
        ("[fusion]\npositions_m = 3\n", "fusion.positions_m: takes a list of numbers, not 3"),
        ("[fusion]\n", "fusion.positions_m: is missing"),
        (POSITIONS + "place = 1\n", "fusion.place: unknown key"),
    ],
)
def test_mistake_is_told_with_its_key(tmp_path: Path, own: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load(tmp_path, DEFAULT + own)


def test_message_is_read_and_exported_as_the_others_are() -> None:
    config = load_packaged(2, (0.0, -2.5))
    groups = {group.name: group for _, group in sent_groups(config)}
    assert [c.name for c in groups["AdhesionAhead_A2"].channels] == list(MESSAGES["ahead"])
    assert "AdhesionAhead_A1" in {message.name for message in said(config)}


def test_message_without_positions_is_refused(tmp_path: Path) -> None:
    text = DEFAULT.replace("number = 2\n", 'number = 2\nahead = "AdhesionAhead_A2"\n')
    with pytest.raises(InputError, match=r"axle\[2\].ahead: needs \[fusion\]"):
        load(tmp_path, text)
