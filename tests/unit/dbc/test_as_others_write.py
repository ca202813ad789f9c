"""What others' tools write into a DBC, as public reports have it: check, lint and init read it alike."""

from collections.abc import Callable
from pathlib import Path

import pytest

from wrcd import resources
from wrcd.bus.dbc import attribute, data_id, find_message, find_signal, load_dbc, timeout_ms
from wrcd.cli.main import main
from wrcd.core.design import load_design
from wrcd.dbc import dbc_lines
from wrcd.dbc.lint.lint_file import findings

OWN = Path(__file__).parents[3] / "examples/own-dbc/train.dbc"
E2E = 'BA_DEF_ BO_ "E2EDataId" INT 0 65535;\nBA_DEF_DEF_ "E2EDataId" 0;\nBA_ "E2EDataId" BO_ 560 77;\n'
TIMEOUT = 'BA_DEF_ SG_ "GenSigTimeoutTime" INT 0 65535;\n'
RELATED = (
    'BA_DEF_REL_ BU_SG_REL_ "GenSigTimeoutTime" INT 0 65535;\nBA_DEF_DEF_REL_ "GenSigTimeoutTime" 0;\n'
    'BA_REL_ "GenSigTimeoutTime" BU_SG_REL_ WRCD SG_ 529 Effort 120;\n'
    'BA_REL_ "GenSigTimeoutTime" BU_SG_REL_ BCU SG_ 529 Effort 90;\n'
)
Written = Callable[..., Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """The example's DBC with more at its end, and with parts otherwise."""

    def write(more: str, **otherwise: str) -> Path:
        text = OWN.read_text()
        for name, new in otherwise.items():
            old = {"speed": ' SG_ V : 0|16@1+ (0.01,0) [0|400] "km/h" WRCD', "effort": " SG_ Effort : 0|16@1-"}[name]
            assert text.count(old) == 1
            text = text.replace(old, new)
        for name in ("train.dbc", "train.toml"):
            (tmp_path / name).write_text((OWN.parent / name).read_text())
        (tmp_path / "train.dbc").write_text(text + more)
        return tmp_path / "train.dbc"

    return write


def codes(dbc: Path) -> set[str]:
    return {f.code for f in findings(dbc, load_design(resources.DESIGN))}


@pytest.mark.parametrize(
    ("more", "expected_ms"),
    [
        (TIMEOUT + 'BA_DEF_DEF_ "GenSigTimeoutTime" 90;\n', 90),  # canmatrix #122, cantools #376
        (TIMEOUT + 'BA_DEF_DEF_ "GenSigTimeoutTime" 0;\n', 30),
        (RELATED, 90),  # cantools #784: the shortest of the receivers'
        (TIMEOUT + RELATED + 'BA_DEF_DEF_ "GenSigTimeoutTime" 60;\n', 90),
        (TIMEOUT + 'BA_DEF_DEF_ "GenSigTimeoutTime" 100000;\n', 30),  # no time
        (RELATED.replace("Effort 90", "Effort 0"), 120),  # 0 is none
        (RELATED.replace("INT 0 65535", "STRING ").replace("Effort 90", 'Effort "90 ms"').replace("120", '""'), 30),
        (TIMEOUT + 'BA_ "GenSigTimeoutTime" SG_ 529 Effort 110;\n' + RELATED, 110),  # its own has the last word
    ],
)
def test_time_out_of_all_signals_or_of_the_receivers_counts(written: Written, more: str, expected_ms: int) -> None:
    dbc = written(more)
    message = find_message(load_dbc(dbc), "TCU1")
    assert timeout_ms(message, find_signal(message, "Effort")) == expected_ms
    text = dbc_lines.read(dbc)
    effort = next(s for m in text.messages for s in m.signals if s.path == "TCU1.Effort")
    assert (text.number(effort, "GenSigTimeoutTime") or 30) in (expected_ms, 100_000)  # lint says that this is no time


@pytest.mark.parametrize(
    ("profile", "is_protected"),
    [
        ('STRING ;\nBA_DEF_DEF_ "E2EProfile" "P11";\n', True),  # of the one that has an id of its own
        ('STRING ;\nBA_DEF_DEF_ "E2EProfile" "";\nBA_ "E2EProfile" BO_ 560 "P11";\n', True),
        # an ENUM's value is its place, and some write its word (cantools #14, PR 402)
        ('ENUM "None","P11";\nBA_DEF_DEF_ "E2EProfile" "None";\nBA_ "E2EProfile" BO_ 560 1;\n', True),
        ('ENUM "None","P11";\nBA_DEF_DEF_ "E2EProfile" "None";\nBA_ "E2EProfile" BO_ 560 "P11";\n', True),
        ('ENUM "None","P11";\nBA_DEF_DEF_ "E2EProfile" "None";\n', False),
        ('STRING ;\nBA_DEF_DEF_ "E2EProfile" "no";\n', False),
        ('ENUM "NO_E2E","P11";\nBA_DEF_DEF_ "E2EProfile" "NO_E2E";\n', False),
        ('INT 0 22;\nBA_DEF_DEF_ "E2EProfile" 0;\n', False),
    ],
)
def test_e2e_profile_is_one_for_check_and_lint(written: Written, profile: str, is_protected: bool) -> None:
    dbc = written(f'{E2E}BA_DEF_ BO_ "E2EProfile" {profile}')
    speed = find_message(load_dbc(dbc), "BCU_Speed")
    assert (data_id(speed) is not None) is is_protected
    assert "e2e-unknown-profile" not in codes(dbc)
    assert ("e2e-partly" in codes(dbc) or "e2e-no-data-id" in codes(dbc)) is is_protected


def test_word_of_an_enum_costs_no_file(written: Written) -> None:
    dbc = written(
        'BA_DEF_ BO_ "GenMsgSendType" ENUM "Cyclic","Event";\nBA_DEF_DEF_ "GenMsgSendType" "Cyclic";\n'
        'BA_ "GenMsgSendType" BO_ 560 "Event";\n'
    )
    assert attribute(find_message(load_dbc(dbc), "BCU_Speed"), "GenMsgSendType") == "Event"


def test_start_value_of_all_signals_is_sent(written: Written) -> None:
    dbc = written('BA_DEF_ SG_ "GenSigStartValue" INT 0 65535;\nBA_DEF_DEF_ "GenSigStartValue" 9;\n')
    database = load_dbc(dbc)
    assert find_signal(find_message(database, "TCU1"), "Status").raw_initial == 9
    assert find_signal(find_message(database, "WSP_Adhesion1"), "Confidence").raw_initial is None  # of three bits


@pytest.mark.parametrize(
    "kind", ['STRING ;\nBA_DEF_DEF_ "GenSigStartValue" "5"', 'ENUM "a","b";\nBA_DEF_DEF_ "GenSigStartValue" "b"']
)
def test_start_value_that_is_no_number_is_none(written: Written, kind: str, tmp_path: Path) -> None:
    written(f'BA_DEF_ SG_ "GenSigStartValue" {kind};\n')
    assert main(["check", "--config", str(tmp_path / "train.toml")]) == 0


def test_long_names_are_those_of_check_lint_and_init(
    written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """canmatrix #230: of more than 32 characters, beside a short one."""
    long = "SpeedOfTheWholeTrainAsTheBrakeControlUnitHasIt"
    dbc = written(
        'BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;\nBA_DEF_DEF_ "SystemMessageLongSymbol" "";\n'
        'BA_DEF_ SG_ "SystemSignalLongSymbol" STRING ;\nBA_DEF_DEF_ "SystemSignalLongSymbol" "";\n'
        f'BA_ "SystemMessageLongSymbol" BO_ 560 "{long}";\nBA_ "SystemSignalLongSymbol" SG_ 560 V "{long}InKmh";\n'
    )
    assert find_signal(find_message(load_dbc(dbc), long), f"{long}InKmh").unit == "km/h"
    assert main(["init", str(dbc), "-o", str(tmp_path / "my.toml")]) in (0, 1)
    assert f'"{long}.{long}InKmh"' in (tmp_path / "my.toml").read_text()
    assert "did you mean" not in capsys.readouterr().err
    assert any(m.name == long and m.signals[0].path == f"{long}.{long}InKmh" for m in dbc_lines.read(dbc).messages)


@pytest.mark.parametrize("none", ["[0|0]", "[0.0|0.0]", "[0.000|0]", "[-0|0]"])
def test_range_of_nothing_is_none_however_it_is_written(written: Written, none: str) -> None:
    """canmatrix #358."""
    dbc = written("", speed=f' SG_ V : 0|16@1+ (0.01,0) {none} "km/h" WRCD')
    speed = find_signal(find_message(load_dbc(dbc), "BCU_Speed"), "V")
    assert (speed.minimum, speed.maximum) == (None, None)
    assert "no-range" in codes(dbc)


def test_name_that_is_there_twice_is_refused_as_such(written: Written) -> None:
    """opendbc PR 821: not as an overlap, which there may be none of."""
    dbc = written("", speed=' SG_ V : 0|8@1+ (1,0) [0|200] "km/h" WRCD\n SG_ V : 8|8@1+ (1,0) [0|200] "m/s" WRCD')
    with pytest.raises(ValueError, match=r"there are 2 signals of the name V$"):
        find_message(load_dbc(dbc), "BCU_Speed")
    assert "duplicate-signal" in codes(dbc)


def test_float_of_sixteen_bits_is_none(written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """dbcc #13: SIG_VALTYPE_ 1 is a float of 32 bits."""
    dbc = written("SIG_VALTYPE_ 529 Effort : 1;\n")
    assert "float-width" in codes(dbc)
    assert main(["check", "--config", str(tmp_path / "train.toml")]) == 2
    assert "TCU1.Effort is coded as a float of 16 bits; there is none" in capsys.readouterr().err


def test_semicolon_as_an_attributes_value_ends_no_statement(written: Written) -> None:
    """canmatrix #263."""
    dbc = written('BA_DEF_  "Separator" ENUM ",",";";\nBA_DEF_DEF_ "Separator" ";";\n')
    assert load_dbc(dbc).messages
    assert dbc_lines.read(dbc).defaults["Separator"] == ";"


def test_fd_format_may_be_a_number(written: Written) -> None:
    """cantools PR 760."""
    dbc = written(
        'BA_DEF_ BO_ "VFrameFormat" INT 0 15;\nBA_DEF_DEF_ "VFrameFormat" 0;\nBA_ "VFrameFormat" BO_ 560 14;\n'
    )
    text = dbc_lines.read(dbc)
    assert [m.name for m in text.messages if text.is_fd(m)] == ["BCU_Speed"]
