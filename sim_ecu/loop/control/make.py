"""Controllers by name."""

from collections.abc import Callable

from sim_ecu.loop.control.controller import Controller, Unprotected
from sim_ecu.loop.control.creep import CreepControl
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.law import Law
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.control.thresholds import Thresholds
from wrcd.core.configuration import Config

LAWS: dict[str, Callable[[], Law]] = {"thresholds": Thresholds, "creep": CreepControl}
NAMES = ("none", *LAWS)


def make_controller(name: str, facts: Facts, config: Config | None = None) -> Controller:
    """A controller by its name, one of NAMES; with a daemon's configuration, one that uses its adhesion.

    KeyError for another name; "none" has no use for adhesion.
    """
    if name == "none":
        return Unprotected(facts.axles, facts.actuators)
    return SlipController(facts, LAWS[name])
