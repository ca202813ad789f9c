"""A scenario whose torques are fixed, played to wrcd's core on virtual time: what it said, held against the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from sim_ecu.campaign.kind import Factor, Kind, Type
from sim_ecu.campaign.kinds.given import (
    CONFIGURATION,
    DESIGN,
    FAULT,
    FIGURES,
    PREFIX,
    SCENARIO,
    configuration_of,
    fault_of,
    figures_of,
    named_by,
    scenario_of,
)
from sim_ecu.jobs.job import Job, Scalar
from sim_ecu.play.inject import at_work
from sim_ecu.play.mapped import MappedTrain
from sim_ecu.play.scenario import Scenario, path_of, read_scenario
from sim_ecu.play.train import PACKAGED, Train
from sim_ecu.score.score_play import play
from sim_ecu.score.suites.run import NOMINAL_FROM_S, Run
from wrcd.core.configuration import Config
from wrcd.errors import InputError

JUDGED_FROM = Factor("judged_from_s", Type.NUMBER, "frames before are not judged", NOMINAL_FROM_S, "s")
FACTORS = (SCENARIO, DESIGN, CONFIGURATION, *FAULT, JUDGED_FROM)


@dataclass(frozen=True, slots=True)
class _PlayInputs:
    """What the inputs come to."""

    scenario: Scenario
    config: Config
    train: Train
    judged_from_s: float


def _asked(inputs: Mapping[str, Any]) -> _PlayInputs:
    """Raises InputError for inputs that make no sense."""
    scenario = _scenario(inputs)
    numbers = [a.number for a in scenario.axles]
    faults = (*scenario.faults, *fault_of(inputs, numbers, scenario.duration_s))
    config = configuration_of(inputs, numbers)
    w = scenario.wheelset
    train: Train = MappedTrain(config, w.normal_N, w.r_0) if inputs.get("configuration") else PACKAGED
    at_work(faults, numbers, scenario.axles[0].seed, train)
    train.encoder(numbers)
    from_s = float(inputs.get("judged_from_s", NOMINAL_FROM_S))
    if not 0.0 <= from_s < scenario.duration_s:
        raise InputError(
            f"takes 0 … {scenario.duration_s:g}, the scenario's end, not {from_s:g}", key="judged_from_s",
            hint="0 judges from the first frame on",
        )  # fmt: skip
    return _PlayInputs(replace(scenario, faults=faults), config, train, from_s)


def _scenario(inputs: Mapping[str, Any]) -> Scenario:
    return scenario_of(inputs, path_of(inputs["scenario"]), read_scenario)


def figures(job: Job) -> Mapping[str, Scalar]:
    """Play the run of a job, and judge it."""
    asked = _asked(job.inputs)
    run = Run("play", "", 0, asked.scenario, ("",) * len(asked.scenario.axles), asked.judged_from_s)
    return figures_of(play(run, asked.config, {}, asked.train))


def _cost(inputs: Mapping[str, Any]) -> float:
    scenario = _scenario(inputs)
    return scenario.duration_s * len(scenario.axles)


PLAY = Kind(
    "play",
    "a scenario to play, and what wrcd said of it against the truth",
    FACTORS,
    FIGURES,
    figures,
    open_factors=(PREFIX,),
    check=_asked,
    cost=_cost,
    suite="scenario",
    named=named_by,
)
