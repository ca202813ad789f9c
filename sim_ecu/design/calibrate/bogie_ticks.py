"""What a log gives both wheelsets of a bogie, tick by tick, as the daemon's core reads and judges it."""

import hashlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.terms import CHANNELS, MAX_AXLES
from wrcd.errors import InputError
from wrcd.fit.stretches import BogieSignals
from wrcd.logs.feed import made_of_log
from wrcd.logs.reader import LogReader

CHUNK_BYTES = 1 << 20
SIGNAL_WORDS = ("yaw rate", "lateral acceleration")


def places_of(config: Config, axles: Sequence[int]) -> tuple[int, int]:
    """Places of the leading and the trailing axle in the configuration; its first two where none is given. Raises
    InputError."""
    numbers = [a.number for a in config.axles]
    if len(numbers) < 2:
        hint = "map both wheelsets of a bogie: alignment and cross-level are two unknowns, and each has two signals"
        raise InputError("maps one axle, from which nothing can be told", file=config.file, key="axle", hint=hint)
    chosen = list(axles) or numbers[:2]
    if len(chosen) != 2 or chosen[0] == chosen[1] or not set(chosen) <= set(numbers):
        hint = f"the leading one first, of {', '.join(map(str, numbers))}"
        raise InputError("takes two axles of the configuration", key="--axles", hint=hint)
    return numbers.index(chosen[0]), numbers.index(chosen[1])


def bogie_ticks(log: Path, config: Config, places: tuple[int, int], channel: str | None = None) -> BogieSignals:
    """Read a log. What the core does not believe is missing. Raises InputError where a signal is never there."""
    parts: list[NDArray[Any]] = []
    core = Core(config, ticks=parts.append)
    core.muted = True
    reader = LogReader(log, channel, shows=True)
    for _ in made_of_log(core, reader):
        pass
    for warning in reader.warnings:
        print(f"sim-ecu: warning: {warning}", file=sys.stderr)
    if not parts:
        hint = "`wrcd check --log` says what a log gives a configuration"
        raise InputError("gives the configuration no tick", file=log, hint=hint)
    signals = _laid_out(np.concatenate(parts), config.design.tick_s, places)
    _check(signals, log, config, places)
    return signals


def _laid_out(ticks: NDArray[Any], tick_s: float, places: tuple[int, int]) -> BogieSignals:
    """Ticks on a grid without gaps."""
    shape = (len(ticks), CHANNELS, MAX_AXLES)
    values, there = (ticks[name].reshape(shape)[:, :, list(places)] for name in ("z", "present"))
    by_axle = np.where(there > 0, values, np.nan).transpose(0, 2, 1).reshape(len(ticks), -1)
    at = ticks["number"] - ticks["number"].min()
    n = int(at.max()) + 1
    z, speed, ticked = np.full((n, by_axle.shape[1]), np.nan), np.full(n, np.nan), np.zeros(n, bool)
    z[at], speed[at], ticked[at] = by_axle, ticks["speed_m_s"], True
    return BogieSignals(tick_s, z, speed, ticked)


def _check(signals: BogieSignals, log: Path, config: Config, places: tuple[int, int]) -> None:
    hint = "`wrcd check --log` says what a log gives a configuration"
    if not np.isfinite(signals.speed_m_s).any():
        raise InputError("has no usable speed", file=log, hint=hint)
    for k, column in enumerate(signals.z.T):
        if np.isnan(column).all():
            axle = config.axles[places[k // 2]].number
            raise InputError(f"has no usable {SIGNAL_WORDS[k % 2]} of axle {axle}", file=log, hint=hint)


def digest(log: Path) -> str:
    """SHA-256 of a log, in hexadecimal digits."""
    found = hashlib.sha256()
    with log.open("rb") as file:
        while part := file.read(CHUNK_BYTES):
            found.update(part)
    return found.hexdigest()
