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

MAX_GAP_S = 5.0
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


def runs_of(
    logs: Sequence[Path], config: Config, places: tuple[int, int], channel: str | None = None
) -> list[BogieSignals]:
    """Read logs. One that gives nothing is left out with a warning. Raises InputError where that is so of all."""
    runs, wrong = list[BogieSignals](), list[InputError]()
    for log in logs:
        try:
            runs += bogie_runs(log, config, places, channel)
        except InputError as error:
            wrong.append(error)
    if not runs:
        raise wrong[0]
    for e in wrong:
        print(f"sim-ecu: warning: left out: {e}", file=sys.stderr)
    return runs


def bogie_runs(log: Path, config: Config, places: tuple[int, int], channel: str | None = None) -> list[BogieSignals]:
    """Read a log, cut where nothing comes for MAX_GAP_S. What the core does not believe is missing. Raises InputError
    where a signal is never there."""
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
    ticks, tick_s = np.concatenate(parts), config.design.tick_s
    step = np.diff(ticks["number"].astype(np.int64))
    cuts = np.flatnonzero((step <= 0) | (step > round(MAX_GAP_S / tick_s))) + 1
    runs = [_laid_out(part, tick_s, places) for part in np.split(ticks, cuts)]
    _check(runs, log, config, places)
    return runs


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


def _check(runs: Sequence[BogieSignals], log: Path, config: Config, places: tuple[int, int]) -> None:
    hint = "`wrcd check --log` says what a log gives a configuration"
    if not any(np.isfinite(run.speed_m_s).any() for run in runs):
        raise InputError("has no usable speed", file=log, hint=hint)
    for k in range(2 * len(SIGNAL_WORDS)):
        if all(np.isnan(run.z[:, k]).all() for run in runs):
            axle = config.axles[places[k // 2]].number
            raise InputError(f"has no usable {SIGNAL_WORDS[k % 2]} of axle {axle}", file=log, hint=hint)


def digest(log: Path) -> str:
    """SHA-256 of a log, in hexadecimal digits. Raises InputError where it cannot be read."""
    try:
        with log.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=log, hint="check the path") from None
