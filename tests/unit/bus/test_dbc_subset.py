"""What is left out of a DBC before it is parsed, and what must stay."""

from dataclasses import fields
from pathlib import Path

import pytest

from tests.support.dbc import told
from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.bus.dbc_text import subset
from wrcd.config.config import load_config, load_config_to_run
from wrcd.core.configuration import Config

TEXT = """VERSION ""
BU_: A
BO_ 5 Needed: 8 A
 SG_ X : 0|8@1+ (1,0) [0|255] "" A
BO_ 6 Other: 8 A
 SG_ X : 0|8@1+ (1,0) [0|255] "" A
CM_ BO_ 6 "over
two lines";
BA_DEF_ BO_ "Cycle" INT 0 100;
BA_DEF_DEF_ "Cycle" 0;
BA_ "Cycle" BO_ 5 20;
BA_ "Cycle" BO_ 6 20;
VAL_ 5 X 0 "Zero; VAL_ 6 X" ;
VAL_ 6 X 0 "Zero" ;
"""
LEFT_OUT = ('CM_ BO_ 6 "over\ntwo lines";', 'BA_ "Cycle" BO_ 6 20;')


def test_only_statements_about_other_messages_are_left_out() -> None:
    expected = TEXT
    for statement in LEFT_OUT:
        expected = expected.replace(statement, "\n" * statement.count("\n"))
    assert subset(TEXT, {"Needed"}) == expected


@pytest.mark.parametrize(
    ("statement", "why"),
    [
        ('BA_ "Cycle" BO_ 6 20; BA_ "Cycle" BO_ 5 20;\n', "two on a line"),
        ('CM_ BO_ 5 "a comment\nBA_ ""Cycle"" BO_ 6 20;\n";\n', "inside a string"),
        ('BA_ "Cycle" BO_ 6\n', "no end"),
        ('VAL_ 6 X 1 "One" ;\n', "a value table"),
        ('SG_MUL_VAL_ 6 X M 0-1;\n', "changes what the message is"),
        ('CM_ "about all: BO_ 6";\n', "about none"),
    ],
)  # fmt: skip
def test_another_statement_stays(statement: str, why: str) -> None:
    assert statement in subset(TEXT + statement, {"Needed"}), why


@pytest.mark.parametrize("more", ["// it's 5\" wide\n", r'CM_ BO_ 6 "a \" in it";', 'CM_ BO_ 6 "without an end'])
def test_an_unusual_text_stays_whole(more: str) -> None:
    assert subset(TEXT + more, {"Needed"}) == TEXT + more


def test_a_message_of_a_needed_ones_id_is_needed_too() -> None:
    text = TEXT.replace("BO_ 6 Other", "BO_ 5 Other")
    assert subset(text, {"Needed"}) == subset(text, {"Other"}) == text


def test_what_is_told_of_needed_messages_is_the_same() -> None:
    names = {"Adhesion_A1", "Torque_A8", "WrcdLink"}
    whole, some = load_dbc(resources.DBC), load_dbc(resources.DBC, names)
    assert [m.name for m in some.messages] == [m.name for m in whole.messages]
    for a, b in zip(whole.messages, some.messages, strict=True):
        assert (told(a) == told(b)) is (a.name in names)


@pytest.mark.parametrize("axles", [None, (1,), (8, 3)])
def test_the_daemons_configuration_is_that_of_check(axles: tuple[int, ...] | None, tmp_path: Path) -> None:
    path = None
    if axles is not None:
        path = tmp_path / "wrcd.toml"
        path.write_text(
            '[vehicle]\nspeed = "VehicleSpeed.Speed"\n'
            + "".join(
                f'[[axle]]\nnumber = {a}\nyaw_rate = "YawRate_A{a}.YawRate"\n'
                f'lateral_acceleration = "LatAccel_A{a}.LatAccel"\ntorque = "Torque_A{a}.Torque"\n'
                for a in axles
            )
        )
    whole, run = load_config(path), load_config_to_run(path)
    for f in fields(Config):
        if f.name not in ("database", "design"):
            assert getattr(run, f.name) == getattr(whole, f.name)
    outputs = [o for a in run.axles for o in (a.adhesion, a.detail, a.inputs)] + [run.status, run.rejects, run.link]
    assert None not in outputs
    used = {o.message for o in outputs if o is not None} | {i.source.message for i in run.inputs}
    for a, b in zip(whole.database.messages, run.database.messages, strict=True):
        assert a.name not in used or told(a) == told(b)


def test_an_error_names_the_line_of_the_whole_file(tmp_path: Path) -> None:
    (tmp_path / "own.dbc").write_text(TEXT + "BA_ rubbish\n")
    with pytest.raises(Exception, match=f"line {len(TEXT.splitlines()) + 1}"):
        load_dbc(tmp_path / "own.dbc", {"Needed"})
