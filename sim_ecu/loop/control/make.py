"""Controllers by name."""

from collections.abc import Callable

from sim_ecu.loop.control.consumer import receiver
from sim_ecu.loop.control.controller import Controller, Unprotected
from sim_ecu.loop.control.creep import CreepControl
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.law import Law
from sim_ecu.loop.control.limit import AdhesionLimit, Constants
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.control.thresholds import Thresholds
from wrcd.core.configuration import AxleConfig, Config
from wrcd.errors import InputError

LAWS: dict[str, Callable[[], Law]] = {"thresholds": Thresholds, "creep": CreepControl}
NAMES = ("none", *LAWS)
# Thresholds slide often: the estimate spares slides, and is followed up to the knee. Creep control wears more and stops
# as short as the rail allows: the estimate takes wear off, at some distance.
LIMITS = {
    "thresholds": Constants(),
    "creep": Constants(
        aim=0.955, half_widths=1.0, pull_aim=0.85, pull_rise_s=2.0, keep=(0.93, 0.985), take=(0.9, 0.97),
        hold_s=1.6, surprise=0.045, free_s=3.0,
    ),
}  # fmt: skip


def make_controller(name: str, facts: Facts, config: Config | None = None) -> Controller:
    """A controller by its name, one of NAMES; with a daemon's configuration, one that uses its adhesion.

    KeyError for another name; "none" has no use for adhesion. InputError where the configuration's adhesion message
    lacks what a controller needs of it.
    """
    if name == "none":
        return Unprotected(facts.axles, facts.actuators)
    if config is None:
        return SlipController(facts, LAWS[name])
    limits = {a.number: _limit(name, facts, config, a) for a in config.axles if a.number in facts.axles}
    return SlipController(facts, LAWS[name], limits)


def _limit(name: str, facts: Facts, config: Config, axle: AxleConfig) -> AdhesionLimit:
    heard = receiver(config, axle)
    if heard.unusable is not None:
        raise InputError(
            f"{heard.unusable}: no base for a controller",
            hint="map them in the configuration, or run the controller without adhesion",
        )
    rotation = facts.inertia_kg_m2 / facts.radius_m**2 / facts.mass_kg  # takes torque beside what the rail carries
    return AdhesionLimit(heard, facts.unit_adhesion_N_m * (1.0 + rotation), LIMITS[name])
