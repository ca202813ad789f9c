"""Scenarios of ordinary running, to find a vehicle's constants in: both wheelsets of a bogie cruise, coast, accelerate
and brake over pieces of dry rail, with a curve now and then; their sensors are drawn as a design's training draws
them."""

import math
from dataclasses import replace

import numpy as np

from sim_ecu.design.train_worlds import off_sensors
from sim_ecu.physics.contact import curve_between
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet, drawn
from sim_ecu.physics.track import SPECTRA, Spectrum
from sim_ecu.physics.wheelset import FloatArray, Wheelset
from sim_ecu.play.scenario import AxleScenario, Course, DriveCourse, Scenario

Rng = np.random.Generator
FRICTION = (0.25, 0.45)
SLOWEST_M_S, FASTEST_M_S = 9.0, 40.0
CANT_SPEED_M_S, MAX_CANT = 20.0, 0.1


def speed_course(rng: Rng, seconds: float, fastest_m_s: float = FASTEST_M_S) -> Course:
    """Draw speeds: half of the time cruising, else coasting or on the way to another speed."""
    t, v = 0.0, rng.uniform(SLOWEST_M_S, fastest_m_s)
    times, speeds = [t], [v]
    while t < seconds:
        kind = rng.choice(["cruise", "cruise", "coast", "change"])
        if kind == "change":
            to = math.exp(rng.uniform(math.log(SLOWEST_M_S), math.log(fastest_m_s)))
            lasts = max(abs(to - v) / rng.uniform(0.2, 0.6), 0.1)
        else:
            lasts = rng.uniform(15.0, 60.0)
            to = v + lasts * (rng.uniform(-0.02, 0.02) if kind == "cruise" else rng.uniform(-0.08, -0.03))
        t, v = t + lasts, min(max(to, SLOWEST_M_S), fastest_m_s)
        times.append(t)
        speeds.append(v)
    return Course(tuple(times), tuple(speeds))


def dry_rail(rng: Rng, metres: float) -> FloatArray:
    """Draw pieces of dry rail, each with a friction and a slope of its own; one in five is a curve."""
    sections, at, of_line = [], 0.0, math.exp(rng.normal(0.0, 0.3))
    while at < metres + 500.0:
        curve, slope = curve_between(math.exp(rng.uniform(*np.log(FRICTION)))), of_line * math.exp(rng.normal(0, 0.15))
        curvature = float(rng.choice([-1, 1])) / rng.uniform(1500.0, 4000.0) if rng.random() < 0.2 else 0.0
        cant = math.copysign(min(abs(curvature) * CANT_SPEED_M_S**2 / 9.81, MAX_CANT), curvature)
        curve = replace(curve, k_A=curve.k_A * slope, k_S=curve.k_S * slope)
        sections.append(RailSection(at, curve, curvature, cant, transition_m=60.0, edge_m=20.0))
        at += rng.uniform(300.0, 1500.0)
    return rail_table(sections)


def drawn_sensors(rng: Rng) -> tuple[SensorSet, SensorSet]:
    """Draw two sets of one type: what is inside is alike, how they are mounted is not."""
    one, other = (off_sensors(drawn(rng), rng) for _ in range(2))
    return one, replace(other, sampling=one.sampling)


def ordinary_running(
    vehicle: Wheelset, seed: int, minutes: float, track: Spectrum = SPECTRA["erri-low"], plain: bool = False,
    fastest_m_s: float = FASTEST_M_S,
) -> Scenario:  # fmt: skip
    """Return the scenario of a seed. plain: sensors of the set `mems`, not drawn ones."""
    assert vehicle.bogie is not None
    rng, seconds = np.random.default_rng([seed, 1]), 60.0 * minutes
    speed = speed_course(rng, seconds, fastest_m_s)
    t = np.arange(0.0, seconds, 0.1)
    v = speed.at(t)
    # what the train needs, and what it runs against
    torque = vehicle.M_v * vehicle.r_0 * (np.gradient(v, 0.1) + 0.02 + 2e-5 * v**2)
    torque = np.convolve(torque, np.ones(20) / 20, mode="same")
    rail = dry_rail(rng, float(v.sum() * 0.1))
    sensors = (SENSOR_SETS["mems"],) * 2 if plain else drawn_sensors(rng)
    places, unlimited = (0.0, -vehicle.bogie.wheelbase_m), Course((0.0,), (20.0,))
    axles = tuple(
        AxleScenario(
            number=k + 1, rail=rail, track=track, sensors=sensors[k], seed=16 * seed + k, position_m=places[k],
            drive=DriveCourse(
                "torque_N_m", Course(tuple(t.tolist()), tuple((torque * rng.uniform(0.95, 1.05)).tolist())), unlimited
            ),
            track_seed=16 * seed + 9,
        )
        for k in range(2)
    )  # fmt: skip
    return Scenario("ordinary-running", "", seconds, speed, True, vehicle, axles)
