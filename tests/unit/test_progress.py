"""The line that says how far a long piece of work has come."""

import sys
import time

import pytest

from wrcd.progress import Progress


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
