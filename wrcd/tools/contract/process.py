"""A process as consumer under test: it reads the bus by itself and prints a JSON line for each decision.

    {"axle": 1, "limit": 17.0}
    {"axle": 1, "limit": null}

limit is in percent; null: it falls back. A line holds until the axle's next one; before the first it falls back.
"""

import json
import math
import shlex
import subprocess
import threading
from collections.abc import Sequence
from typing import IO

from wrcd.tools.contract.consumer import BusSettings, ConsumerError, Use

STOP_S = 5.0
MAX_SAID = 2000  # characters of standard error that are kept


class ProcessConsumer:
    """Runs a command and reads its decisions.

    command: words, or a text in the shell's spelling; {interface}, {channel} and {config} stand for the bus.
    """

    def __init__(self, command: str | Sequence[str]) -> None:
        self._words = shlex.split(command) if isinstance(command, str) else [str(word) for word in command]
        self._process: subprocess.Popen[str] | None = None
        self._readers: list[threading.Thread] = []
        self._limits: dict[int, float | None] = {}
        self._said = ""  # the end of standard error
        self._nonsense: str | None = None  # a line that is no decision

    def start(self, bus: BusSettings) -> None:
        """Start the command. Raises ConsumerError if there is none."""
        names = {"interface": bus.interface, "channel": bus.channel, "config": str(bus.config or "")}
        words = [_filled(word, names) for word in self._words]
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
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        streams = ((self._read, self._process.stdout), (self._keep, self._process.stderr))
        self._readers = [threading.Thread(target=read, args=(stream,), daemon=True) for read, stream in streams]
        for reader in self._readers:
            reader.start()

    def use(self, axle: int) -> Use:
        """The newest decision. Raises ConsumerError if the process has ended, or has printed anything else."""
        if self._nonsense is not None:
            raise ConsumerError(f'printed {self._nonsense!r}, not a line like {{"axle": 1, "limit": 17.0}}')
        if self._process is None:
            raise ConsumerError("the process was not started")
        status = self._process.poll()
        if status is not None:
            for reader in self._readers:
                reader.join(STOP_S)
            raise ConsumerError(
                f"the process has ended with status {status}: {self._said.strip() or 'it said nothing'}"
            )
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
            self._said = (self._said + line)[-MAX_SAID:]


def _filled(word: str, names: dict[str, str]) -> str:
    for name, value in names.items():
        word = word.replace(f"{{{name}}}", value)
    return word


def _decision(line: str) -> Use | None:
    try:
        said = json.loads(line)
        limit, axle = said["limit"], said["axle"]
        use = Use(None if limit is None else float(limit), int(axle))
    except (ValueError, TypeError, KeyError, OverflowError):
        return None
    return use if use.limit_pct is None or math.isfinite(use.limit_pct) else None  # Python's JSON has NaN and Infinity
