"""What slides revealed, over a restart: a file beside the dumps, written every ten minutes in which it has changed, by
a process of its own, and at the end."""

import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path

from wrcd.core.core import Core
from wrcd.core.estimator import Estimator
from wrcd.core.slides import kept_text, take_kept
from wrcd.errors import InputError, NotThere
from wrcd.recorder.dump_folder import safe_channel_name, write_whole
from wrcd.recorder.writer import Child

EVERY_US = 600_000_000
MAX_BYTES = 4096
PATIENCE_S = 0.5  # for a process that is writing as the daemon ends


def take_file(estimator: Estimator, file: Path) -> None:
    """Go on from what such a file says. Raises NotThere, and InputError where it is damaged or of another design."""
    try:
        data = _read(file)
    except OSError as e:
        raise NotThere(f"cannot be read: {e.strerror}", file=file, hint="check the path and your rights") from e
    take_kept(estimator, data.decode("utf-8", "replace"), file)


def _read(file: Path) -> bytes:
    """A regular file's begin: nobody's pipe holds the daemon up. Raises OSError."""
    fd = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        return os.read(fd, MAX_BYTES) if not stat.S_ISFIFO(os.fstat(fd).st_mode) else b""
    finally:
        os.close(fd)


class KeptSlides:
    """The loop calls it after each turn; write takes a line of the log."""

    def __init__(self, file: Path, estimator: Estimator, write: Callable[[str], None]) -> None:
        """Go on from the file, if there is one. What is damaged or of another design is left aside; what cannot be read
        is not written in this run either."""
        self._file, self._estimator, self._write = file, estimator, write
        self._next_us: int | None = None
        self._child: Child | None = None
        self._said, self._keeps = "", True
        try:
            take_file(estimator, file)
        except NotThere as e:
            self._keeps = isinstance(e.__cause__, FileNotFoundError)
            if not self._keeps:
                write(str(e))
        except InputError as e:
            self._set_aside(e)
        self._text = kept_text(estimator)

    def _set_aside(self, why: InputError) -> None:
        aside = self._file.with_suffix(".aside")
        try:
            self._file.replace(aside)
            self._write(f"{why}: left aside as {aside.name}")
        except OSError as e:
            self._keeps = False
            self._write(f"{why}: not left aside: {e.strerror}")

    def turn(self, now_us: int) -> None:
        """A turn of the loop is over."""
        if self._child is not None and (failed := self._child.finished()) is not None:
            self._child = None
            self._tell(failed)
        if self._next_us is None or not -EVERY_US < now_us - self._next_us < 0:
            if self._next_us is not None and self._child is None and self._has_changed():
                self._begin()
            self._next_us = now_us + EVERY_US

    def close(self) -> None:
        """The daemon ends: what is new is written now."""
        if self._child is not None:
            self._tell(self._child.wait(PATIENCE_S))
        if self._has_changed():
            try:
                write_whole(self._file, self._text.encode())
            except OSError as e:
                self._tell(e.strerror or repr(e))

    def _has_changed(self) -> bool:
        before, self._text = self._text, kept_text(self._estimator)
        return self._keeps and self._text != before

    def _begin(self) -> None:
        """Have it written by a process: a disk may take its time."""
        try:
            with os.fdopen(os.memfd_create("wrcd-slides"), "wb") as text:
                text.write(self._text.encode())
                text.flush()
                command = [sys.executable, "-m", "wrcd.recorder.dump_folder", str(self._file), str(text.fileno())]
                self._child = Child(command, [text.fileno()])
        except OSError as e:
            self._tell(f"no process to write it: {e.strerror}")

    def _tell(self, failed: str) -> None:
        """One line for a trouble, however often it comes."""
        if failed:
            self._text = ""  # it is tried again
        if failed and failed != self._said:
            self._write(f"{self._file}: not written: {failed}")
        self._said = failed


def make_kept(core: Core, channel: str, write: Callable[[str], None]) -> KeptSlides | None:
    """In the folder of the dumps, if the core's configuration has one."""
    folder = core.config.recorder.folder
    name = f"slides-{safe_channel_name(channel)}.json"
    return None if folder is None else KeptSlides(folder / name, core.estimator, write)
