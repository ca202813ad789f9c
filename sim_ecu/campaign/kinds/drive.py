"""A stop or a start in lockstep: rig, controller and, where it is asked for, wrcd's core."""

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, TypeAlias

from sim_ecu.campaign.kind import Factor, Kind, Scalar
from sim_ecu.campaign.kinds import given
from sim_ecu.loop.control.adhesion_consumer import Facts, TrainController
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.drive_scenario import DriveScenario, read_drive_scenario
from sim_ecu.loop.lockstep import Lockstep, Timing
from sim_ecu.loop.ride_figures import adhesion_series, honesty, judge
from sim_ecu.play.faults import SILENT
from sim_ecu.play.inject import at_work
from sim_ecu.play.mapped import Train
from sim_ecu.play.scenario import path_of
from sim_ecu.play.train import PACKAGED
from sim_ecu.score.score_play import TrainFrames
from wrcd.core.configuration import Config
from wrcd.errors import InputError

NONE, THRESHOLDS = "none", "thresholds"
FACTORS = (
    *given.COMMON, Factor("controller", str, choices=(NONE, THRESHOLDS)), Factor("with_adhesion", bool),
    Factor("daemon", bool), Factor("phase_us", int), Factor("delay_us", int),
)  # fmt: skip
HONEST = ("valid", "outside", "outside_s", "over_s")  # of wrcd's frames; NaN without
NUMBERS = ("locked_s", "max_slip_m_s", "slip_energy_kJ", "beyond_kJ", "utilisation", "impulse_kNs", "stop_m",
           "distance_m", "time_s")  # fmt: skip
FIGURES = {
    "beyond_s": float, "slides": int, **dict.fromkeys(NUMBERS, float), "stopped": bool,
    **dict.fromkeys(HONEST, float),
}  # fmt: skip
_DriveRequest: TypeAlias = tuple[DriveScenario, TrainController, Config | None, Train, Timing]  # None: no daemon


def _request(inputs: Mapping[str, Any]) -> _DriveRequest:
    """Read the inputs. Raises InputError for inputs that make no sense."""
    controller, with_adhesion = str(inputs.get("controller", THRESHOLDS)), bool(inputs.get("with_adhesion", False))
    runs = with_adhesion or bool(inputs.get("daemon", False))
    timing = Timing(int(inputs.get("phase_us", 0)), int(inputs.get("delay_us", 0)))
    if with_adhesion and controller == NONE:
        raise InputError(f"{NONE!r} takes no adhesion", key="with_adhesion", hint=f"of {THRESHOLDS} only")
    for name in ("design", "configuration"):
        if inputs.get(name) and not runs:
            raise InputError("is of a daemon, and none runs", key=name, hint="daemon = true")
    scenario = given.scenario_of(inputs, path_of(inputs["scenario"], to_drive=True), read_drive_scenario)
    faults = given.fault_of(inputs, scenario.axles, scenario.train.duration_s)
    for f in faults:
        if not (runs or f.kind in SILENT):
            raise InputError(f"nobody receives the inputs that {f.kind} spoils", key="fault", hint="daemon = true")
    scenario = replace(scenario, train=replace(scenario.train, faults=(*scenario.train.faults, *faults)))
    config, train = given.daemon_of(inputs, scenario.train) if runs else (None, PACKAGED)
    at_work(scenario.train.faults, scenario.axles, scenario.train.axles[0].seed, train)
    train.encoder(scenario.axles, truth=False)
    made = make_controller(controller, Facts.of(scenario), config if with_adhesion else None)
    return scenario, made, config, train, timing


def figures(inputs: Mapping[str, Any]) -> Mapping[str, Scalar]:
    """Drive the run of a job, and judge it."""
    scenario, controller, config, train, timing = _request(inputs)
    recorder = None if config is None else TrainFrames(scenario.axles, config)
    listener = None if recorder is None else recorder.keep
    steps = list(Lockstep(scenario, controller, config, listener, train=train, timing=timing))
    f = judge(steps, scenario)
    out = asdict(f) | {"distance_m": f.stop_m, "stop_m": f.stop_m if f.stopped else math.nan}
    out |= dict.fromkeys(HONEST, math.nan)
    if recorder is not None:
        found = honesty(adhesion_series(recorder.adhesion), steps)
        values = {name: [getattr(h, name) for h in found] for name in HONEST}
        out |= {name: max(v) if name.endswith("_s") else sum(v) / len(v) for name, v in values.items()}
    if max(scenario.driver.values, key=abs) < 0.0:  # it brakes: a stop needs what it needs
        out["impulse_kNs"] = math.nan
    return out | {"time_s": out.pop("seconds")}


def _check(inputs: Mapping[str, Any]) -> float:
    train = _request(inputs)[0].train
    return train.duration_s * len(train.axles)


DRIVE = Kind("drive", FACTORS, FIGURES, figures, "scenario", (given.PREFIX,), check=_check, named=given.named_by)
