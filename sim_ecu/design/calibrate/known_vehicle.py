"""What is known of a vehicle before its logs are looked at: a vehicle's file, as scenarios take it.

It gives wheelbase, wheel radius and load, and what else is known. A constant that stands in it is known within a tenth,
or where a file has [interval], within that; of the others the fit takes the packaged vehicle's to begin with.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from sim_ecu.physics.wheelset import Bogie, Wheelset
from sim_ecu.play.scenario_keys import TITLE
from sim_ecu.play.suspension import read_suspension
from sim_ecu.play.vehicles import read_intervals, read_vehicle
from wrcd.config.settings import Section
from wrcd.fit.bogie import PRIOR_SIGMA, SHAFT

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
    if held is not None:
        _require(own, held)
    load_kg = own.maybe("M_v", float)
    given = [*own, *(held or ()), *read_suspension(top)]
    if "M_v" in own:
        own.pop("M_v", "", "")
    wheelset = read_vehicle(top)
    if wheelset.bogie is None:
        raise top.error("is a lone wheelset; both wheelsets of a bogie are looked at", "vehicle", "describe the bogie")
    if load_kg is not None:
        wheelset = _loaded(own, wheelset, load_kg)
    _check_usual(top, wheelset)
    intervals = _intervals(top, wheelset, given)
    TITLE.read(top)  # a found vehicle has one
    top.done()
    assert wheelset.bogie is not None
    # what is not there by the file stays away; a damper that a packaged vehicle lacks may be on this one
    lacks = {n for n in PRIOR_SIGMA if n not in given and getattr(wheelset.bogie, n, 1.0) == 0.0}
    wheelset = replace(wheelset, bogie=replace(wheelset.bogie, **{n: getattr(Bogie(), n) for n in lacks}))
    names = {name: "k_s" if name == SHAFT else name for name in PRIOR_SIGMA}
    known = intervals or dict.fromkeys(given, (0.0, 0.0))  # where intervals are given, what has none is not known
    return KnownVehicle(wheelset, {name: _sigma(name, intervals) for name, key in names.items() if key in known})


# from … to, what trains have; beyond it is a mistake of the unit
USUAL = {"r_0": (0.2, 0.65), "M_v": (1500.0, 25_000.0), "semi_wheelbase_m": (0.6, 2.5)}


def _check_usual(top: Section, w: Wheelset) -> None:
    for name, (low, high) in USUAL.items():
        value = getattr(w if hasattr(w, name) else w.bogie, name)
        if not low <= value <= high:
            table = top.section("wheelset" if hasattr(w, name) else "vehicle")
            raise table.error(f"is {value:g}, of trains from {low:g} to {high:g}", name, "look at its unit")


def _intervals(top: Section, w: Wheelset, given: Collection[str]) -> Mapping[str, tuple[float, float]]:
    intervals = read_intervals(top)
    for name, (low, high) in intervals.items():
        value = getattr(w if hasattr(w, name) else w.bogie, name)
        if name not in given or not low <= value <= high:
            reason = f"does not hold the constant, {value:g}" if name in given else "is of a constant that is not given"
            raise top.section("interval").error(reason, name, "give both, or neither")
    return intervals


def _require(own: Section, held: Section) -> None:
    if "semi_wheelbase_m" not in held:
        raise held.error("is missing", "semi_wheelbase_m", "half of the way from axle to axle is needed")
    if "r_0" not in own:
        raise own.error("is missing", "r_0", "the wheels' radius in m is needed")
    if ("M_v" in own) == ("body_mass_kg" in held):
        hint = "the load of a wheelset is needed: give it, in kg, or body_mass_kg of [vehicle]"
        raise own.error("and body_mass_kg are both there" if "M_v" in own else "is missing", "M_v", hint)


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
    if (key := "k_s" if name == SHAFT else name) in intervals:
        low, high = intervals[key]
        return math.log(high / max(low, 1e-9 * high)) / (2 * OF_90_PERCENT)
    return min(SIGMA_OF_KNOWN, PRIOR_SIGMA[name])
