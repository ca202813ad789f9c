"""SIGHUP: read the configuration again and take over what a running daemon can, at a tick's end.

Its limits and the recorder's bounds can change; the bus, the files, the axles and their signals cannot. The DBC and
the design are not read again: that would take longer than a tick. Their contents show whether they have changed.
"""

import hashlib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple

from wrcd.bus.dbc import Database
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.estimator.design import Design

# What is taken over, by field of the configuration: its key in the file, and the key's unit in the field's.
LIMITS = {
    "min_speed_m_s": ("limits.min_speed_m_s", 1),
    "not_available_after_us": ("limits.not_available_after_ms", 1000),
    "constant_speed_m_s": ("limits.constant_speed_m_s", 1),
    "torque_is_total": ("vehicle.torque_is_total", 1),
    "recorder.max_files": ("recorder.max_files", 1),
    "recorder.max_mb": ("recorder.max_mb", 1),
}
# What is refused by another name than its field's.
NAMES = {
    "interface": "bus.interface", "channel": "bus.channel", "hardware_stamps": "bus.timestamps",
    "dbc_file": "dbc.file", "design_file": "estimator.design",
    "axles": "axle", "inputs": "mapped signals", "data_ids": "mapped signals", "status": "vehicle.status_message",
    "rejects": "vehicle.rejects_message", "link": "vehicle.link_message",
}  # fmt: skip
# the same before and after, or of no consequence; the recorder is looked at part by part
HELD = {"file", "database", "design", "recorder", "warnings"}


class ReloadOutcome(NamedTuple):
    """Of reading the configuration again: the one to go on with, what to log, and whether the file holds now, if only
    in part. A file with a mistake, or all of whose changes need a restart, does not."""

    config: Config
    line: str
    took: bool


class Reload:
    """Reads one configuration file again and again for a daemon that goes on running."""

    def __init__(self, path: Path | None, running: Config) -> None:
        self._path = path
        self._digests = {file: _digest(file) for file in (running.dbc_file, running.design_file)}

    def read(self, running: Config) -> ReloadOutcome:
        """What comes of the file as it is now. A mistake in it leaves everything as it was."""
        changed: list[str] = []

        def same(file: Path, name: str) -> None:
            if self._digests.get(file) != _digest(file):
                changed.append(NAMES[name])

        def database(file: Path, encoding: str | None = None) -> Database:  # the same file: read already
            same(file, "dbc_file")
            return running.database

        def design(file: Path) -> Design:
            same(file, "design_file")
            return running.design

        try:
            new = load_config(self._path, database, design)
        except InputError as e:
            also = f" ({' and '.join(changed)} changed too: restart for that)" if changed else ""
            mistakes = "; ".join(str(e).splitlines())
            return ReloadOutcome(running, f"reload: nothing taken over: {mistakes}{also}", took=False)
        config, taken, refused = merge(running, new)
        refused = sorted({*refused, *changed})
        outcome = ", ".join(taken) or ("nothing taken over" if refused else "nothing has changed")
        line = f"reload: {outcome}" + (f"; needs a restart: {', '.join(refused)}" if refused else "")
        return ReloadOutcome(config, line, took=bool(taken) or not refused)


def merge(running: Config, new: Config) -> tuple[Config, list[str], list[str]]:
    """The running configuration with the new one's limits; what was taken over and what could not be, for the log."""
    old, given = _flat(running), _flat(new)
    differ = [name for name in old if old[name] != given[name]]
    limits = [name for name in differ if name in LIMITS]
    if "inputs" in differ and "constant_speed_m_s" in limits:
        limits.remove("constant_speed_m_s")  # it stands for a signal that is mapped now, or is no more
    taken = []
    for name in limits:
        key, unit = LIMITS[name]
        taken.append(f"{key} {_shown(old[name], unit)} -> {_shown(given[name], unit)}")
        of, _, part = name.rpartition(".")
        if of:
            running = replace(running, recorder=replace(running.recorder, **{part: given[name]}))
        else:
            running = replace(running, **{part: given[name]})
    refused = [LIMITS[name][0] if name in LIMITS else NAMES.get(name, name) for name in differ if name not in limits]
    return running, taken, refused


def _flat(c: Config) -> dict[str, Any]:
    """By field, those of the recorder as recorder.…"""
    own = {f.name: getattr(c, f.name) for f in fields(c) if f.name not in HELD}
    return own | {f"recorder.{f.name}": getattr(c.recorder, f.name) for f in fields(c.recorder)}


def _shown(value: bool | float | None, unit: int) -> str:
    if value is None or isinstance(value, bool):
        return {None: "none", False: "false", True: "true"}[value]
    return f"{value / unit:g}"


def _digest(file: Path) -> bytes:
    """Of the contents; of a file that cannot be read, nothing."""
    try:
        return hashlib.sha256(file.read_bytes()).digest()
    except OSError:
        return b""
