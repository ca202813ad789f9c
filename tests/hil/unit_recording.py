"""What tests/hil/systemd.sh has recorded, for a test to read. Called by itself it writes what the script reads: the
page's commands, and a configuration."""

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.hil.recording import VALID, validity
from tests.support.pages import run_by
from tests.support.processes import ROOT
from wrcd.bus.frame import Frame
from wrcd.config.config import DEFAULT
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

FOREVER_US = 1 << 62
BLOCKS = run_by("tests/hil/test_systemd.py", "docs/how-to/install-on-train.md")
PAGE = [command.replace("@can0", "@vcan0") for block in BLOCKS for command in block.commands]


class Line(NamedTuple):
    """A line of the journal, and the process that wrote it."""

    stamp_us: int
    pid: str
    text: str


class Process(NamedTuple):
    """A daemon on vcan0, and its frames of Adhesion_A1: from when systemd started it until it started the next one."""

    pid: str
    sent: list[Frame]


class Recording:
    """A recording's files, marks, journal and processes. A file that is asked for and not there fails the test."""

    def __init__(self, folder: Path) -> None:
        assert (folder / "marks").exists(), f"no recording in {folder}: run `make systemd`"
        self.folder = folder
        self.marks_us = {name: round(float(s) * 1e6) for name, s in map(str.split, self.text("marks").splitlines())}
        said = [json.loads(line) for line in self.text("journal").splitlines() if line.endswith("}")]
        self.journal = [
            Line(int(e.get("_SOURCE_REALTIME_TIMESTAMP", e["__REALTIME_TIMESTAMP"])), e["_PID"], str(e["MESSAGE"]))
            for e in said
        ]
        log = folder / "bus.log"
        frames = [frame for frame, _ in read_log(log, Damage())] if log.exists() else []
        starts_us = [line.stamp_us for line in self.journal if line.text.startswith("Starting wrcd@vcan0.")]
        self.processes = list[Process]()
        for since_us, until_us in pairwise([*starts_us, FOREVER_US]):
            pids = [p for us, p, text in self.journal if since_us < us < until_us and "wrcd: socketcan:vcan0, " in text]
            if sent := [f for f in frames if since_us < f.stamp_us < until_us]:
                self.processes.append(Process(pids[0], sent))

    def text(self, name: str) -> str:
        if not (self.folder / name).exists():
            pytest.fail(f"no {name} in the recording, which has come to {list(self.marks_us)[-1]}")
        return (self.folder / name).read_text(errors="replace")

    def status(self, name: str) -> int:
        """Return a command's exit status."""
        return int(self.text(f"{name}.status"))

    def fields(self, name: str) -> dict[str, str]:
        """Return what systemctl has shown, or what is in a file like /proc/PID/status."""
        return dict(re.findall(r"^(\w+)(?:=|:\t)[ \t]*(.*)$", self.text(name), re.MULTILINE))

    def said(self, episode: str) -> str:
        """Return the journal of an episode."""
        since_us = self.marks_us[episode]
        until_us = min(
            us for name, us in [*self.marks_us.items(), ("", FOREVER_US)] if us > since_us and "/" not in name
        )
        return "\n".join(line.text for line in self.journal if since_us <= line.stamp_us < until_us)

    def process(self, mark: str) -> Process:
        """Return the first process that sends after a mark only."""
        found = [process for process in self.processes if process.sent[0].stamp_us > self.marks_us[mark]]
        assert found, f"no process after {mark}"
        return found[0]

    def back(self, mark: str, process: Process | None = None) -> Process:
        """Return the first process after a mark, if none is given; it sends Valid frames, and how soon is printed."""
        process = process or self.process(mark)
        since_us = self.marks_us[mark]
        valid_us = [f.stamp_us for f in process.sent if f.stamp_us > since_us and validity(f) == VALID]
        assert valid_us, f"no Valid frame after {mark}"
        print(f"{mark}: Valid after {(valid_us[0] - since_us) * 1e-6:.2f} s")
        return process


if __name__ == "__main__":
    (ROOT / "build/unit/page").write_text("".join(f"{command}\n" for command in PAGE))
    (ROOT / "build/unit/vcan0.toml").write_text(DEFAULT)
