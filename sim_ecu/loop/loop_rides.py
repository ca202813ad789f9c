"""One case's ride of a number, with every controller that the case compares."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop import IDEAL, UNPROTECTED, WITH
from sim_ecu.loop.control.adhesion_consumer import Facts, TrainController
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.lockstep import ConstantAdhesion, Lockstep, ride_ideal
from sim_ecu.loop.ride_figures import AdhesionSeries, Figures, Honesty, adhesion_series, demand_at, honesty, judge
from sim_ecu.loop.rig import Step
from sim_ecu.loop.suites.rides import LoopCase
from sim_ecu.play.encoder import SAMPLE_US, databases
from sim_ecu.play.train import PACKAGED
from sim_ecu.score.score_play import TrainFrames
from wrcd.config.config import load_packaged
from wrcd.core.configuration import Config
from wrcd.resources import LONE

FloatArray = NDArray[np.float64]
T = TypeVar("T")
_packaged = cache(partial(load_packaged, design=LONE))  # all rides are of the lone wheelset
_LAW = {name: law for law, name in WITH.items()}
THINNED = 4  # of a run that is drawn: a step of 20 ms


@dataclass(frozen=True, slots=True)
class Drawn:
    """A run over time, of its first axle. Arrays (n,); reported: by the daemon."""

    time_s: FloatArray  # from the demand on
    speed_m_s: FloatArray
    wheel_m_s: FloatArray
    torque_kN_m: FloatArray
    available_pct: FloatArray
    reported: AdhesionSeries | None
    demand_us: int  # the demand, on the clock of what was reported


@dataclass(frozen=True, slots=True)
class RideResult:
    """What a controller made of a run; honesty is empty without a daemon."""

    suite: str
    case: str
    controller: str
    number: int
    figures: Figures
    honesty: tuple[Honesty, ...] = ()
    drawn: Drawn | None = None


def play(case: LoopCase, number: int, branches: Sequence[LoopCase] = ()) -> list[RideResult]:
    """The case's controllers, in its order. branches: cases whose runs are this one's until their fault begins."""
    scenario = case.scenario(number)
    draw = case.shown and number == 0
    out: list[RideResult] = []
    for name in case.controllers:
        if name == IDEAL:
            steps = list(ride_ideal(scenario))
            out.append(_outcome(case, number, name, scenario, steps, None, draw))
            continue
        made, config = controlled(scenario, name, case.constant_pct)
        recorder = TrainFrames(scenario.axles, config) if config is not None else None
        run = Lockstep(scenario, made, config, None if recorder is None else recorder.keep)
        steps = []
        # a sample before the fault: some faults go on from what was last sensed
        at_us = min((c.fault.begin_us for c in branches if c.fault is not None), default=-1) - 2 * SAMPLE_US
        while not run.over:
            if run.rig.time_us == at_us and name in _LAW:
                out += [_branch(branch, number, name, scenario, (run, recorder), steps) for branch in branches]
            steps.append(run.step())
        out.append(_outcome(case, number, name, scenario, steps, recorder, draw))
    return out


def controlled(
    scenario: DriveScenario, name: str, constant_pct: float | None = None
) -> tuple[TrainController, Config | None]:
    """Return a controller of the scenario's train by its name, and the configuration of the daemon beside it.

    name: of `EVERY` but the ideal. constant_pct: an adhesion (%) that is told all along in the daemon's place. There is
    no daemon then, and none beside a controller without wrcd.
    """
    config = _packaged(len(scenario.axles)) if name in _LAW else None
    law = "none" if name == UNPROTECTED else _LAW.get(name, name)
    made = make_controller(law, Facts.of(scenario), config)
    if constant_pct is None or config is None:
        return made, config
    return ConstantAdhesion(made, scenario.axles, constant_pct), None


def copied(state: T, run: Lockstep) -> T:
    """Return a copy of a state that holds a run, to go on from; what never changes is shared."""
    shared = [run.rig.scenario, PACKAGED, *(m for d in databases() for m in d.messages)]
    if run.core is not None:
        shared += [run.core.config, *run.core.config.database.messages]
    return copy.deepcopy(state, {id(x): x for x in shared})


def _branch(
    case: LoopCase, number: int, name: str, scenario: DriveScenario, state: tuple[Lockstep, TrainFrames | None],
    before: Sequence[Step],
) -> RideResult:  # fmt: skip
    """The rest of a run with a case's fault, from a state that is left as it is."""
    assert case.fault is not None
    run, recorder = copied(state, state[0])
    run.rig.take_faults((case.fault,))
    return _outcome(case, number, name, scenario, [*before, *run], recorder, False)


def _outcome(
    case: LoopCase, number: int, name: str, scenario: DriveScenario, steps: list[Step],
    recorder: TrainFrames | None, draw: bool,
) -> RideResult:  # fmt: skip
    series = {} if recorder is None else adhesion_series(recorder.adhesion)
    drawing = drawn(steps, next(iter(series.values()), None)) if draw else None
    adhesion = tuple(honesty(series, steps))
    return RideResult(case.suite, case.name, name, number, judge(steps, scenario), adhesion, drawing)


def drawn(steps: list[Step], reported: AdhesionSeries | None) -> Drawn:
    """Every fourth step, of the first axle."""
    begin_us = steps[demand_at(np.array([s.share for s in steps]))].due_us
    some = steps[::THINNED]
    rows = [(s.due_us, s.speed_m_s, s.wheel_m_s[0], s.torque_N_m[0], s.mu_available[0]) for s in some]
    due_us, speed, wheel, torque, available = np.array(rows, np.float64).T
    return Drawn((due_us - begin_us) * 1e-6, speed, wheel, torque / 1e3, 100 * available, reported, begin_us)
