"""What is known of a vehicle before its logs are looked at: a vehicle's file, as scenarios take it.

It gives wheelbase, wheel radius and load, and what else is known. A constant that stands in it is known within a tenth,
or within its [interval]; of the others the fit takes the packaged vehicle's to begin with.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.suspension import read_suspension
from sim_ecu.play.vehicles import read_intervals, read_vehicle
from wrcd.config.settings import Section
from wrcd.fit.bogie import PRIOR_SIGMA

SIGMA_OF_KNOWN = 0.06  # log: within a tenth, with 90 %
OF_90_PERCENT = 1.645  # standard deviations of a half width


@dataclass(frozen=True, slots=True)
class KnownVehicle:
    """Where the fit begins, and one standard deviation (log) of each constant that is known better than usual."""

    wheelset: Wheelset
    sigma: Mapping[str, float]


def read_known(top: Section) -> KnownVehicle:
    """Read known.toml. Raises InputError for a lone wheelset, and where wheelbase, radius or load are missing."""
    named = isinstance(top.raw("vehicle"), str)
    own, held = top.section("wheelset"), None if named else top.section("vehicle")
    load_kg = own.maybe("M_v", float)
    if held is not None:
        _require(own, held, load_kg)
    given = [*own, *(held or ()), *read_suspension(top)]
    if load_kg is not None:
        own.pop("M_v", "", "")
    wheelset = read_vehicle(top)
    if wheelset.bogie is None:
        raise top.error("is a lone wheelset; both wheelsets of a bogie are looked at", "vehicle", "describe the bogie")
    if load_kg is not None:
        wheelset = _loaded(own, wheelset, load_kg)
    intervals = read_intervals(top)
    top.done()
    return KnownVehicle(wheelset, {name: _sigma(name, intervals) for name in PRIOR_SIGMA if name in given})


def _require(own: Section, held: Section, load_kg: float | None) -> None:
    if "semi_wheelbase_m" not in held:
        raise held.error("is missing", "semi_wheelbase_m", "half of the way from axle to axle is needed")
    if "r_0" not in own:
        raise own.error("is missing", "r_0", "the wheels' radius in m is needed")
    if (load_kg is None) == ("body_mass_kg" not in held):
        hint = "the load of a wheelset is needed: give it, in kg, or body_mass_kg of [vehicle]"
        raise own.error("is missing" if load_kg is None else "and body_mass_kg are both there", "M_v", hint)


def _loaded(own: Section, w: Wheelset, load_kg: float) -> Wheelset:
    """The vehicle with the body that makes the load."""
    assert w.bogie is not None
    body_kg = 2 * (load_kg - w.m_w) - w.bogie.frame_mass_kg
    if body_kg <= 0:
        raise own.error(
            f"is {load_kg:g} kg, less than wheelset and frame weigh", "M_v", "it is what a wheelset carries"
        )
    return replace(w, M_v=load_kg, bogie=replace(w.bogie, body_mass_kg=body_kg))


def _sigma(name: str, intervals: Mapping[str, tuple[float, float]]) -> float:
    if name in intervals:
        low, high = intervals[name]
        return math.log(high / max(low, 1e-9 * high)) / (2 * OF_90_PERCENT)
    return min(SIGMA_OF_KNOWN, PRIOR_SIGMA[name])
