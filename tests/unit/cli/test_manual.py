"""The manual pages are those of the program, and have every command, key, signal and cause."""

import argparse
import re
from pathlib import Path

import pytest

from tests.support.manual import DOES, NAMES, make
from tests.support.pages import PROGRAMS
from tests.support.statuses import STATUSES
from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.config import declared
from wrcd.core.causes import Cause


def shown(file: Path) -> str:
    """What a reader sees of a page, roughly: without macros and fonts, blanks as one."""
    lines = (re.sub(r"^\.(?:SH|SS|B|I) ", "", line) for line in file.read_text(encoding="utf-8").splitlines())
    plain = re.sub(r"\\f\(..|\\f.|\\[&%]", "", " ".join(line for line in lines if not line.startswith((".", "'"))))
    for code, mark in (("\\(aq", "'"), ("\\(ga", "`"), ("\\(ti", "~"), ("\\(ha", "^"), ("\\e", "\0")):
        plain = plain.replace(code, mark)
    return re.sub(r"\s+", " ", re.sub(r"[\\\"]", "", plain))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("man")
    make(folder)
    return folder


@pytest.mark.parametrize("file", NAMES)
def test_page_is_that_of_the_program(file: str, made: Path) -> None:
    """Word for word: another Sphinx has other macros."""
    packaged = shown(resources.MANUAL / file)
    assert packaged == shown(made / file), "python -m tests.support.manual"
    assert f"{NAMES[file]} - {DOES[NAMES[file]]} DESCRIPTION" in packaged


@pytest.mark.parametrize("program", PROGRAMS)
def test_page_of_a_program_has_every_command_option_example_and_status(program: str) -> None:
    page = shown(resources.MANUAL / f"{program}.1")
    parser = PROGRAMS[program].parser()
    subs = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction)).choices
    for command in PROGRAMS[program].commands():
        begin = f" {program} {command.name} {command.help[:1].upper()}{command.help[1:9]}"
        assert begin in page
        part = page.rpartition(begin)[2].partition(" 130 ")[0]
        for a in subs[command.name]._actions:
            assert all(option in part for option in a.option_strings if a.dest != "help"), command.name
        for line, _ in command.examples:
            assert re.sub(r"\s+", " ", line) in part
        for status in STATUSES[program][command.name]:
            assert f" {status:d} " in part.partition("Exit status:")[2] + " 130 "


def test_pages_have_every_key_signal_word_and_cause() -> None:
    keys, frames = shown(resources.MANUAL / "wrcd.toml.5"), shown(resources.MANUAL / "wrcd-frames.7")
    for table, declared_keys in declared.TABLES.items():
        assert all(f" {table}.{key.name} " in keys for key in declared_keys)
    for signal in (s for m in load_dbc(resources.DBC).messages for s in m.signals if s.name not in ("Crc", "Counter")):
        assert re.search(rf" {signal.name}\b", frames)
        assert all(f"{raw} {word}" in frames for raw, word in (signal.choices or {}).items())
    assert all(f"{cause:d} {cause.label} " in frames for cause in Cause if cause)
