"""What inputs of a job name: a scenario with some keys otherwise, a fault, a design, a configuration.

A file is read once in a process for what is in it.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from sim_ecu.campaign.kind import Factor, Metric, Type
from sim_ecu.jobs.job import Scalar, digest
from sim_ecu.play.faults import ALL, DURATION_S, KINDS, SIGNALS, Fault, read_fault
from sim_ecu.play.mapped import MappedTrain, Train
from sim_ecu.play.scenario import Scenario
from sim_ecu.play.train import PACKAGED
from sim_ecu.score.metrics import accuracy, honesty
from sim_ecu.score.metrics.accuracy import OURS, gather, period_s, valid
from sim_ecu.score.score_play import Trace
from wrcd import resources
from wrcd.config.config import load_config, load_packaged
from wrcd.config.packaged_designs import design_path
from wrcd.config.section import Section, TomlSource
from wrcd.config.settings import read_toml
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import SURFACES
from wrcd.errors import InputError
from wrcd.logs.log_comparison import with_design

NOT_LOW_PCT = min(low for low, name in SURFACES if name not in honesty.LOW_SURFACES)

FIGURES = (
    Metric("mean_error_pp", Type.NUMBER, "mean error of MuAvailable in Valid frames; NaN if none is", "pp", "less"),
    Metric("p95_error_pp", Type.NUMBER, "its 95th percentile", "pp", "less"),
    Metric("worst_axle_pp", Type.NUMBER, "mean error of the axle where it is largest", "pp", "less"),
    Metric("valid", Type.NUMBER, "share of the frames that are Valid", better="more"),
    Metric("coverage", Type.NUMBER, "share of the Valid frames whose interval holds the truth; 0.9 is claimed"),
    Metric("half_width_pp", Type.NUMBER, "mean half-width of the estimator's interval in Valid frames", "pp", "less"),
    Metric("lie_s", Type.NUMBER, "time Valid with the truth below the interval, mean of the axles", "s", "less"),
    Metric("lie_worst_s", Type.NUMBER, "the same, worst axle", "s", "less"),
    Metric("false_low_s", Type.NUMBER, "time Valid and called Low or worse on a rail that is not, from the start on, "
           "sum of all axles", "s", "less"),
    Metric("false_lows", Type.WHOLE, "how often that began", better="less"),
    Metric("cause", Type.TEXT, "the most frequent cause of not being Valid; empty for none"),
)  # fmt: skip


def figures_of(traces: Sequence[Trace]) -> dict[str, Scalar]:
    """Of a run's traces, an axle each, one at least."""
    f = gather(traces)
    of_all = accuracy.accuracy(f, OURS)
    confidence = honesty.confidence(f)
    means = [accuracy.accuracy(gather([t]), OURS)["mean"].value for t in traces]
    known = [m for m in means if np.isfinite(m)]
    lies = [_lie_s(t) for t in traces]
    low_s, lows = zip(*map(_false_low, traces), strict=True)
    causes = honesty.not_valid(f)["causes"]
    return {
        "mean_error_pp": of_all["mean"].value,
        "p95_error_pp": of_all["p95"].value,
        "worst_axle_pp": max(known, default=float("nan")),
        "valid": float(np.mean(f.valid)),
        "coverage": confidence["covers"].value,
        "half_width_pp": confidence["mean_half_width"].value,
        "lie_s": sum(lies) / len(lies),
        "lie_worst_s": max(lies),
        "false_low_s": sum(low_s),
        "false_lows": sum(lows),
        "cause": next(iter(causes), ""),
    }


def _lie_s(t: Trace) -> float:
    over = t.mu_pct - t.true_mu_pct
    with np.errstate(invalid="ignore"):
        lies = valid(t) & (over > np.nan_to_num(t.half_width_pp, nan=0.0, posinf=np.inf))
    return float(np.sum(lies & (t.time_s >= t.judged_from_s))) * period_s(t)


def _false_low(t: Trace) -> tuple[float, int]:
    """Seconds, and how often it began."""
    low = np.isin(t.surface, honesty.LOW_SURFACES) & valid(t) & (t.true_mu_pct >= NOT_LOW_PCT)
    begins = low & ~np.concatenate(([False], low[:-1]))
    return float(low.sum()) * period_s(t), int(begins.sum())


T = TypeVar("T")
PREFIX = "scenario."
NO_FAULT = "none"
KEPT = 16  # files of a kind that a process keeps

SCENARIO = Factor("scenario", Type.TEXT, "a packaged scenario's name, or a .toml file", is_file=True, packaged=True)
DESIGN = Factor("design", Type.TEXT, "the daemon's: a packaged design's name, or a .json file; empty: the "
                "configuration's", "", is_file=True, packaged=True)  # fmt: skip
CONFIGURATION = Factor(
    "configuration", Type.TEXT, "the daemon's configuration file; empty: the packaged one, of the scenario's axles", "",
    is_file=True,
)  # fmt: skip
FAULT = (
    Factor("fault", Type.TEXT, "what goes wrong with the inputs, as `sim-ecu list` names it, beside the "
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
        return read(Section(data, TomlSource(path, {}, None), ()), path.stem)
    except InputError as e:
        raise InputError(e.reason, key=e.key and f"{PREFIX}{e.key}", hint=e.hint) from None


@lru_cache(KEPT)
def _sound(path: Path, _digest: str, read: Callable[[Section, str], Any]) -> str:
    """The text of a file; what is wrong in it as it stands is reported with its line."""
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
    """Return the fault that the inputs request; none or one. Raises InputError that names the input."""
    if inputs.get("fault", NO_FAULT) == NO_FAULT:
        return ()
    named = {f.name: inputs.get(f.name, f.default) for f in FAULT}
    data = {_KEYS[name]: value for name, value in named.items() if value is not None}
    try:
        found = read_fault(Section(data, TomlSource("", {}, None), ()), axles)
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
    design = inputs.get("design")
    files = (CONFIGURATION.path(inputs.get("configuration")), design_path(design) if design else None)
    digests = [digest(f) for f in (*files, *named_by(inputs).values()) if f is not None]
    return _configuration(*files, max(axles), tuple(digests))


def daemon_of(inputs: Mapping[str, Any], played: Scenario) -> tuple[Config, Train]:
    """The daemon's configuration, and the train that this maps."""
    config = configuration_of(inputs, [a.number for a in played.axles])
    return config, MappedTrain(config, played.wheelset) if inputs.get("configuration") else PACKAGED


@lru_cache(KEPT)
def _configuration(file: Path | None, design_file: Path | None, axles: int, _digests: tuple[str, ...]) -> Config:
    if file is not None:
        return load_config(file, design_file=design_file)
    config = load_packaged(axles)
    return config if design_file is None else with_design(config, design_file)


def named_by(inputs: Mapping[str, Any]) -> dict[str, Path]:
    """The DBC and the design that the configuration names, packaged ones left out."""
    file = CONFIGURATION.path(inputs.get("configuration"))
    return {} if file is None else _named(file, digest(file))


@lru_cache(KEPT)
def _named(file: Path, _digest: str) -> dict[str, Path]:
    config = load_config(file)
    own = {"configuration's DBC": config.dbc_file, "configuration's design": config.design_file}
    return {name: path for name, path in own.items() if resources.DATA not in path.parents}
