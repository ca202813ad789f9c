"""`wrcd monitor` of a log in tmux, as a user sees it: the screen, why, a smaller window, the end."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.daemon_frames import GOOD, DaemonFrames
from tests.support.tools import missing
from wrcd.bus.candump import format_line
from wrcd.core.configuration import Config

ROOT = Path(__file__).parents[3]
WAIT_S = 60.0  # of a busy computer
KEYS, CLOSES = "q quit", "Esc closes"


class Terminal:
    """A shell in a tmux server of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        shell = "env PS1='$ ' bash --norc --noprofile"
        self._tmux("new-session", "-d", "-x", "100", "-y", "30", "-c", str(folder), shell)

    def type(self, text: str) -> None:
        self._tmux("send-keys", "-l", text)
        self.press("Enter")

    def press(self, key: str) -> None:
        self._tmux("send-keys", key)

    def resize(self, columns: int, rows: int) -> None:
        self._tmux("resize-window", "-x", str(columns), "-y", str(rows))

    def wait_for(self, done: Callable[[str], bool]) -> str:
        """Look until the screen is as wanted, and return it."""
        end = time.monotonic() + WAIT_S
        while not done(screen := self._tmux("capture-pane", "-p")):
            assert time.monotonic() < end, f"not within {WAIT_S:g} s; {self._sizes()}; the screen:\n{screen.rstrip()}"
            time.sleep(0.1)
        return screen

    def _sizes(self) -> str:
        size, tty = self._tmux("display-message", "-p", "#{pane_width} x #{pane_height},#{pane_tty}").strip().split(",")
        return f"tmux has {size}, the terminal's device {os.get_terminal_size(os.open(tty, os.O_RDWR | os.O_NOCTTY))}"

    def close(self) -> None:
        self._tmux("kill-server")

    def _tmux(self, *arguments: str) -> str:
        command = ["tmux", "-f", "/dev/null", "-S", str(self._folder / "socket"), *arguments]
        env = {**os.environ, "PYTHONPATH": str(ROOT), "LC_ALL": "C.UTF-8"}
        return subprocess.run(command, env=env, capture_output=True, text=True, check=True, timeout=30).stdout


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    if lacks := missing("tmux"):
        pytest.skip(lacks)
    found = Terminal(tmp_path)
    yield found
    found.close()


def has_axle_1(screen: str) -> bool:
    return KEYS in screen and re.search(r"1 \S (Valid|Degraded) +\d+\.\d %", screen) is not None


def test_monitor_shows_a_log_explains_shrinks_and_ends(terminal: Terminal, config: Config, tmp_path: Path) -> None:
    made = DaemonFrames(config)
    low = {**GOOD, "MuAvailable": 5.0, "MuUsed": 4.0}
    frames = [*made.stretch(0, 9_000_000, GOOD), *made.stretch(9_000_000, 15_000_000, low)]
    (tmp_path / "ride.log").write_text("".join(f"{format_line(f, 'can0')}\n" for f in frames))
    terminal.wait_for(lambda screen: screen.startswith("$"))
    terminal.type("export COLUMNS LINES")  # as some shells do
    terminal.type(f"clear; {sys.executable} -m wrcd.cli monitor ride.log; echo status $?")
    terminal.wait_for(has_axle_1)
    terminal.press("w")
    assert "fell from" in terminal.wait_for(lambda screen: CLOSES in screen)
    terminal.press("Escape")
    terminal.wait_for(lambda screen: CLOSES not in screen)
    terminal.resize(80, 24)
    small = terminal.wait_for(lambda screen: has_axle_1(screen) and max(map(len, screen.splitlines())) <= 80)
    assert len(small.splitlines()) <= 24
    terminal.press("q")
    terminal.wait_for(lambda screen: "status 0" in screen)
