"""A train whose daemon records, on a virtual clock, and what may happen to it."""

import random
import time
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from tests.support.can_ids import SENDABLE, UNMAPPED, YAW_RATE_A1
from tests.support.scripted_link import ScriptedLink
from tests.support.sensor_simulator import SensorSimulator
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.core.configuration import Config, RecorderConfig
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.recorder.recorder import Recorder
from wrcd.service.loop import Daemon

HANGS_S = 120.0  # the process that writes a dump gives way to everything else on a computer


class RecordedTrain:
    """Simulator, daemon and recorder on a clock of the test's own; the dumps are written by real processes."""

    def __init__(self, config: Config, folder: Path, seconds: float = 3.0, max_files: int = 20) -> None:
        self.sim = SensorSimulator(config)
        self.link = ScriptedLink()
        self.lag_us = 0  # of the loop
        self.said: list[str] = []
        settings = RecorderConfig(folder, seconds, max_files, 200.0)
        self.recorder = Recorder(settings, self.sim.core, "vcan0", self.said.append)
        self.daemon = Daemon(self.sim.core, self.link, clock=self.now, recorder=self.recorder)
        self.folder = folder
        weakref.finalize(self, end, self.recorder)

    def now(self) -> int:
        return self.sim.t + 1000 + self.lag_us

    def run(self, ms: int, spoil: Callable[[list[Frame]], list[Frame]] = list) -> None:
        for _ in range(ms // 5):
            self.link.waiting += spoil(self.sim.frames())
            self.daemon.turn()

    def dumps(self, count: int = 1) -> list[Path]:
        """Go on until so many dumps have been told of; their logs by age."""
        self.go_on(lambda: len(self.said) >= count)
        return sorted(self.folder.glob("wrcd-*.log"), key=lambda p: (p.stat().st_mtime_ns, p.name))

    def asked(self, spoil: Callable[[list[Frame]], list[Frame]] = list) -> Path:
        """Ask for a dump; its log."""
        self.recorder.ask()
        self.run(2000, spoil)
        self.go_on(lambda: "-asked.log" in "".join(self.said))
        return next(self.folder.glob("*-asked.log"))

    def go_on(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + HANGS_S
        while not done():
            assert time.monotonic() < end, self.said
            if self.recorder._child is None:
                self.run(5)
            else:  # the clock stands still while a real process works
                time.sleep(0.01)
                self.recorder.reap()


def end(recorder: Recorder) -> None:
    """Wait for a dump that a test does not wait for."""
    if recorder._child is not None:
        recorder._child.wait(HANGS_S)


def spoiler(seed: int) -> Callable[[list[Frame]], list[Frame]]:
    """Frames get lost, flipped, cut, doubled; frames that nobody asked for come in between."""
    chance = random.Random(seed)

    def spoil(frames: list[Frame]) -> list[Frame]:
        out = []
        for f in frames:
            kind = chance.random()
            flipped = bytes([f.data[0] ^ 1 << chance.randrange(8), *f.data[1:]])
            out += (
                [] if kind < 0.02
                else [replace(f, data=flipped)] if kind < 0.03
                else [replace(f, data=f.data[:-1])] if kind < 0.035
                else [f, f] if kind < 0.04
                else [replace(f, remote=True)] if kind < 0.045
                else [replace(f, fd=True, data=f.data * 5)] if kind < 0.05
                else [f]
            )  # fmt: skip
        if out and chance.random() < 0.1:
            stamp_us = out[-1].stamp_us
            out += [
                Frame(stamp_us, UNMAPPED, b""),
                Frame(stamp_us, YAW_RATE_A1, bytes(8), extended=True),
                Frame(stamp_us, 0x40, bytes(8), error=True),
            ]
        return out

    return spoil


def second_sender(f: Frame) -> Frame:
    """The same message from somebody else, who counts for himself."""
    return replace(f, data=protect(f.data, f.can_id, ((f.data[1] & 0x0F) + 7) % 15))


def sent_and_replayed(log: Path, out: Path, *options: str) -> tuple[list[Frame], list[Frame]]:
    """What a dump says was sent, and what a replay of it makes with its options."""
    assert main(["replay", str(log), "-o", str(out), *options]) == 0
    damage = Damage()
    sent = [f for f, _ in read_log(log, damage) if f.can_id in SENDABLE]
    assert damage.warnings(log) == []
    return sent, [f for f, _ in read_log(out, Damage())]
