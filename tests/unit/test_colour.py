"""Colours: on a terminal, unless something says otherwise."""

import io
from pathlib import Path

import pytest

from tests.support.scenarios import LogOf, held
from wrcd.cli.dump import BOLD_GREEN
from wrcd.cli.main import main
from wrcd.colour import coloured, moves

VARIABLES = ("NO_COLOR", "FORCE_COLOR", "CLICOLOR_FORCE", "TERM")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("variables", "terminal", "pipe"),
    [
        ({}, True, False),
        ({"TERM": "xterm-256color"}, True, False),
        ({"TERM": "dumb"}, False, False),
        ({"NO_COLOR": "1"}, False, False),
        ({"NO_COLOR": "0"}, False, False),  # any value that is not empty
        ({"NO_COLOR": ""}, True, False),
        ({"FORCE_COLOR": "1"}, True, True),
        ({"FORCE_COLOR": "0"}, True, False),
        ({"FORCE_COLOR": ""}, True, False),
        ({"CLICOLOR_FORCE": "1", "TERM": "dumb"}, True, True),
        ({"NO_COLOR": "1", "FORCE_COLOR": "1"}, False, False),
    ],
    ids=str,
)
def test_colours_of_terminal_and_pipe(
    variables: dict[str, str], terminal: bool, pipe: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert (coloured(Terminal()), coloured(io.StringIO())) == (terminal, pipe)


def test_line_is_not_written_anew_in_a_pipe_nor_on_a_dumb_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert moves(Terminal())
    assert not moves(io.StringIO())
    monkeypatch.setenv("TERM", "dumb")
    assert not moves(Terminal())


def test_dump_is_plain_in_a_pipe_and_coloured_when_forced(
    log_of: LogOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    sent = tmp_path / "sent.log"
    assert main(["replay", str(log_of(held("F"))), "-o", str(sent)]) == 0
    for variables, is_coloured in (("", False), ("FORCE_COLOR", True), ("NO_COLOR", False)):
        if variables:
            monkeypatch.setenv(variables, "1")
        assert main(["dump", str(sent)]) == 0
        said = capsys.readouterr().out
        assert "Validity: " in said
        assert (BOLD_GREEN in said, "\033" in said) == (is_coloured, is_coloured)
