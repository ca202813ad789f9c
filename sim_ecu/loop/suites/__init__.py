"""What `sim-ecu loop` drives: cases, each with as many runs as there are seeds."""

from collections.abc import Callable, Iterator

from sim_ecu.loop import SUITES
from sim_ecu.loop.suites.rails import braking, traction, train
from sim_ecu.loop.suites.rides import LoopCase
from sim_ecu.loop.suites.variants import actuators, faults, worlds

_MAKERS: dict[str, Callable[[], Iterator[LoopCase]]] = {
    "braking": braking, "traction": traction, "train": train, "faults": faults, "worlds": worlds,
    "actuators": actuators,
}  # fmt: skip


def cases(suite: str | None = None, only: str = "") -> list[LoopCase]:
    """Return the cases of one suite, or of all in the order of the report; only those whose name holds a text, and
    those whose bare runs they share."""
    every = [case for name in SUITES if suite in (None, name) for case in _MAKERS[name]()]
    selected = [case for case in every if only in case.name]
    shared = {(case.suite, case.bare) for case in selected}
    return [case for case in every if case in selected or (case.suite, case.name) in shared]
