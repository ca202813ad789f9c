"""Every mistake that a configuration can have is said with file, line, key, reason and advice, all at once."""

import re
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.unit.config.support import BASE, DBC, SECOND, SPEED, YAW, after, written
from wrcd.config.config import load_config, load_config_to_run
from wrcd.core.configuration import Config
from wrcd.errors import InputError

# a message that asks for a key, in words
ASKS = re.compile(
    r"is missing|states no|has no word (for|that is known)|tells of failures|no signal '(Validity|Mu)|lacks "
    r"|without a status"
)
# What is changed in BASE, and below it the messages, from the line on. A line takes the place of the one of its key, a
# new key and what is below a table's head come last; "->" stands where the key itself changes, with \n in what is new.
TABLE = DBC.parents[1] / "mistakes.txt"


class Case(NamedTuple):
    """A text, and what is said of it."""

    text: str
    messages: list[str]


def cases() -> list[Case]:
    """The table, parsed."""
    made, lines, added, messages = [], BASE.splitlines(), [""], [""]
    for line in [*TABLE.read_text(encoding="utf-8").splitlines(), "#"]:
        if line.startswith(" " * 8):
            messages[-1] += " " + line.strip()
        elif line.startswith(" " * 4):
            messages.append(line.strip())
        else:
            if len(messages) > 1:
                made.append(Case("\n".join([*lines, *added[1:]]) + "\n", messages[1:]))
                lines, added, messages = BASE.splitlines(), [""], [""]
            key, arrow, new = line.partition(" ->")
            key = key if arrow else line.partition(" = ")[0]
            at = [k for k, old in enumerate(lines) if (arrow and old == key) or old.startswith(f"{key} = ")]
            if at and not any(one.startswith("[") for one in added):
                lines[at[0]] = new.strip().replace(r"\n", "\n") if arrow else line
            elif not line.startswith("#"):
                added.append(line)
    return made


CASES = cases()
SHOWN = re.compile(r"write in (\[+)([a-z]+)\]+: (.*)")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(DBC, tmp_path)
    return tmp_path


@pytest.mark.parametrize("read", [load_config, load_config_to_run])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.messages[0].split(" — ")[0])
def test_mistake_is_said_whole(folder: Path, case: Case, read: Callable[[Path], Config]) -> None:
    path = folder / "train.toml"
    path.write_text(case.text)
    with pytest.raises(InputError) as error:
        read(path)
    assert error.value.status == 2
    assert str(error.value).replace(f"{folder}/mistake.dbc", "mistake.dbc").splitlines() == [
        f"{path}:{message}" for message in case.messages
    ]
    # each says file, line and key
    assert all(re.match(r"\d+: [a-z0-9_.\[\]]+: ", message) for message in case.messages)


def test_mistake_that_asks_for_a_key_shows_the_line_to_write() -> None:
    asking = [(case, message) for case in CASES for message in case.messages if ASKS.search(message)]
    assert len(asking) > 10
    for case, message in asking:
        shown = SHOWN.search(message)
        assert shown, message
        assert shown[1] == "[" * (1 + isinstance(tomllib.loads(case.text).get(shown[2]), list))
        # what follows the line in the message is another way out
        ends = [k for k, c in enumerate(shown[3], 1) if c in '"}]' or k == len(shown[3])]
        assert any(_is_toml(shown[3][:end]) for end in ends), message


def _is_toml(text: str) -> bool:
    try:
        return bool(tomllib.loads(text))
    except tomllib.TOMLDecodeError:
        return False


@pytest.mark.parametrize("of", ["shuts out 99 %", 'no word for "not available"'])
def test_line_that_is_shown_mends_the_mistake(folder: Path, of: str) -> None:
    """Copied as it is, where nothing in it has to be filled in."""
    ((text, (message,)),) = [case for case in CASES if of in case.messages[0]]
    number, _, _ = message.partition(":")
    lines = text.splitlines()
    lines[int(number) - 1] = message.partition("write in [[axle]]: ")[2]
    path = folder / "train.toml"
    path.write_text("\n".join(lines))
    load_config(path)


def test_line_that_is_shown_keeps_every_digit_of_the_file(folder: Path) -> None:
    scale = "scale = 0.017453292519943295"
    path = written(folder, [(YAW, f'yaw_rate = {{ signal = "Imu1.Gyro", {scale}, ok = [2] }}')])
    with pytest.raises(InputError, match=rf"write in \[\[axle\]\]: yaw_rate = .* {scale}, "):
        load_config(path)


def test_texts_of_the_cases_are_good_without_their_mistake(folder: Path) -> None:
    second = SECOND + 'adhesion = "Adhesion_A2"'
    extended = 'axle_load = "Extended.Load"\nwheel_radius = "Extended.Radius"\nbrake_torque = "Extended.Brake"'
    for edits in ([], [after(second)], [after(extended)], [(SPEED, 'speed = "Paged.V"')]):
        load_config(written(folder, edits))
