"""One stop as each policy drives it: what comes of a decision to brake, and where it was taken."""

from dataclasses import dataclass

import numpy as np

from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.braking_rate import RATES, needed_m_s2
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.driver import LEVER_US, REACTION_S, STANDS_M_S, Advised, MarkDriver
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.mark.approach import Advices, advised_configuration
from sim_ecu.loop.mark.lines import FULL_SERVICE, MOST_S, Stop, braking_m
from sim_ecu.loop.ride_figures import SLIDE_M_S, SLIDE_SHARE
from sim_ecu.loop.rig import Rig
from sim_ecu.physics.contact import Contact, peak, traction_ratio
from sim_ecu.physics.rail import FloatArray, rail_at
from sim_ecu.play.encoder import SAMPLE_US
from wrcd.core.configuration import Config

G = 9.80665
LAW = "thresholds"
ROLLS = 0.86  # of the lowest adhesion on the way: a train that demands less does not slide, and is not simulated
ADHERES_M_S = 0.3  # slip of a wheel that does not slide
RUNS_OUT = 600  # samples in which its resistance is measured
LAG_S = 0.1  # of its brake
WARM_UP_US = 4_000_000  # of the daemon, before a test
SETTLES_US = 1_000_000  # before the brake: the controller finds its reference
SLIDES_FROM_M_S = 3.0  # a slide at a lower speed is not judged
HALVINGS = 12
PLACES = 60  # on the way at which the rail is looked at


@dataclass(frozen=True, slots=True)
class StopOutcome:
    """What became of a stop. rate_m_s2: planned with; past_m: the mark, at standstill; seconds: until then, from the
    approach's begin; slip_energy_kJ: of a wheel; tested: whether a brake test came before."""

    rate_m_s2: float
    past_m: float
    seconds: float
    slid: bool
    slip_energy_kJ: float
    tested: bool


def stands(who: MarkDriver, stop: Stop, heard: Advices = ()) -> StopOutcome:
    """Return what a driver makes of a stop. heard: what wrcd advises on the approach, for one who listens to it."""
    _coast(stop, who, heard)
    advised = isinstance(who.rule, Advised) and who.begun_us is None
    decided_us = _decided_us(who)
    at_m = stop.speed_m_s * decided_us * 1e-6
    needed = needed_m_s2(stop.speed_m_s, stop.mark_m - at_m - REACTION_S * stop.speed_m_s)
    most, way = (needed, who.rate_m_s2) if who.begun_us is not None else (RATES.dry, RATES.least)
    if not advised and _rolls(stop, most, way):
        return _rolled(stop, who, _Moving(decided_us, at_m, stop.speed_m_s))
    return _simulated(stop, who, advised_configuration() if advised else None)


def _coast(stop: Stop, who: MarkDriver, heard: Advices) -> None:
    """Let a driver coast until the brake is decided on, or a test of it."""
    now_us, coming = 0, 0
    while who.begun_us is None and who.tested_us is None:
        while coming < len(heard) and heard[coming][0] <= now_us:
            stamp_us, can_id, data = heard[coming]
            who.hear(can_id, data, stamp_us)
            coming += 1
        who.demand(now_us, stop.speed_m_s * now_us * 1e-6, stop.speed_m_s, stop.mark_m)
        now_us += LEVER_US


def _decided_us(who: MarkDriver) -> int:
    decided = who.begun_us if who.tested_us is None else who.tested_us
    assert decided is not None
    return decided


@dataclass(frozen=True, slots=True)
class _Moving:
    """A train on its way, and what it has come to so far."""

    now_us: int
    position_m: float
    speed_m_s: float
    brakes_m_s2: float = 0.0
    slid: bool = False
    slip_energy_kJ: float = 0.0  # of a wheel


