"""What inputs of a job name: a scenario with some keys otherwise, a fault, a design, a configuration.

A file is read once in a process for what is in it.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from sim_ecu.campaign.kind import Factor, Type
from sim_ecu.campaign.task import digest
from sim_ecu.play.faults import ALL, DURATION_S, KINDS, SIGNALS, Fault, read_fault
from wrcd import resources
from wrcd.config import load_config, load_packaged
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.estimator.design import Design, load_design
from wrcd.section import Section, Source
from wrcd.settings import read_toml

T = TypeVar("T")
PREFIX = "scenario."
NO_FAULT = "none"
KEPT = 16  # files of a kind that a process keeps

SCENARIO = Factor("scenario", Type.TEXT, "a packaged scenario's name, or a .toml file", is_file=True, packaged=True)
DESIGN = Factor("design", Type.TEXT, "the daemon's design file; empty: the configuration's", "", is_file=True)
CONFIGURATION = Factor(
    "configuration", Type.TEXT, "the daemon's configuration file; empty: the packaged one, of the scenario's axles", "",
    is_file=True,
)  # fmt: skip
FAULT = (
    Factor("fault", Type.TEXT, "what goes wrong with the inputs, as `sim-ecu inject --list` names it, beside the "
           "scenario's own", NO_FAULT, choices=(NO_FAULT, *KINDS)),
    Factor("fault_at_s", Type.NUMBER, "when it begins, from the scenario's start", 5.0, "s"),
    Factor("fault_for_s", Type.NUMBER, "how long it lasts", DURATION_S, "s"),
    Factor("fault_of", Type.TEXT, "the signal that it is of (default: yaw_rate)", choices=(*SIGNALS, ALL),
           optional=True),
    Factor("fault_axle", Type.WHOLE, "the axle that it is of (default: the scenario's first)", optional=True),
    Factor("fault_amount", Type.NUMBER, "how much, in the unit of the fault and the signal (default: the fault's own)",
           optional=True),
)  # fmt: skip
_KEYS = {"fault": "kind", "fault_at_s": "at_s", "fault_for_s": "duration_s", "fault_of": "of", "fault_axle": "axle",
         "fault_amount": "amount"}  # fmt: skip


def scenario_of(inputs: Mapping[str, Any], path: Path, read: Callable[[Section, str], T]) -> T:
    """A scenario's file, with what `scenario.KEY` says otherwise and the job's seed, read by its own reader.

    KEY goes into tables and lists by dots, places of a list from 1 on: `scenario.rail.2.mu_0`. Raises InputError.
    """
    text = _sound(path, digest(path), read)
    data = tomllib.loads(text)
    for name, value in inputs.items():
        if name.startswith(PREFIX):
            _put(data, name, value)
    data["seed"] = inputs["seed"]
    try:
        return read(Section(data, Source(path, {}, None), ()), path.stem)
    except InputError as e:
        raise InputError(e.reason, key=e.key and f"{PREFIX}{e.key}", hint=e.hint) from None


@lru_cache(KEPT)
def _sound(path: Path, _digest: str, read: Callable[[Section, str], Any]) -> str:
    """The text of a file; what is wrong in it as it stands is told with its line."""
    read(read_toml(path), path.stem)
    return path.read_text(encoding="utf-8")


def _put(data: dict[str, Any], name: str, value: Any) -> None:
    """Set a key by its dotted name. Raises InputError where that leads into no table."""
    *way, last = name.removeprefix(PREFIX).split(".")
    if [*way, last] == ["seed"]:
        raise InputError("is the campaign's own", key=name, hint="give first_seed")
    at: Any = data
    for part in way:
        if isinstance(at, list):
            at = _place(at, part, name)
        elif isinstance(at, dict):
            at = at.setdefault(part, {})
    if isinstance(at, list):
        at[at.index(_place(at, last, name))] = value
    elif isinstance(at, dict):
        at[last] = value
    else:
        raise InputError("leads into a value, no table", key=name, hint="see docs/reference/scenario.md")


def _place(rows: list[Any], part: str, name: str) -> Any:
    if not part.isdecimal() or not 1 <= int(part) <= len(rows):
        raise InputError(f"takes a place of 1 … {len(rows)} there, not {part!r}", key=name)
    return rows[int(part) - 1]


def fault_of(inputs: Mapping[str, Any], axles: Sequence[int], end_s: float) -> tuple[Fault, ...]:
    """The fault that the inputs ask for; none or one. Raises InputError that names the input."""
    if inputs.get("fault", NO_FAULT) == NO_FAULT:
        return ()
    named = {f.name: inputs.get(f.name, f.default) for f in FAULT}
    data = {_KEYS[name]: value for name, value in named.items() if value is not None}
    try:
        found = read_fault(Section(data, Source("", {}, None), ()), axles)
    except InputError as e:
        name = next((n for n, key in _KEYS.items() if key == e.key), e.key)
        reason = f"a fault of kind {inputs['fault']} takes none" if e.reason == "unknown key" else e.reason
        raise InputError(reason, key=name, hint=e.hint) from None
    if found.at_s >= end_s:
        raise InputError(
            f"{found.at_s:g} s is not before the scenario's end", key="fault_at_s", hint=f"it lasts {end_s:g} s"
        )
    return (found,)


def configuration_of(inputs: Mapping[str, Any], axles: Sequence[int]) -> Config:
    """The daemon's: the file's, or the packaged one of so many axles; with the design, where one is given. Raises
    InputError, also for a design of another wheelset than the configuration names."""
    files = (CONFIGURATION.path(inputs.get("configuration")), DESIGN.path(inputs.get("design")))
    digests = [digest(f) for f in (*files, *named_by(inputs).values()) if f is not None]
    return _configuration(*files, max(axles), tuple(digests))


@lru_cache(KEPT)
def _configuration(file: Path | None, design_file: Path | None, axles: int, _digests: tuple[str, ...]) -> Config:
    if design_file is None:
        return load_packaged(axles) if file is None else load_config(file)
    design = load_design(design_file)

    def given(_path: Path) -> Design:
        return design

    config = load_packaged(axles) if file is None else load_config(file, read_design=given)
    return replace(config, design=design, design_file=design_file)


def named_by(inputs: Mapping[str, Any]) -> dict[str, Path]:
    """The DBC and the design that the configuration names, packaged ones left out."""
    file = CONFIGURATION.path(inputs.get("configuration"))
    return {} if file is None else _named(file, digest(file))


@lru_cache(KEPT)
def _named(file: Path, _digest: str) -> dict[str, Path]:
    config = load_config(file)
    own = {"configuration's DBC": config.dbc_file, "configuration's design": config.design_file}
    return {name: path for name, path in own.items() if path not in (resources.DBC, resources.DESIGN)}
