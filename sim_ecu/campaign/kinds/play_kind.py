"""A scenario of fixed torques, played to wrcd's core on virtual time: what it estimated, held against the truth."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sim_ecu.campaign.kind import Factor, Kind, Type
from sim_ecu.campaign.kinds.given import (
    CONFIGURATION,
    DESIGN,
    FAULT,
    FIGURES,
    PREFIX,
    SCENARIO,
    daemon_of,
    fault_of,
    figures_of,
    named_by,
    scenario_of,
)
from sim_ecu.jobs.job import Job, Scalar
from sim_ecu.play.inject import at_work
from sim_ecu.play.mapped import Train
from sim_ecu.play.scenario import Scenario, path_of, read_scenario
from sim_ecu.score.score_play import play
from sim_ecu.score.suites.run import NOMINAL_FROM_S, Run
from wrcd.core.configuration import Config
from wrcd.errors import InputError

JUDGED_FROM = Factor("judged_from_s", Type.NUMBER, "frames before are not judged", NOMINAL_FROM_S, "s")
FACTORS = (SCENARIO, DESIGN, CONFIGURATION, *FAULT, JUDGED_FROM)


def _request(inputs: Mapping[str, Any]) -> tuple[Run, Config, Train]:
    """Read the inputs. Raises InputError for inputs that make no sense."""
    scenario = _scenario(inputs)
    numbers = [a.number for a in scenario.axles]
    faults = (*scenario.faults, *fault_of(inputs, numbers, scenario.duration_s))
    config, train = daemon_of(inputs, scenario)
    at_work(faults, numbers, scenario.axles[0].seed, train)
    train.encoder(numbers)
    from_s = float(inputs.get("judged_from_s", NOMINAL_FROM_S))
    if not 0.0 <= from_s < scenario.duration_s:
        raise InputError(
            f"takes 0 … {scenario.duration_s:g}, the scenario's end, not {from_s:g}", key="judged_from_s",
            hint="0 judges from the first frame on",
        )  # fmt: skip
    run = Run("play", "", 0, replace(scenario, faults=faults), ("",) * len(numbers), from_s)
    return run, config, train


def _scenario(inputs: Mapping[str, Any]) -> Scenario:
    return scenario_of(inputs, path_of(inputs["scenario"]), read_scenario)


def figures(job: Job) -> Mapping[str, Scalar]:
    """Play the run of a job, and judge it."""
    run, config, train = _request(job.inputs)
    return figures_of(play(run, config, {}, train))


def _cost(inputs: Mapping[str, Any]) -> float:
    scenario = _scenario(inputs)
    return scenario.duration_s * len(scenario.axles)


PLAY = Kind(
    "play",
    "a scenario to play, and what wrcd made of it against the truth",
    FACTORS,
    FIGURES,
    figures,
    open_factors=(PREFIX,),
    check=_request,
    cost=_cost,
    suite="scenario",
    named=named_by,
)
