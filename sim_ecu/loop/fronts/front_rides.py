"""A stop of one axle by every set point of a law, with wrcd and without, and with a constant adhesion that is told."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from sim_ecu.loop import CREEP, THRESHOLDS, WITH
from sim_ecu.loop.control.controlled_axle import CreepConstants, CreepControl, Law, ThresholdConstants, Thresholds
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.fronts import RAILS
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.loop_rides import controlled, copied
from sim_ecu.loop.ride_figures import Figures, judge
from sim_ecu.loop.rig import Step
from sim_ecu.loop.suites.rails import GREASY_STOP, LOW_STOP, STOPS, WET_STOP, met_leaf_stop
from sim_ecu.loop.suites.rides import LoopCase

# thresholds: a factor of the slips at which a slide begins, 1 is tuned; creep: the set point, 0.029 is tuned. Chosen on
# training seeds: creep control below 0.004 has neither less energy nor less distance on most rails.
SET_POINTS: dict[str, tuple[float, ...]] = {
    THRESHOLDS: (0.35, 0.45, 0.55, 0.7, 0.85, 1.0, 1.3, 1.6),
    CREEP: (0.004, 0.006, 0.008, 0.010, 0.012, 0.019, 0.029, 0.040),
}
LEAF = "stop, leaf patch on a dry rail known before"
TOLD_PCT = (3.0, 8.0, 15.0, 25.0, 40.0)
# of the first three the loop's own runs: they have its keys
PLANS = {**{name: STOPS[name] for name in (WET_STOP, GREASY_STOP, LOW_STOP)}, LEAF: met_leaf_stop}
CASES = {rail: LoopCase("fronts", name, plan) for rail, (name, plan) in zip(RAILS, PLANS.items(), strict=True)}


@dataclass(frozen=True, slots=True)
class FrontRide:
    """What came of a stop. controller: a law, or one of WITH. told_pct: constant adhesion in the daemon's place."""

    rail: str
    law: str
    controller: str
    set_point: float
    number: int
    figures: Figures
    told_pct: float | None = None


@dataclass(frozen=True, slots=True)
class FrontWork:
    """All stops of a law on a rail with one number."""

    rail: str
    law: str
    number: int


def law_at(law: str, set_point: float) -> Law:
    """Return a law at another set point than its tuned one. The least slip of creep control scales with it: where that
    stays, all set points below 0.02 are one at low speed."""
    if law == THRESHOLDS:
        t = ThresholdConstants()
        return Thresholds(replace(t, on_m_s=set_point * t.on_m_s, on_share=set_point * t.on_share))
    c = CreepConstants()
    return CreepControl(replace(c, creep=set_point, min_slip_m_s=set_point / c.creep * c.min_slip_m_s))


def tuned(law: str) -> float:
    """Return the set point that the law was tuned to."""
    return 1.0 if law == THRESHOLDS else CreepConstants().creep


def play_one(work: FrontWork) -> list[FrontRide]:
    """Drive and judge the stops of a piece of work."""
    scenario, law = CASES[work.rail].scenario(work.number), work.law
    out = [
        FrontRide(work.rail, law, controller, set_point, work.number, judge(steps, scenario))
        for controller in (law, WITH[law])
        for set_point, steps in drive(scenario, law, controller)
    ]
    for pct in TOLD_PCT:
        steps = list(Lockstep(scenario, *controlled(scenario, WITH[law], pct)))
        out.append(FrontRide(work.rail, law, WITH[law], tuned(law), work.number, judge(steps, scenario), pct))
    return out


def drive(scenario: DriveScenario, law: str, controller: str) -> Iterator[tuple[float, list[Step]]]:
    """Yield every set point and its steps. Until the demand no law has anything to do: that is driven once."""
    made, config = controlled(scenario, controller)
    assert isinstance(made, SlipController)
    run, before = Lockstep(scenario, made, config), list[Step]()
    demand_us = round(scenario.driver.times_s[-2] * 1e6)
    while run.rig.time_us < demand_us and not run.over:
        before.append(run.step())
    for set_point in SET_POINTS[law]:
        own, own_controller = copied((run, made), run)
        for a in own_controller.axles:
            a.law = law_at(law, set_point)
        yield set_point, [*before, *own]