def _simulated(stop: Stop, who: MarkDriver, config: Config | None) -> StopOutcome:
    """The rest of a stop on the rig, with slide protection. config: of a daemon, until the brake is decided on for
    good; it starts some seconds before the test. What cannot slide from then on is rolled."""
    before_us = SETTLES_US if config is None else WARM_UP_US
    run = Lockstep(stop.scenario, make_controller(LAW, Facts.of(stop.scenario)), config, driver=who)
    run.rig.coast(max(_decided_us(who) - before_us, 0) // SAMPLE_US)
    wheels, energy, slid = 2 * len(stop.scenario.axles), 0.0, False
    for step in run:
        energy += float(step.slip_energy_J.sum()) / wheels / 1e3
        bound = min(SLIDE_M_S, SLIDE_SHARE * step.speed_m_s)
        slip = float(np.abs(step.slip_m_s).max())
        slid = slid or (step.speed_m_s >= SLIDES_FROM_M_S and slip > bound)
        if run.core is not None and who.begun_us is not None:
            run.end_daemon()
            needed = needed_m_s2(step.speed_m_s, stop.mark_m - step.distance_m)
            if _rolls(stop, max(needed, -FULL_SERVICE * step.share), who.rate_m_s2) and slip < ADHERES_M_S:
                brakes = -FULL_SERVICE * step.share
                return _rolled(
                    stop, who, _Moving(step.due_us, step.distance_m, step.speed_m_s, brakes, slid, energy)
                )  # fmt: skip
    return StopOutcome(
        who.rate_m_s2, step.distance_m - stop.mark_m, step.due_us * 1e-6, slid, energy, who.tested_us is not None,
    )  # fmt: skip


def _rolls(stop: Stop, most_m_s2: float, planned_m_s2: float) -> bool:
    """Whether a train that brakes with so much at most does not slide on the way of a stop that is planned so."""
    return most_m_s2 < ROLLS * G * least_adhesion(stop, planned_m_s2)


def _rolled(stop: Stop, who: MarkDriver, at: _Moving) -> StopOutcome:
    """The rest of a stop whose wheels do not slide: a mass, its brake, its resistance, and the creep curve."""
    position, speed, brakes, now_us, demand = at.position_m, at.speed_m_s, at.brakes_m_s2, at.now_us, at.brakes_m_s2
    free_us, dt, energy = _decided_us(who) + REACTION_S * 1e6, SAMPLE_US * 1e-6, 0.0
    contact, rail = stop.scenario.train.wheelset.contact, stop.scenario.train.axles[0].rail
    resistance = _resistance_m_s2(stop) / stop.speed_m_s  # it falls with the speed
    while speed > STANDS_M_S and now_us < MOST_S * 1e6:
        if now_us % LEVER_US == 0:
            demand = -FULL_SERVICE * who.demand(now_us, position, speed, stop.mark_m)
            slip = speed * _creep(brakes / G, max(speed, SLIDES_FROM_M_S), contact, rail_at(rail, position)[:5])
            energy += brakes / G * contact.normal_N * slip * LEVER_US * 1e-9
        brakes += (demand - brakes) * dt / LAG_S
        slower = (brakes + resistance * speed * (now_us > free_us)) * dt
        position += (speed - 0.5 * slower) * dt
        speed -= slower
        now_us += SAMPLE_US
    return StopOutcome(
        who.rate_m_s2, position - stop.mark_m, now_us * 1e-6, at.slid, at.slip_energy_kJ + energy,
        who.tested_us is not None,
    )  # fmt: skip


def _creep(mu: float, speed_m_s: float, contact: Contact, curve: FloatArray) -> float:
    """The creep at which a rail gives so much, below its peak: by halving."""
    low, high = 0.0, float(peak(speed_m_s, contact, *curve)[0])
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if traction_ratio(middle, speed_m_s, contact, *curve) < mu:
            low = middle
        else:
            high = middle
    return low


def _resistance_m_s2(stop: Stop) -> float:
    """By which a train without brake slows down: what its wheelsets' hunting on the track takes."""
    rig = Rig(stop.scenario, [])
    rig.coast(RUNS_OUT)
    rig.coast(RUNS_OUT, holds_speed=False)
    return (stop.speed_m_s - rig.speed_m_s) / (RUNS_OUT * SAMPLE_US * 1e-6)


def least_adhesion(stop: Stop, rate_m_s2: float) -> float:
    """The lowest adhesion on the way of a stop at a rate, at the speed that the train has there."""
    contact, rail = stop.scenario.train.wheelset.contact, stop.scenario.train.axles[0].rail
    way_m = min(braking_m(stop.speed_m_s, rate_m_s2), stop.mark_m)
    left = np.linspace(1.0, 0.0, PLACES)
    speeds = np.maximum(stop.speed_m_s * np.sqrt(left), SLIDES_FROM_M_S)
    places = stop.mark_m - way_m * left
    return min(
        float(peak(float(v), contact, *rail_at(rail, float(at))[:5])[1]) for v, at in zip(speeds, places, strict=True)
    )


def known_rate(stop: Stop) -> float:
    """The rate of who knows the rail: KEPT of the lowest adhesion on the way."""
    rate = RATES.dry
    for _ in range(6):
        rate = min(max(RATES.kept * G * least_adhesion(stop, rate), RATES.least), RATES.dry)
    return rate
