"""The loop's programs as processes on vcan0, candump beside them: started, listened to, and killed at the end."""

import json
import subprocess
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.processes import BIN, running, wait_for
from tests.support.vcan import CANDUMP

RIG, CONTROLLER, DAEMON = 10, 10, 5  # real-time priorities: train and controller do not wait for the daemon's processor


@dataclass
class Told:
    """What a process says: on standard error, in a file, and on standard output, in another."""

    file: Path

    @property
    def out(self) -> Path:
        return self.file.with_suffix(".out")

    @property
    def text(self) -> str:
        return self.file.read_text(errors="replace")

    def wait_for(self, line: str, after: int = 0, seconds: float = 60) -> int:
        """Wait for a line with this text behind a place; return the place behind it."""
        try:
            wait_for(f"{line!r} of {self.file.stem}", seconds, lambda: line in self.text[after:])
        except AssertionError as e:
            raise AssertionError(f"{e}; it says\n{self.text}") from None
        return self.text.index(line, after) + len(line)


class LoopProcesses:
    """Starts them, and ends them with the cleanup."""

    def __init__(self, folder: Path, cleanup: ExitStack) -> None:
        self.folder, self._cleanup = folder, cleanup
        self.log = folder / "candump.log"
        cleanup.enter_context(running(*CANDUMP, "vcan0", output=self.log))

    def start(self, priority: int, command: str) -> tuple[subprocess.Popen[bytes], Told]:
        program, *arguments = command.split()
        told = Told(self.folder / f"{program}-{arguments[0]}-{time.monotonic_ns()}.err")
        with told.file.open("wb") as err, told.out.open("wb") as out:
            process = subprocess.Popen(["chrt", "-f", str(priority), BIN / program, *arguments], stdout=out, stderr=err)
        self._cleanup.callback(process.wait, 10)
        self._cleanup.callback(process.kill)
        return process, told

    def has(self, *ids: int) -> bool:
        """Whether candump has seen frames of all these ids."""
        text = self.log.read_text()
        return all(f" {can_id:03X}#" in text for can_id in ids)

    def drive(self, command: str) -> tuple[subprocess.Popen[bytes], Told]:
        return self.start(RIG, f"{command} --no-truth --json {self.folder / 'out.json'}")

    def end(self, rig: subprocess.Popen[bytes], told: Told) -> tuple[int, str, dict[str, Any]]:
        """Status, summary and document of a rig that drives to its end."""
        status = rig.wait(90)
        summary = told.out.read_text()
        print(told.text, summary)
        return status, summary, json.loads((self.folder / "out.json").read_text())
