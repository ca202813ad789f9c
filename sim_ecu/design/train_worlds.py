"""How a world differs from the one that its design thinks of: of a train drawn alike for training and for judging.

Every range is for `wider` 1, the training's; judging stretches it to 1.5 and adds kinds that the training has not
(`sim_ecu/score/suites/worlds.py`).
"""

import math
import textwrap
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from sim_ecu.physics.contact import CreepCurve
from sim_ecu.physics.sensors import SensorSet
from sim_ecu.physics.track import SPECTRA, Spectrum
from sim_ecu.physics.wheelset import GRAVITY, Bogie, Wheelset

Rng = np.random.Generator
# Shares by which the wheelset's parameters are off at most. In a bogie k_w and M_v are the bogie's: of its suspension
# one standard deviation, and the most. Springs and dampers of one type scatter so.
OFF = {"m_w": 0.1, "I_w": 0.1, "k_w": 0.1, "I_R": 0.1, "I_L": 0.1, "k_s": 0.1, "C_s": 0.1, "a": 0.1, "b": 0.1,
       "gamma": 0.3, "M_v": 0.15}  # fmt: skip
OF_BOGIE = ("k_w", "M_v")
SUSPENSION_SIGMA, SUSPENSION_MOST = 0.05, 0.1
SUSPENSION = tuple(f for f in Bogie.__dataclass_fields__ if f.startswith(("primary", "secondary")))
SLOPE = 2.0  # k_A and k_S are off by a factor of up to this, both ways: nothing ties the slope to the friction
OFF_K_A, OFF_TORQUE = 0.3, 0.03
GYRO_BIAS, LAT_ACCEL_BIAS = math.radians(0.5), 0.049  # 0.5 degrees per second, 5 mg
# Curves: radius from so much (m) on, lateral acceleration that the cant does not balance, and the most cant, 150 mm
# over 1.5 m.
RADIUS_M, DEFICIENCY_M_S2, CANT = 800.0, 0.65, 0.1
EDGE_M = (0.5, 30.0)  # of a film: the rail goes from one state to the next over so much
BRAKES_M_S2 = 1.2  # full service
COASTING = 0.08  # of full service, either way: what a train coasts with at most
OTHERS = 2  # conditions in other worlds for each in the design's own
# Shares of the conditions in other worlds: with slopes untied, with sensors that sample inside a shaken axle box, on
# tracks smoother than the plan's, and with each of curves, film edges and a change of speed.
UNTIED, SAMPLED, SMOOTH, SOME = 0.7, 0.4, 0.2, 0.4
SMOOTHEST = 0.1  # of the plan's smoothest track's density
CONSTANTS_WIDTH = 100  # characters of a line of them
BEGINS, TRANSITION_S = 0.5, (1.0, 3.0)  # of the curves, those that begin while the train runs; over so long


def off(rng: Rng, most: float) -> float:
    """Return a factor, evenly within 1 less and more `most`."""
    return 1.0 + float(rng.uniform(-most, most))


def off_vehicle(w: Wheelset, rng: Rng, wider: float = 1.0) -> Wheelset:
    """Return a vehicle whose parameters are not those of its design. M_v follows from the masses."""
    assert w.bogie is not None
    b, most = w.bogie, SUSPENSION_MOST * wider
    held = {
        name: getattr(b, name) * (1.0 + float(np.clip(rng.normal(0.0, SUSPENSION_SIGMA * wider), -most, most)))
        for name in SUSPENSION
    }
    bogie = replace(b, body_mass_kg=b.body_mass_kg * off(rng, OFF["M_v"] * wider), **held)
    own = {name: getattr(w, name) * off(rng, most * wider) for name, most in OFF.items() if name not in OF_BOGIE}
    out = replace(w, bogie=bogie, **own)
    return replace(out, M_v=bogie.carried_kg(out.m_w))


def off_slope(curve: CreepCurve, factor: float) -> CreepCurve:
    """Return a curve that begins so many times as steep; its friction stays."""
    return replace(curve, k_A=curve.k_A * factor, k_S=curve.k_S * factor)


def slope_factor(rng: Rng, wider: float = 1.0) -> float:
    """Draw how far the slope is from that of the friction, evenly in the logarithm."""
    most = math.log(SLOPE) * wider
    return math.exp(rng.uniform(-most, most))


