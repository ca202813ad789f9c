"""Consumers under test: a Python object on virtual time, or whatever reads a bus by itself, a process among it.

A process prints a JSON line for each decision, {"axle": 1, "limit": 17.0}, in percent; null: it falls back. A line
holds until the axle's next one; before the first it falls back.
"""

import json
import math
import shlex
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol

from wrcd.bus.frame import Frame

STOP_S = 5.0
MAX_STDERR = 2000  # characters that are kept
TICK_S = 0.005  # how often print_decisions looks at the bus, and asks the object where no frame has come


class ConsumerError(Exception):
    """The consumer cannot be judged: it has ended, or its limit is no number."""


@dataclass(frozen=True, slots=True)
class Use:
    """What a consumer makes of an axle's adhesion: the most that it asks for, in percent of the load; None: it falls
    back, as if there were no wrcd."""

    limit_pct: float | None
    axle: int


@dataclass(frozen=True, slots=True)
class BusSettings:
    """Where the frames come from. config: the daemon's configuration (None: the default); axles: their numbers."""

    interface: str
    channel: str
    config: Path | None
    axles: tuple[int, ...]


class Consumer(Protocol):
    """A consumer that listens to a bus by itself: a process, a receiver in C, a controller on a bench."""

    def start(self, bus: BusSettings) -> None:
        """Begin to listen. It may take its time: nothing is judged before it uses a frame."""

    def use(self, axle: int) -> Use:
        """Return what it uses of an axle now. Called every 5 ms; raises ConsumerError."""

    def stop(self) -> None:
        """End."""


class Hearing(Protocol):
    """A Python object that is handed frames and time. Times are microseconds since 1970, and only grow."""

    def hear(self, frame: Frame) -> None:
        """Take a frame of the bus, at its stamp; those of other ids come, too."""

    def use(self, axle: int, now_us: int) -> Use:
        """Return what it uses of an axle at a time."""


@dataclass(frozen=True, slots=True)
class ObjectConsumer:
    """Tests a Python object on virtual time: a new one for every check. make: its class, or what makes one."""

    make: Callable[[], Hearing]


class ProcessConsumer:
    """Runs a command and reads its decisions.

    command: words, or a text in the shell's spelling; {interface}, {channel} and {config} stand for the bus.
    """

    def __init__(self, command: str | Sequence[str]) -> None:
        self._words = shlex.split(command) if isinstance(command, str) else [str(word) for word in command]
        self._process: subprocess.Popen[str] | None = None
        self._readers: list[threading.Thread] = []
        self._limits: dict[int, float | None] = {}
        self._stderr = ""  # its end
        self._nonsense: str | None = None  # a line that is no decision

    def start(self, bus: BusSettings) -> None:
        """Start the command. Raises ConsumerError if there is none."""
        words = self._words
        for name, value in (("interface", bus.interface), ("channel", bus.channel), ("config", str(bus.config or ""))):
            words = [word.replace(f"{{{name}}}", value) for word in words]
        try:
            self._process = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
            )
        except (OSError, IndexError) as e:
            raise ConsumerError(f"cannot start {shlex.join(words)}: {e}") from None
        streams = ((self._read, self._process.stdout), (self._keep, self._process.stderr))
        self._readers = [threading.Thread(target=read, args=(stream,), daemon=True) for read, stream in streams]
        for reader in self._readers:
            reader.start()

    def use(self, axle: int) -> Use:
        """Return the newest decision. Raises ConsumerError if the process has ended, or has printed anything else."""
        if self._nonsense is not None:
            raise ConsumerError(f'printed {self._nonsense!r}, not a line like {{"axle": 1, "limit": 17.0}}')
        if self._process is None:
            raise ConsumerError("the process was not started")
        status = self._process.poll()
        if status is not None:
            for reader in self._readers:
                reader.join(STOP_S)
            why = self._stderr.strip() or "it printed nothing"
            raise ConsumerError(f"the process has ended with status {status}: {why}")
        return Use(self._limits.get(axle), axle)

    def stop(self) -> None:
        """Ask the process to end, and make it after five seconds."""
        process, self._process = self._process, None
        if process is None:
            return
        process.terminate()
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(STOP_S)
        for reader in self._readers:
            reader.join(STOP_S)
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()

    def _read(self, stream: IO[str]) -> None:
        for line in stream:
            decision = _decision(line)
            if decision is None:
                self._nonsense = self._nonsense or line.rstrip("\n")[:200]
            else:
                self._limits[decision.axle] = decision.limit_pct

    def _keep(self, stream: IO[str]) -> None:
        for line in stream:
            self._stderr = (self._stderr + line)[-MAX_STDERR:]


def _decision(line: str) -> Use | None:
    try:
        record = json.loads(line)
        limit, axle = record["limit"], record["axle"]
        use = Use(None if limit is None else float(limit), int(axle))
    except (ValueError, TypeError, KeyError, OverflowError):
        return None
    return use if use.limit_pct is None or math.isfinite(use.limit_pct) else None  # Python's JSON has NaN and Infinity


def print_decisions(consumer: Hearing, axles: Sequence[int], interface: str, channel: str) -> None:
    """Hand every frame of a bus over and print a line for each new decision, until the process is ended.

    A frame's time is the bus's stamp. Raises BusError.
    """
    from wrcd.bus.opening import open_link  # the plug-in is loaded wherever pytest runs: it needs no bus then

    printed: dict[int, float | None] = {}

    def decide(now_us: int) -> None:
        for axle in axles:
            limit = consumer.use(axle, now_us).limit_pct
            if axle not in printed or printed[axle] != limit:
                printed[axle] = limit
                print(json.dumps({"axle": axle, "limit": limit}), flush=True)

    link = open_link(interface, channel, None, user_settings=True)
    try:
        while True:
            frames = link.receive(time.time_ns() // 1000)
            for frame in frames:
                if not frame.error:
                    consumer.hear(frame)
                    decide(frame.stamp_us)
            if not frames:
                decide(time.time_ns() // 1000)
                time.sleep(TICK_S)
    finally:
        link.close()
