"""One case's run of a number, with every controller that the case compares."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.always_told import AlwaysTold
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.make import make_controller
from sim_ecu.loop.ideal import ride_ideal
from sim_ecu.loop.judge import Figures, demand_at, judge
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.names import IDEAL, UNPROTECTED, WITH
from sim_ecu.loop.rig import Step
from sim_ecu.loop.said import Ear, Honesty, Told, honesty
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.loop.suites.case import Case
from sim_ecu.play.encoder import SAMPLE_US, databases
from sim_ecu.play.train import PACKAGED
from wrcd.config import load_packaged
from wrcd.core.configuration import Config

FloatArray = NDArray[np.float64]
_LAW = {name: law for law, name in WITH.items()}
THINNED = 4  # of a run that is drawn: a step of 20 ms


@dataclass(frozen=True, slots=True)
class Drawn:
    """A run over time, of its first axle. Arrays (n,); told: what the daemon said."""

    time_s: FloatArray  # from the demand on
    speed_m_s: FloatArray
    wheel_m_s: FloatArray
    torque_kN_m: FloatArray
    available_pct: FloatArray
    told: Told | None
    told_from_us: int  # the demand, on the clock of what was told


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a controller made of a run; said is empty without a daemon."""

    suite: str
    case: str
    controller: str
    number: int
    figures: Figures
    said: tuple[Honesty, ...] = ()
    drawn: Drawn | None = None


def play(case: Case, number: int, branches: Sequence[Case] = ()) -> list[Outcome]:
    """The case's controllers, in its order. branches: cases whose runs are this one's until their fault begins."""
    scenario = case.scenario(number)
    draw = case.shown and number == 0
    out: list[Outcome] = []
    for name in case.controllers:
        if name == IDEAL:
            steps = list(ride_ideal(scenario))
            out.append(_outcome(case, number, name, scenario, steps, None, draw))
            continue
        config = configuration(len(scenario.axles)) if name in _LAW else None
        ear = Ear(scenario.axles) if config is not None else None
        law = "none" if name == UNPROTECTED else _LAW.get(name, name)
        made = make_controller(law, Facts.of(scenario), config)
        if case.told_pct is not None and config is not None:
            made, config, ear = AlwaysTold(made, scenario.axles, case.told_pct), None, None
        run = Lockstep(scenario, made, config, None if ear is None else ear.hear)
        steps = []
        # a sample before the fault: some faults go on from what was last sensed
        at_us = min((c.fault.begin_us for c in branches if c.fault is not None), default=-1) - 2 * SAMPLE_US
        while not run.over:
            if run.rig.time_us == at_us and name in _LAW:
                out += [_branch(branch, number, name, scenario, (run, ear), steps) for branch in branches]
            steps.append(run.step())
        out.append(_outcome(case, number, name, scenario, steps, ear, draw))
    return out


def _branch(
    case: Case, number: int, name: str, scenario: DriveScenario, state: tuple[Lockstep, Ear | None],
    before: Sequence[Step],
) -> Outcome:  # fmt: skip
    """The rest of a run with a case's fault, from a state that is left as it is."""
    assert case.fault is not None
    config, messages = state[0].core, [m for d in databases() for m in d.messages]
    shared = [scenario, PACKAGED, *messages]
    if config is not None:
        shared += [config.config, *config.config.database.messages]
    run, ear = copy.deepcopy(state, {id(x): x for x in shared})
    run.rig.take_faults((case.fault,))
    steps = list(before)
    while not run.over:
        steps.append(run.step())
    return _outcome(case, number, name, scenario, steps, ear, False)


def _outcome(
    case: Case, number: int, name: str, scenario: DriveScenario, steps: list[Step], ear: Ear | None, draw: bool
) -> Outcome:
    told = {} if ear is None else ear.told()
    return Outcome(
        case.suite, case.name, name, number, judge(steps, scenario), tuple(honesty(told, steps)),
        drawn(steps, next(iter(told.values()), None)) if draw else None,
    )  # fmt: skip


def drawn(steps: list[Step], told: Told | None) -> Drawn:
    """Every fourth step, of the first axle."""
    begin_us = steps[demand_at(np.array([s.share for s in steps]))].due_us
    some = steps[::THINNED]
    columns = np.array(
        [(s.due_us, s.speed_m_s, s.wheel_m_s[0], s.torque_N_m[0], s.mu_available[0]) for s in some], np.float64
    ).T
    time_s = (columns[0] - begin_us) * 1e-6
    return Drawn(time_s, columns[1], columns[2], columns[3] / 1e3, 100 * columns[4], told, begin_us)


_configurations: dict[int, Config] = {}


def configuration(axles: int) -> Config:
    """The packaged one; read once in a process."""
    if axles not in _configurations:
        _configurations[axles] = load_packaged(axles)
    return _configurations[axles]
