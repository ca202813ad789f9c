"""DBCs as they are found: every form that cantools loads strictly, and faults of messages that nobody maps."""

import subprocess
import sys
import time
from pathlib import Path

import cantools
import pytest
from cantools.database.can import Database as AnyDatabase

from tests.support.dbc import told
from wrcd import resources
from wrcd.bus.dbc import find_message, load_dbc
from wrcd.bus.dbc_soundness import why_unsound
from wrcd.bus.dbc_text import huge_at, without_impossible_messages
from wrcd.errors import InputError

FOLDER = Path(__file__).parents[2] / "data" / "dbc"
ROOT = Path(__file__).parents[3]
SOUND = ("keywords", "multiplexed", "fd", "attributes")
UNSOUND = {
    "Overlap": "signals B and A overlap",
    "TooShort": "signal A does not fit in",
    "Twice": "there are 2 messages of this name",
    "One": "Other has the same id 0x325",
    "Other": "One has the same id 0x325",
    "NoBits": "signal A has no bits",
    "TooLargeId": "standard id 0x1000 has more than 11 bits",
    "TooLargeExtendedId": "extended id 0x60000000 has more than 29 bits",
    "LostTable": "VAL_ names a signal B, which it lacks",
    "LostType": "SIG_VALTYPE_ names a signal B, which it lacks",
}


@pytest.mark.parametrize("name", SOUND)
def test_form_that_cantools_loads_strictly_is_loaded_alike(name: str) -> None:
    expected = cantools.database.load_file(FOLDER / f"{name}.dbc", strict=True, encoding="utf-8")
    assert isinstance(expected, AnyDatabase)
    if name == "attributes":  # cantools keeps a receiver's time-out beside the signal
        signal = expected.messages[0].signals[1]
        assert signal.dbc is not None
        assert expected.dbc is not None
        assert expected.dbc.relation_attributes is not None
        signal.dbc.attributes.update(expected.dbc.relation_attributes.node_signal_relations[100][signal.name]["WRC"])
    found = load_dbc(FOLDER / f"{name}.dbc")
    assert [told(m) for m in found.messages] == [told(m) for m in expected.messages]
    assert (found.unsound, found.warnings) == ({}, ())


def test_fault_of_one_message_leaves_the_others_usable() -> None:
    database = load_dbc(FOLDER / "unsound.dbc")
    assert database.unsound == UNSOUND
    for name, reason in UNSOUND.items():
        with pytest.raises(ValueError, match=f"^message {name} cannot be used: {reason}$"):
            find_message(database, name)
    assert [s.name for s in find_message(database, "Motion").signals] == ["Yaw", "Side", "Effort", "V"]
    assert find_message(database, "Extended805").is_extended_frame


def test_faults_are_warnings_with_their_count() -> None:
    unusable, lost = load_dbc(FOLDER / "unsound.dbc").warnings
    assert unusable.startswith("messages that cannot be mapped: ")
    assert unusable.endswith("; and 5 more")
    assert lost == "statements about messages that there are not: VAL_ 4096 A, VAL_ 999 A"


def test_only_needed_messages_are_checked_where_they_are_named() -> None:
    assert "Overlap" not in load_dbc(FOLDER / "unsound.dbc", {"Motion"}).unsound
    assert load_dbc(FOLDER / "unsound.dbc", {"Overlap"}).unsound["Overlap"] == UNSOUND["Overlap"]


@pytest.mark.parametrize("name", [*SOUND, "unsound"])
def test_message_is_sound_where_cantools_strict_check_passes(name: str) -> None:
    for message in load_dbc(FOLDER / f"{name}.dbc").messages:
        try:
            message.refresh(strict=True)
        except cantools.database.errors.Error:
            assert why_unsound(message)
        else:
            assert why_unsound(message) is None


def test_message_is_left_out_whatever_its_indent_and_the_strings_behind_it() -> None:
    text = '  BO_ 4096 X: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\nCM_ "a \\" in it";\nBO_ 1 Y: 8 A\n'
    less, reasons = without_impossible_messages(text)
    assert (less, list(reasons)) == ('\n\nCM_ "a \\" in it";\nBO_ 1 Y: 8 A\n', ["X"])


def test_file_without_one_usable_message_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "own.dbc").write_text('VERSION ""\nBU_: A\nBO_ 4096 X: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n')
    with pytest.raises(InputError, match="more than 11 bits"):
        load_dbc(tmp_path / "own.dbc")


