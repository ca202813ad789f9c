"""The manual pages are those of the parsers, the declared keys and the DBC, and troff's macros are sound."""

import argparse
import re

import pytest

from sim_ecu import cli as rig_cli
from sim_ecu.commands.statuses import STATUSES as RIG
from tests.support import roff
from tests.support.manual import MAKERS
from wrcd import declared, resources
from wrcd.bus.dbc import load_dbc
from wrcd.core.causes import Cause
from wrcd.tools import cli
from wrcd.tools.commands import listed
from wrcd.tools.statuses import STATUSES as WRCD

# with how many arguments at most, and at least
MACROS = {
    ".TH": (5, 5), ".SH": (1, 9), ".SS": (1, 3), ".SY": (1, 1), ".YS": (0, 0), ".PP": (0, 0), ".TP": (0, 0),
    ".RS": (1, 1), ".RE": (0, 0), ".nf": (0, 0), ".fi": (0, 0), ".br": (0, 0), ".nh": (0, 0), ".ad": (1, 1),
}  # fmt: skip
PAIRS = {".RS": ".RE", ".nf": ".fi", ".SY": ".YS"}
ESCAPE = re.compile(r"\\(f[BIR]|&|e|-|~|\||\((?:aq|ga|ti|ha|en|em|pc|mu|mc|S2|\+-|<=|>=))")
PARSERS = {"wrcd": cli._parser(), "sim-ecu": rig_cli._parser()}


def text(name: str) -> str:
    return (resources.MANUAL / name).read_text(encoding="ascii")


def shown(name: str) -> str:
    """What a reader sees of a page, roughly: without macros and fonts, blanks as one."""
    lines = (line for line in text(name).splitlines() if not re.match(r"\.(TP|PP|RS|RE|nf|fi|br|YS)", line))
    plain = re.sub(r"\\f[BIR]|\\&|\\\|", "", " ".join(lines))
    for code, mark in (("\\-", "-"), ("\\(aq", "'"), ("\\(ga", "`"), ("\\(ti", "~"), ("\\(ha", "^"), ("\\~", " ")):
        plain = plain.replace(code, mark)
    return re.sub(r"\s+", " ", plain)


@pytest.mark.parametrize("name", MAKERS)
def test_page_is_that_of_the_program(name: str) -> None:
    assert text(name) == MAKERS[name](), "python -m tests.support.manual"


@pytest.mark.parametrize("name", MAKERS)
def test_page_uses_macros_and_escapes_that_there_are(name: str) -> None:
    opened: list[str] = []
    for number, line in enumerate(text(name).splitlines(), 1):
        where = f"{name}:{number}: {line}"
        assert line == line.rstrip(), where
        assert line, where
        assert "\\" not in ESCAPE.sub("", line), where
        assert line.count("\\fB") + line.count("\\fI") == line.count("\\fR"), where
        if not line.startswith((".", "'")):
            continue
        macro, *arguments = re.findall(r'"[^"]*"|\S+', line)
        least, most = MACROS[macro]
        assert least <= len(arguments) <= most, where
        if macro in PAIRS:
            opened.append(PAIRS[macro])
        elif macro in PAIRS.values():
            assert opened, where
            assert opened.pop() == macro, where
    assert opened == []


@pytest.mark.parametrize("name", MAKERS)
def test_page_names_itself_and_has_its_sections_in_order(name: str) -> None:
    page, _, section = name.rpartition(".")
    lines = text(name).splitlines()
    assert re.match(rf'\.TH {re.escape(page.upper())} {section} (\d{{4}}-\d\d-\d\d|"") "wrcd \d', lines[0])
    sections = [line.removeprefix(".SH ") for line in lines if line.startswith(".SH ")]
    assert (sections[0], sections[-1]) == ("NAME", "SEE ALSO")
    assert lines[lines.index(".SH NAME") + 1].startswith(f"{page} \\- ")


@pytest.mark.parametrize("program", PARSERS)
def test_page_of_a_program_has_every_command_option_example_and_status(program: str) -> None:
    page = shown(f"{program}.1")
    subs = next(a for a in PARSERS[program]._actions if isinstance(a, argparse._SubParsersAction))
    commands = {c.name: c for c in (listed if program == "wrcd" else rig_cli).COMMANDS}
    assert set(commands) == set(subs.choices)
    for name, parser in subs.choices.items():
        part = page.partition(f".SS {program} {name} ")[2].partition(" .S")[0]
        for a in parser._actions:
            assert all(option in part for option in a.option_strings if a.dest != "help"), name
        for line, _ in commands[name].examples:
            assert re.sub(r"\s+", " ", line) in part
        for status in (WRCD if program == "wrcd" else RIG)[name]:
            assert f" {status:d} " in part.partition("Exit status:")[2]


def test_page_of_the_configuration_has_every_key() -> None:
    page = text("wrcd.toml.5")
    for table, keys in declared.TABLES.items():
        part = page.partition(f'.SS "[[{table}]]"' if table == "axle" else f'.SS "[{table}]"')[2].partition("\n.S")[0]
        for key in keys:
            assert f"\n.TP\n{roff.bold(key.name)}\n" in part
            assert part.count("reload") >= sum(k.reload for k in keys)


def test_page_of_the_frames_has_every_signal_word_and_cause() -> None:
    page = shown("wrcd-frames.7")
    for message in load_dbc(resources.DBC).messages:
        assert f"0x{message.frame_id:03X}" in page or re.search(r"_A[2-7]$", message.name)
        for signal in message.signals:
            assert f" {signal.name} bit" in page
            assert all(f"{raw} {word}" in page for raw, word in (signal.choices or {}).items())
    assert all(f"{cause:d} {cause.label} " in page for cause in Cause if cause)


def test_text_is_escaped_for_troff() -> None:
    assert roff.escaped(".5 is -1 \\ 'x'") == "\\&.5 is \\-1 \\e \\(aqx\\(aq"
    assert roff.paragraph("A well-known `a -b c` is. So.") == ["A well-known \\fBa \\-b c\\fR is.", "So."]
    with pytest.raises(ValueError, match=r"no escape for .*☃"):
        roff.escaped("a ☃")
