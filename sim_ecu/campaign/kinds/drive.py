"""A stop or a start in lockstep: rig, controller and, where it is requested, wrcd's core."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from sim_ecu.campaign.kind import Factor, Kind, Metric, Type
from sim_ecu.campaign.kinds.given import (
    CONFIGURATION,
    DESIGN,
    FAULT,
    PREFIX,
    SCENARIO,
    daemon_of,
    fault_of,
    named_by,
    scenario_of,
)
from sim_ecu.jobs.job import Job, Scalar
from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.slip_controller import NAMES, make_controller
from sim_ecu.loop.drive_scenario import DriveScenario, read_drive_scenario
from sim_ecu.loop.lockstep import Lockstep, Timing, cost_of_driving
from sim_ecu.loop.ride_figures import MIN_SLIDE_SPEED_M_S, Honesty, adhesion_series, honesty, judge
from sim_ecu.loop.rig import Step
from sim_ecu.play.faults import SILENT
from sim_ecu.play.inject import at_work
from sim_ecu.play.mapped import Train
from sim_ecu.play.scenario import path_of
from sim_ecu.play.train import PACKAGED
from sim_ecu.score.score_play import TrainFrames
from wrcd.core.configuration import Config
from wrcd.errors import InputError

FACTORS = (
    SCENARIO,
    Factor("controller", Type.TEXT, "who demands torque", "thresholds", choices=NAMES),
    Factor("with_adhesion", Type.FLAG, "the controller receives wrcd's frames", False),
    Factor("daemon", Type.FLAG, "wrcd runs, also where the controller does not use it; always with_adhesion", False),
    DESIGN,
    CONFIGURATION,
    *FAULT,
    Factor("phase_us", Type.WHOLE, "how long after the rig's 10 ms messages the controller acts: 0 or 5000", 0, "us"),
    Factor("delay_us", Type.WHOLE, "how long its demands are on their way, in whole samples of 5000", 0, "us"),
)  # fmt: skip
_OF_DAEMON = "NaN without wrcd"
FIGURES = (
    Metric("beyond_s", Type.NUMBER, "time beyond the creep of the rail's peak, sum of all axles", "s", "less"),
    Metric("slides", Type.WHOLE, f"slides that begin above {MIN_SLIDE_SPEED_M_S:g} m/s, of all axles", better="less"),
    Metric("locked_s", Type.NUMBER, "time locked, sum of all axles", "s", "less"),
    Metric("max_slip_m_s", Type.NUMBER, "largest slip, worst axle", "m/s", "less"),
    Metric("slip_energy_kJ", Type.NUMBER, "energy of the slip, mean of a wheel", "kJ", "less"),
    Metric("beyond_kJ", Type.NUMBER, "the part of slip_energy_kJ beyond the creep of the rail's peak", "kJ", "less"),
    Metric("utilisation", Type.NUMBER, "adhesion in use over available while the driver asks for more than there is, "
           "mean of all axles; NaN if never", better="more"),
    Metric("impulse_kNs", Type.NUMBER, "impulse of a start, sum of all axles; NaN where the demand brakes: a stop "
           "needs what it needs, and is judged by stop_m", "kN s", "more"),
    Metric("stop_m", Type.NUMBER, "stopping distance from the demand on; NaN where it did not stop", "m", "less"),
    Metric("distance_m", Type.NUMBER, "how far it came from the demand on", "m"),
    Metric("time_s", Type.NUMBER, "time from the demand to the end", "s"),
    Metric("stopped", Type.FLAG, "the train was slow enough before the time was up"),
    Metric("valid", Type.NUMBER, f"share of wrcd's frames that are Valid, mean of the axles; {_OF_DAEMON}",
           better="more"),
    Metric("outside", Type.NUMBER, "share of its Valid frames with the truth outside the interval, mean of the axles; "
           f"{_OF_DAEMON}", better="less"),
    Metric("outside_s", Type.NUMBER, f"the longest stretch of that, worst axle; {_OF_DAEMON}", "s", "less"),
    Metric("over_s", Type.NUMBER, f"the longest stretch Valid with the truth below the interval, worst axle; "
           f"{_OF_DAEMON}", "s", "less"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class _DriveRequest:
    """What the inputs request. config: None without a daemon."""

    scenario: DriveScenario
    controller: str
    with_adhesion: bool
    config: Config | None
    train: Train
    timing: Timing


def _request(inputs: Mapping[str, Any]) -> _DriveRequest:
    """Read the inputs. Raises InputError for inputs that make no sense."""
    controller, with_adhesion = str(inputs.get("controller", "thresholds")), bool(inputs.get("with_adhesion", False))
    runs = with_adhesion or bool(inputs.get("daemon", False))
    timing = Timing(int(inputs.get("phase_us", 0)), int(inputs.get("delay_us", 0)))
    if with_adhesion and controller not in NAMES[1:]:
        hint = f"of {', '.join(NAMES[1:])} only"
        raise InputError(f"{controller!r} takes no adhesion", key="with_adhesion", hint=hint)
    for name in ("design", "configuration"):
        if inputs.get(name) and not runs:
            raise InputError("is of a daemon, and none runs", key=name, hint="daemon = true")
    scenario = scenario_of(inputs, path_of(inputs["scenario"], to_drive=True), read_drive_scenario)
    faults = fault_of(inputs, scenario.axles, scenario.train.duration_s)
    for f in faults:
        if not (runs or f.kind in SILENT):
            raise InputError(f"nobody receives the inputs that {f.kind} spoils", key="fault", hint="daemon = true")
    played = replace(scenario.train, faults=(*scenario.train.faults, *faults))
    config, train = daemon_of(inputs, played) if runs else (None, PACKAGED)
    numbers = [a.number for a in played.axles]
    at_work(played.faults, numbers, played.axles[0].seed, train)
    train.encoder(numbers, truth=False)
    return _DriveRequest(replace(scenario, train=played), controller, with_adhesion, config, train, timing)


def _check(inputs: Mapping[str, Any]) -> None:
    request = _request(inputs)
    if request.with_adhesion:
        make_controller(request.controller, Facts.of(request.scenario), request.config)


def figures(job: Job) -> Mapping[str, Scalar]:
    """Drive the run of a job, and judge it."""
    request = _request(job.inputs)
    recorder = None if request.config is None else TrainFrames(request.scenario.axles, request.config)
    steps = list(_steps(request, recorder))
    f = judge(steps, request.scenario)
    found = [] if recorder is None else honesty(adhesion_series(recorder.adhesion), steps)
    out = asdict(f) | {"distance_m": f.stop_m, "stop_m": f.stop_m if f.stopped else math.nan, **_honest(found)}
    if max(request.scenario.driver.values, key=abs) < 0.0:  # the largest demand brakes
        out["impulse_kNs"] = math.nan
    return out | {"time_s": out.pop("seconds")}


def _steps(request: _DriveRequest, recorder: TrainFrames | None) -> Iterator[Step]:
    source = request.config if request.with_adhesion else None
    controller = make_controller(request.controller, Facts.of(request.scenario), source)
    listener = None if recorder is None else recorder.keep
    run = Lockstep(request.scenario, controller, request.config, listener, train=request.train, timing=request.timing)
    yield from run


def _honest(found: list[Honesty]) -> dict[str, Scalar]:
    if not found:
        return dict.fromkeys(("valid", "outside", "outside_s", "over_s"), math.nan)
    return {
        "valid": sum(h.valid for h in found) / len(found),
        "outside": sum(h.outside for h in found) / len(found),
        "outside_s": max(h.outside_s for h in found),
        "over_s": max(h.over_s for h in found),
    }


def _cost(inputs: Mapping[str, Any]) -> float:
    scenario = scenario_of(inputs, path_of(inputs["scenario"], to_drive=True), read_drive_scenario)
    daemon = bool(inputs.get("with_adhesion") or inputs.get("daemon"))
    return scenario.train.duration_s * cost_of_driving(len(scenario.axles), daemon)


DRIVE = Kind(
    "drive",
    "a stop or a start in lockstep with a controller",
    FACTORS,
    FIGURES,
    figures,
    open_factors=(PREFIX,),
    check=_check,
    cost=_cost,
    suite="scenario",
    named=named_by,
)
