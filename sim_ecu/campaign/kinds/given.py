"""What inputs of a job name: a scenario, a fault, a design, a configuration.

A file is read once in a process for what is in it: a worker outlives a campaign.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from sim_ecu.campaign.kind import Factor
from sim_ecu.jobs.digests import digest
from sim_ecu.play.changed_keys import read_changed
from sim_ecu.play.faults import ALL, DURATION_S, KINDS, SIGNALS, Fault, read_fault
from sim_ecu.play.mapped import MappedTrain, Train
from sim_ecu.play.scenario import Scenario
from sim_ecu.play.train import PACKAGED, placed
from wrcd import resources
from wrcd.config.config import load_config, load_packaged
from wrcd.config.packaged_designs import design_path
from wrcd.config.section import Section, TomlSource
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.logs.log_comparison import with_design

T = TypeVar("T")
PREFIX = "scenario."  # of a factor that sets a key of the scenario otherwise
NO_FAULT = "none"
KEPT = 16  # files of a kind that a process keeps

CONFIGURATION = Factor("configuration", str, is_file=True)
COMMON = (
    Factor("scenario", str, needed=True, is_file=True, packaged=True),
    Factor("design", str, is_file=True, packaged=True), CONFIGURATION,
    Factor("fault", str, choices=(NO_FAULT, *KINDS)), Factor("fault_of", str, choices=(*SIGNALS, ALL)),
    *(Factor(f"fault_{name}", float) for name in ("at_s", "for_s", "amount")), Factor("fault_axle", int),
)  # fmt: skip
_DEFAULTS = {"fault_at_s": 5.0, "fault_for_s": DURATION_S}
_KEYS = {"fault": "kind", "fault_at_s": "at_s", "fault_for_s": "duration_s", "fault_of": "of", "fault_axle": "axle",
         "fault_amount": "amount"}  # fmt: skip


def scenario_of(inputs: Mapping[str, Any], path: Path, read: Callable[[Section, str], T]) -> T:
    """Read a scenario's file by its own reader, with what `scenario.KEY` says otherwise and the job's seed. Raises
    InputError that names the input."""
    keys = {name.removeprefix(PREFIX): value for name, value in inputs.items() if name.startswith(PREFIX)}
    try:
        return read_changed(path, digest(path), keys | {"seed": inputs["seed"]}, read)
    except InputError as e:
        raise (e if e.file else InputError(e.reason, key=e.key and f"{PREFIX}{e.key}", hint=e.hint)) from None


def fault_of(inputs: Mapping[str, Any], axles: Sequence[int], end_s: float) -> tuple[Fault, ...]:
    """Return the fault that the inputs ask for; none or one. Raises InputError that names the input."""
    if inputs.get("fault", NO_FAULT) == NO_FAULT:
        return ()
    given = _DEFAULTS | {name: inputs[name] for name in _KEYS if name in inputs}
    try:
        data = {_KEYS[name]: value for name, value in given.items()}
        found = read_fault(Section(data, TomlSource("", {}, None), ()), axles)
    except InputError as e:
        name = next((n for n, key in _KEYS.items() if key == e.key), e.key)
        reason = f"a fault of kind {inputs['fault']} takes none" if e.reason == "unknown key" else e.reason
        raise InputError(reason, key=name, hint=e.hint) from None
    if found.at_s >= end_s:
        reason = f"{found.at_s:g} s is not before the scenario's end"
        raise InputError(reason, key="fault_at_s", hint=f"it lasts {end_s:g} s")
    return (found,)


def configuration_of(inputs: Mapping[str, Any], axles: Sequence[int]) -> Config:
    """Return the daemon's: the file's, or the packaged one of so many axles; with the design, where one is given.
    Raises InputError, also for a design of another wheelset than the configuration names."""
    design = inputs.get("design")
    files = (CONFIGURATION.path(inputs.get("configuration")), design_path(design) if design else None)
    digests = [digest(f) for f in (*files, *named_by(inputs).values()) if f is not None]
    return _configuration(*files, max(axles), tuple(digests))


def daemon_of(inputs: Mapping[str, Any], played: Scenario) -> tuple[Config, Train]:
    """Return the daemon's configuration, and the train that this maps."""
    config = configuration_of(inputs, [a.number for a in played.axles])
    if inputs.get("configuration"):
        return config, MappedTrain(config, played.wheelset)
    return placed(config, played), PACKAGED


@lru_cache(KEPT)
def _configuration(file: Path | None, design_file: Path | None, axles: int, _digests: tuple[str, ...]) -> Config:
    if file is not None:
        return load_config(file, design_file=design_file)
    config = load_packaged(axles)
    return config if design_file is None else with_design(config, design_file)


def named_by(inputs: Mapping[str, Any]) -> dict[str, Path]:
    """Return the DBC and the design that the configuration names, packaged ones left out."""
    file = CONFIGURATION.path(inputs.get("configuration"))
    return {} if file is None else _named(file, digest(file))


@lru_cache(KEPT)
def _named(file: Path, _digest: str) -> dict[str, Path]:
    config = load_config(file)
    own = {"configuration's DBC": config.dbc_file, "configuration's design": config.design_file}
    return {name: path for name, path in own.items() if resources.DATA not in path.parents}
