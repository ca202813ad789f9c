"""A scenario of fixed torques, played to wrcd's core on virtual time: what it estimated, held against the truth."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sim_ecu.campaign.kind import Factor, Kind, Scalar
from sim_ecu.campaign.kinds import given
from sim_ecu.play.inject import at_work
from sim_ecu.play.mapped import Train
from sim_ecu.play.scenario import path_of, read_scenario
from sim_ecu.score.metrics.run_metrics import OF_ESTIMATES, estimate_figures
from sim_ecu.score.score_play import play
from sim_ecu.score.suites.run import NOMINAL_FROM_S, Run
from wrcd.core.configuration import Config
from wrcd.errors import InputError

JUDGED_FROM = Factor("judged_from_s", float)
FIGURES = dict.fromkeys(OF_ESTIMATES, float) | {"false_lows": int, "cause": str}


def _request(inputs: Mapping[str, Any]) -> tuple[Run, Config, Train]:
    """Read the inputs. Raises InputError for inputs that make no sense."""
    scenario = given.scenario_of(inputs, path_of(inputs["scenario"]), read_scenario)
    numbers = [a.number for a in scenario.axles]
    faults = (*scenario.faults, *given.fault_of(inputs, numbers, scenario.duration_s))
    config, train = given.daemon_of(inputs, scenario)
    at_work(faults, numbers, scenario.axles[0].seed, train)
    train.encoder(numbers)
    from_s = float(inputs.get(JUDGED_FROM.name, NOMINAL_FROM_S))
    if not 0.0 <= from_s < scenario.duration_s:
        reason = f"takes 0 … {scenario.duration_s:g}, the scenario's end, not {from_s:g}"
        raise InputError(reason, key=JUDGED_FROM.name, hint="0 judges from the first frame on")
    return Run("play", "", 0, replace(scenario, faults=faults), ("",) * len(numbers), from_s), config, train


def figures(inputs: Mapping[str, Any]) -> Mapping[str, Scalar]:
    """Play the run of a job, and judge it."""
    run, config, train = _request(inputs)
    return estimate_figures(play(run, config, {}, train))


def _check(inputs: Mapping[str, Any]) -> float:
    scenario = _request(inputs)[0].scenario
    return scenario.duration_s * len(scenario.axles)


PLAY = Kind(
    "play", (*given.COMMON, JUDGED_FROM), FIGURES, figures, "scenario", (given.PREFIX,), check=_check,
    named=given.named_by,
)  # fmt: skip