def curve_and_cant(speed_m_s: float, rng: Rng, wider: float = 1.0) -> tuple[float, float]:
    """Draw a curvature (1/m) and a cant (rad) that leave no more unbalanced than trains are run with."""
    way = float(rng.choice([-1.0, 1.0]))
    left = DEFICIENCY_M_S2 * wider
    most = min(wider / RADIUS_M, (left + GRAVITY * CANT) / speed_m_s**2)
    curvature = most * float(rng.uniform(0.1, 1.0))
    lateral = curvature * speed_m_s**2
    cant = float(rng.uniform(max((lateral - left) / GRAVITY, 0.0), max(min((lateral + left) / GRAVITY, CANT), 0.0)))
    return way * curvature, way * cant


def smoother(track: Spectrum, rng: Rng) -> Spectrum:
    """Return a track whose density is a tenth of the given one's at least: as smooth as that of a new line."""
    return track.scaled(SMOOTHEST ** float(rng.random()))


def off_sensors(s: SensorSet, rng: Rng, wider: float = 1.0) -> SensorSet:
    """Return the set with constant errors and a torque that is known to some per cent."""
    return replace(
        s,
        torque=replace(s.torque, gain=off(rng, OFF_TORQUE * wider)),
        yaw_rate=replace(s.yaw_rate, bias=GYRO_BIAS * wider * (off(rng, 1.0) - 1.0)),
        lat_accel=replace(s.lat_accel, bias=LAT_ACCEL_BIAS * wider * (off(rng, 1.0) - 1.0)),
    )


def track(rng: Rng, roughness: tuple[float, float], in_bogie: bool = True, wider: float = 1.0) -> Spectrum:
    """Draw a track of ERRI's form, its density so many times that of ERRI low; the ends of the range are drawn more.
    A lone wheelset's has alignment alone."""
    low, high = roughness[0] / wider, roughness[1] * wider
    factor: float = low * (high / low) ** (0.5 - 0.5 * math.cos(math.pi * rng.random()))
    return SPECTRA["erri-low" if in_bogie else "good"].scaled(factor)


def sentences(w: Wheelset, roughness: tuple[float, float]) -> list[str]:
    """Say for which vehicle and in what worlds a design was trained; the first sentence is the vehicle's."""
    if w.bogie is None:
        return [f"vehicle {w.name}: a lone wheelset, its yaw spring on the ground"]
    b = w.bogie
    return [
        f"vehicle {w.name}: two wheelsets {b.wheelbase_m:g} m apart in a bogie under half a car body, "
        f"{1e-3 * w.M_v:.3g} t on a wheelset",
        f"track: ERRI low times {roughness[0]:g} to {roughness[1]:g} (density), with cross-level and gauge",
        f"{OTHERS} of {OTHERS + 1} conditions in other worlds than the design's own, drawn one by one:",
        f"inertias within {_pct(OFF['m_w'])}, conicity {_pct(OFF['gamma'])}, load {_pct(OFF['M_v'])}, suspension "
        f"{_pct(SUSPENSION_MOST)} (one sigma {_pct(SUSPENSION_SIGMA)})",
        f"slope of the creep curves: k_A within {_pct(OFF_K_A)} of the friction's; in {UNTIED:.0%} also a factor of "
        f"{1 / SLOPE:g} to {SLOPE:g}",
        f"torque within {_pct(OFF_TORQUE)}, gyro offset up to {math.degrees(GYRO_BIAS):g} degrees/s, accelerometer "
        f"offset up to {LAT_ACCEL_BIAS:g} m/s2",
        f"in {SMOOTH:.0%} tracks down to a tenth as rough",
        f"in {SAMPLED:.0%} sensors that sample inside at 1 to 8 kHz on a shaken axle box; speed off by 1 to 3 %",
        f"in {SOME:.0%} curves down to {RADIUS_M:g} m with cant and up to {DEFICIENCY_M_S2:g} m/s2 beside it; half "
        "of them begin on the way",
        f"in {SOME:.0%} film edges of {EDGE_M[0]:g} to {EDGE_M[1]:g} m; in {SOME:.0%} up to {BRAKES_M_S2:g} m/s2 of "
        "braking or traction",
    ]


def calibrated(w: Wheelset, origin: Mapping[str, Any]) -> list[str]:
    """Say which constants come from a train's own logs, and when. origin: `date`, and `logs`, a list."""
    known = {**({} if w.bogie is None else asdict(w.bogie)), "m_w": w.m_w, "I_w": w.I_w, "gamma": w.gamma}
    facts = ", ".join(f"{name} {value:.4g}" for name, value in known.items() if not name.startswith("flange"))
    logs = origin.get("logs", ())
    return [
        f"calibrated {origin.get('date', 'at an unknown date')} from {len(logs)} log{'s' * (len(logs) != 1)}:",
        *textwrap.wrap(facts, CONSTANTS_WIDTH, break_on_hyphens=False),
    ]


def _pct(share: float) -> str:
    return f"{100 * share:g} %"