@pytest.mark.parametrize(
    ("encoding", "given"),
    [
        ("utf-8", None), ("utf-8-sig", None), ("cp1252", None), ("utf-16", None),
        ("utf-8", "utf-8"), ("utf-8-sig", "utf-8"), ("cp1252", "cp1252"),
    ],
)  # fmt: skip
def test_units_are_read_in_the_files_encoding(encoding: str, given: str | None, tmp_path: Path) -> None:
    text = (FOLDER / "keywords.dbc").read_text().replace('"Nm"', '"N·m"').replace('"N"', '"m/s²"')
    (tmp_path / "own.dbc").write_bytes(text.replace("\n", "\r\n").encode(encoding))
    effort = find_message(load_dbc(tmp_path / "own.dbc", encoding=given), "Effort")
    assert [s.unit for s in effort.signals] == ["N·m", "m/s²"]


def test_range_beyond_a_float_of_an_unmapped_signal_refuses_nothing(tmp_path: Path) -> None:
    """As canmatrix's j1939.dbc has it of the text of a driver's card."""
    text = (FOLDER / "keywords.dbc").read_text()
    signal = ' SG_ Card : 0|13824@1+ (1,0) [0|2.745744098767810851571364370E+4161] "" WRC\n'
    (tmp_path / "own.dbc").write_text(text + "BO_ 1 X: 1728 TCU\n" + signal)
    assert find_message(load_dbc(tmp_path / "own.dbc"), "Effort").signals


@pytest.mark.parametrize(
    "statement",
    [
        "BO_ 1 X: 10000 TCU\n",
        "BO_ 1 X: 8 TCU\n SG_ S : 1000000|8@1+ (1,0) [0|0] \"\" WRC\n",
        "BO_ 1 X: 8 TCU\n SG_ S : 0|1000000@1+ (1,0) [0|0] \"\" WRC\n",
        'BA_ "Cycle" BO_ 288 1e99999999;\n',
        'BA_ "Cycle" BO_ 288 "1e99999999";\n',
        "SG_MUL_VAL_ 288 A B 0-4294967295;\n",
        "SG_MUL_VAL_ 288 A B 1-1, 7-300000;\n",
        "SG_MUL_VAL_ 288 A B 1-99999999999999999999;\n",
        "SG_MUL_VAL_ 288 A B 0-99999;\nSG_MUL_VAL_ 288 A C 0-99999, 5-5;\n",
    ],
)  # fmt: skip
def test_size_beyond_all_use_is_refused_at_once(statement: str, tmp_path: Path) -> None:
    text = (FOLDER / "keywords.dbc").read_text()
    (tmp_path / "own.dbc").write_text(text + statement)
    began = time.process_time()
    with pytest.raises(InputError, match=r"own\.dbc:\d+: "):
        load_dbc(tmp_path / "own.dbc")
    assert time.process_time() - began < 1.0
    at = huge_at(text + statement)
    assert at is not None
    assert at >= len(text)


@pytest.mark.parametrize("file", [resources.DBC, ROOT / "dbc" / "sim_ecu.dbc"], ids=lambda p: p.stem)
def test_own_dbc_is_ascii_but_for_comments(file: Path) -> None:
    for line in file.read_bytes().splitlines():
        assert line.startswith(b"CM_ ") or line.isascii()


def test_own_dbc_loads_alike_in_every_usual_encoding() -> None:
    one, other = (
        cantools.database.load_file(resources.DBC, strict=True, encoding=encoding) for encoding in ("cp1252", "utf-8")
    )
    assert isinstance(one, AnyDatabase)
    assert isinstance(other, AnyDatabase)
    assert [told(m) for m in one.messages] == [told(m) for m in other.messages]


def test_cantools_writes_no_raw_lines_beside_our_warning(tmp_path: Path) -> None:
    path = tmp_path / "a.dbc"
    path.write_text('VERSION ""\nBU_: A\nBO_ 1 One: 8 A\n SG_ X : 0|8@1+ (1,0) [0|255] "" A\nBO_ 1 Two: 8 A\n')
    code = f"from pathlib import Path; from wrcd.bus.dbc import load_dbc; print(load_dbc(Path({str(path)!r})).warnings)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "same id" in done.stdout
    assert done.stderr == ""
