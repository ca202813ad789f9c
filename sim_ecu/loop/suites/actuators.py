"""Slow and fast actuators, pneumatic and blended: the defaults are one choice of many."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from sim_ecu.loop.names import BARE_AND_WITH
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.loop.suites.case import Case, Plan, Rng, with_train
from sim_ecu.loop.suites.faults import short_stop
from sim_ecu.loop.suites.rails import leaf_stop
from sim_ecu.physics.actuators import Actuators, Drive

SWEEP = {
    "slow electric": Actuators(Drive(lag_s=0.15, rise_N_m_s=30_000.0, fall_N_m_s=60_000.0)),
    "typical electric": Actuators(),
    "fast electric": Actuators(Drive(lag_s=0.02, rise_N_m_s=200_000.0, fall_N_m_s=500_000.0)),
    "pneumatic alone": Actuators(Drive(max_brake_N_m=0.0)),
    "half electric, half pneumatic": Actuators(Drive(max_brake_N_m=11_000.0)),
}
STOPS: dict[str, Callable[[Rng], Plan]] = {"greasy, known before": short_stop, "dry, leaf patch": leaf_stop}


def actuators() -> Iterator[Case]:
    """The same runs with each."""
    for rail, plan in STOPS.items():
        for name, a in SWEEP.items():
            shown = name == "pneumatic alone" and plan is short_stop
            yield Case("actuators", f"{rail}: {name}", plan, 1, _with(a), rail, "", BARE_AND_WITH, shown=shown)


def _with(a: Actuators) -> Callable[[DriveScenario, Rng], DriveScenario]:
    return lambda s, _: replace(with_train(s, actuators=a), known_before=s.known_before)
