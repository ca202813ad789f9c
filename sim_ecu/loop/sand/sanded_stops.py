"""Stops of a train with sanders, the same for every sanding policy. Pure but for the rig that it drives."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from sim_ecu.loop.control.adhesion_consumer import Facts, usable_receiver
from sim_ecu.loop.control.sanding_policies import POLICIES, SandControl, SandCycle, WhenLow, make_sanding
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.drive_scenario import DriveScenario, Sanders
from sim_ecu.loop.driver import STANDS_M_S
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.mark.lines import CLASSES, FULL_SERVICE, actuators
from sim_ecu.loop.suites.rides import KNOWN_S, LITTLE, ONSET_S, RidePlan, curve, drive, with_train
from sim_ecu.play.scenario import positions_m
from sim_ecu.play.vehicles import DEFAULT_VEHICLE, load_vehicle
from wrcd.config.config import load_packaged

SLIPPERY, BEARING = ("very low", "low"), ("greasy", "wet")  # too little for the demand; enough: sand there is false
RAILS = (*SLIPPERY, *BEARING)
NONE, AT_SLIDE, WHEN_LOW, BEFORE = "none", "at-slide", "when-low", "before-brake"
WHO = (NONE, *POLICIES, BEFORE)
LAW = "thresholds"
SPEED_M_S, DEMAND_M_S2 = 20.0, 0.9
AXLES, SANDED = 4, (1, 3)
AHEAD_S = 2.0  # before the demand
MOST_S = 300.0
_packaged = cache(load_packaged)


@dataclass(frozen=True, slots=True)
class SandedStop:
    """metres: from the demand to standstill. kg: on each rail, by all sanders. first_s: from the demand to the first
    sand on the rail; NaN where none came."""

    metres: float
    kg: float
    first_s: float


@dataclass(frozen=True, slots=True)
class SandJob:
    """A rail, one of RAILS, and the seed of the stop on it."""

    rail: str
    seed: int


@dataclass(frozen=True, slots=True)
class DrivenStops:
    """One stop by every policy of WHO."""

    rail: str
    seed: int
    stops: Mapping[str, SandedStop]


class BeforeBrake(WhenLow):
    """As WhenLow; and it knows when the demand comes, and how much. From AHEAD_S before it sands where the mean of the
    usable estimates is less than that needs: under a light brake their intervals are too wide to go by the upper end.
    """

    def __init__(self, facts: Facts) -> None:
        super().__init__(facts)
        self._needed = facts.full_brake_N_m * DEMAND_M_S2 / FULL_SERVICE / facts.carried_N_m

    def asks(self, seen: SandCycle) -> bool:
        """Return whether sand is wanted now, or will be."""
        known = [a.mu for a in seen.adhesion if a is not None]
        coming = KNOWN_S - AHEAD_S <= seen.now_us * 1e-6 < KNOWN_S
        return super().asks(seen) or (coming and bool(known) and float(np.mean(known)) < self._needed)


def scenario(job: SandJob) -> DriveScenario:
    """A light brake, then the demand; rail, track and noise are drawn, always the same for a job."""
    rng = np.random.default_rng([job.seed, 27, RAILS.index(job.rail)])
    full = -DEMAND_M_S2 / FULL_SERVICE
    course = ((0.0, -LITTLE), (KNOWN_S, -LITTLE), (KNOWN_S + ONSET_S, full))
    plan = RidePlan(((0.0, curve(rng, CLASSES[job.rail])),), SPEED_M_S, course, MOST_S, known_before=True)
    w = load_vehicle(DEFAULT_VEHICLE)
    at = positions_m(w)
    train = with_train(
        drive(plan, job.seed, rng, AXLES), w, actuators=actuators(w),
        axles=lambda a: replace(a, position_m=at[a.number - 1]),
    )  # fmt: skip
    return replace(train, stop_m_s=STANDS_M_S, sanders=Sanders(SANDED))


def drive_stops(job: SandJob) -> DrivenStops:
    """Drive a stop by every policy.

    Before any sand has come, all trains are alike, and whenever another policy asks for sand BeforeBrake asks too: a
    stop in which that lays none is the stop of them all.
    """
    s = scenario(job)
    first = _driven(s, BEFORE)
    rest = {who: _driven(s, who) if first.kg > 0.0 else first for who in WHO if who != BEFORE}
    return DrivenStops(job.rail, job.seed, {**rest, BEFORE: first})


def _driven(s: DriveScenario, who: str) -> SandedStop:
    facts = Facts.of(s)
    config = _packaged(AXLES) if who == BEFORE or (who != NONE and POLICIES[who].needs_adhesion) else None
    if who == NONE:
        sanding = None
    elif who == BEFORE:
        assert config is not None
        sanding = SandControl(facts, BeforeBrake(facts), {a.number: usable_receiver(config, a) for a in config.axles})
    else:
        sanding = make_sanding(who, facts, config)
    demand_us, from_m, kg, first_s = round(KNOWN_S * 1e6), math.nan, 0.0, math.nan
    for step in Lockstep(s, make_controller(LAW, facts, sanding=sanding), config):
        if step.due_us <= demand_us:
            from_m = step.distance_m
        kg += float(step.sand_kg.sum())
        if kg and math.isnan(first_s):
            first_s = (step.due_us - demand_us) * 1e-6
    return SandedStop(step.distance_m - from_m, kg, first_s)
