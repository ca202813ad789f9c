"""What `sim-ecu loop` drives: cases, each with as many runs as there are seeds."""

from collections.abc import Callable, Iterator

from sim_ecu.loop.names import SUITES
from sim_ecu.loop.suites.actuators import actuators
from sim_ecu.loop.suites.case import Case
from sim_ecu.loop.suites.faults import faults
from sim_ecu.loop.suites.rails import braking, traction, train
from sim_ecu.loop.suites.worlds import worlds

_MAKERS: dict[str, Callable[[], Iterator[Case]]] = {
    "braking": braking, "traction": traction, "train": train, "faults": faults, "worlds": worlds,
    "actuators": actuators,
}  # fmt: skip


def cases(suite: str | None = None) -> list[Case]:
    """Of one suite, or of all in the order of the report."""
    return [case for name in SUITES if suite in (None, name) for case in _MAKERS[name]()]
