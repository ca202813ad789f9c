"""What a terminal gets: colours, unless something says otherwise, and the line that says how far a piece of work is."""

import io
import os
import pty
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.scenarios import LogOf, held
from wrcd.cli.dump import BOLD_GREEN
from wrcd.cli.main import main
from wrcd.colour import coloured, moves
from wrcd.progress import Progress

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


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


def test_terminal_gets_one_line_at_most_twice_a_second(
    clock: list[float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    p = Progress()
    for share in (0.1, 0.2, 0.25, 1.0):
        clock[0] += 0.3
        p.at("playing", share)
    p.end()
    # not more than twice a second
    assert capsys.readouterr().err == "\r\033[Kplaying: 20 %, about 2 s left\r\033[Kplaying: 100 %\r\033[K"


@pytest.mark.parametrize(("steps", "said"), [(False, ""), (True, "cases: 50 %, about 3 s left\nrules\n")])
def test_file_gets_one_line_a_step_or_nothing(
    clock: list[float], steps: bool, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    p = Progress(steps)
    clock[0] += 3.0
    p.at("cases", 0.5)
    p.at("rules")
    p.end()
    assert capsys.readouterr().err == said


def test_time_left_is_of_what_this_run_has_done(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    p = Progress(steps=True)
    clock[0] += 3.0
    p.at("jobs", 0.8, 0.7)
    assert capsys.readouterr().err == "jobs: 80 %, about 6 s left\n"


def test_time_left_is_of_what_is_going_on(clock: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """A long first part does not count for the second."""
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    progress = Progress()
    for seconds, what, share in ((1000.0, "simulated", 0.5), (1000.0, "simulated", 1.0), (10.0, "fitted", 0.25)):
        clock[0] += seconds
        progress.at(what, share)
    assert shown.getvalue().endswith("fitted: 25 %, about 30 s left")


@pytest.mark.parametrize(("group", "is_shown"), [("None", True), ("0", False)], ids=["in front", "in the background"])
def test_only_a_job_in_front_writes_its_line(group: str, is_shown: bool) -> None:
    """On a terminal that a session is controlled from; a process group of its own is a job in the background there."""
    line = "import time; from wrcd.progress import Progress; p = Progress(); p._shown = 0.0; p.at('ride', 0.5); p.end()"
    job = f"subprocess.run([sys.executable, '-c', {line!r}], process_group={group}, check=True)"
    session = f"import fcntl, subprocess, sys, termios; fcntl.ioctl(2, termios.TIOCSCTTY, 0); {job}"
    master, slave = pty.openpty()
    command = [sys.executable, "-c", session]
    env = os.environ | {"TERM": "xterm"}
    subprocess.run(command, stderr=slave, start_new_session=True, check=True, timeout=60, env=env)
    os.write(slave, b"end\n")
    said = b""
    while b"end" not in said:
        said += os.read(master, 4096)
    os.close(slave)
    os.close(master)
    assert (b"ride: 50 %" in said) == is_shown
    assert (said == b"end\r\n") != is_shown


def test_terminal_that_has_gone_ends_no_job(monkeypatch: pytest.MonkeyPatch, clock: list[float]) -> None:
    """As after `sim-ecu play … & disown` and a logout; and standard error that was closed as the process began."""
    monkeypatch.setenv("TERM", "xterm")
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        p = Progress()
        os.close(master)
        clock[0] += 1.0
        p.at("ride", 0.5)
        p.end()
        monkeypatch.setattr(sys, "stderr", None)
        Progress().at("ride", 0.5)
