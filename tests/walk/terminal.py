"""A terminal of the walk's own: tmux, keys sent, the screen as a user sees it."""

import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.walk.walk import StepFailed, Walk

TMUX = ("tmux", "-f", "/dev/null")


class Terminal:
    """A shell in a terminal of columns × rows, in the clone. On leaving its block it is gone, and what ran in it."""

    def __init__(self, walk: Walk, name: str, columns: int = 100, rows: int = 30) -> None:
        self._walk, self._name, self._size = walk, name, (columns, rows)
        self._socket = walk.folder.parent / f"{name}.tmux"

    def __enter__(self) -> Self:
        columns, rows = self._size
        shell = "env PS1='$ ' bash --norc --noprofile"
        self._tmux("new-session", "-d", "-x", str(columns), "-y", str(rows), "-c", str(self._walk.folder), shell)
        self.wait_for("a prompt", lambda screen: screen.startswith("$"), 10)
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._tmux("kill-server")

    def type(self, text: str) -> None:
        """Type a line, and Enter."""
        self._tmux("send-keys", "-l", text)
        self.press("Enter")

    def press(self, *keys: str) -> None:
        """Press keys, by tmux's names: Enter, Escape, Left, C-c, q."""
        self._tmux("send-keys", *keys)

    def resize(self, columns: int, rows: int) -> None:
        """Give the terminal another size."""
        self._tmux("resize-window", "-x", str(columns), "-y", str(rows))

    def screen(self, colours: bool = False) -> str:
        """What is on the screen, a line each row; with the escape sequences of its colours if asked for."""
        return self._tmux("capture-pane", "-p", *(["-e"] if colours else []))

    def keep(self, suffix: str = "") -> Path:
        """Write the screen to the folder of pictures, as text."""
        path = self._walk.out / f"{self._name}{suffix}.txt"
        path.write_text(self.screen(), encoding="utf-8")
        return path

    def wait_for(self, what: str, done: Callable[[str], bool], seconds: float) -> str:
        """Look every 100 ms until the screen is as wanted, and return it; fail with the screen."""
        end = time.monotonic() + seconds
        while not done(screen := self.screen()):
            if time.monotonic() > end:
                self.keep("-failed")
                raise StepFailed(f"{what}: not within {seconds:g} s; the screen:\n{screen.rstrip()}")
            time.sleep(0.1)
        return screen

    def _tmux(self, *arguments: str) -> str:
        """One command of this terminal's own tmux server."""
        done = subprocess.run(
            [*TMUX, "-S", str(self._socket), *arguments], env=self._walk.env, capture_output=True, text=True,
            timeout=20,
        )  # fmt: skip
        if done.returncode != 0:
            raise StepFailed(f"tmux {' '.join(arguments)}: {done.stderr.strip()}")
        return done.stdout
