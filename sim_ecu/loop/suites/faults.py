"""Every fault of `sim-ecu inject` that frames can carry, in the middle of a stop on a greasy rail known before."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from sim_ecu.loop.names import BARE_AND_WITH, LAWS, WITH
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.loop.suites.case import GREASY, KNOWN_S, Case, Plan, Rng, asks, curve
from sim_ecu.play.faults import ALL, KINDS, Fault, Stage

AT_S, FOR_S = KNOWN_S + 2.0, 2.0
NONE, NONE_OF_TWO = "no fault", "no fault, two axles"
AWAY = "bus away (link-down, device-gone, bus-off)"
# Beside the default amounts, of all signals of axle 1: faults of one signal that a controller's limit depends on.
MORE = (
    Fault("bias", AT_S, FOR_S, "torque", amount=-3000.0), Fault("bias", AT_S, FOR_S, "speed"),
    Fault("freeze", AT_S, FOR_S, "speed"), Fault("reverse", AT_S, FOR_S, "torque"),
)  # fmt: skip
LOSS = 0.3  # of the frames: two in a hundred do nothing


def short_stop(rng: Rng) -> Plan:
    """From 15 to 17 m/s on a greasy rail known before."""
    rail = ((0.0, curve(rng, GREASY)),)
    return Plan(rail, float(rng.uniform(15.0, 17.0)), asks(-1.0, rng, True), 50.0, True)


def faults() -> Iterator[Case]:
    """Nothing of a fault reaches a bare controller: its runs are those without one."""
    yield Case("faults", NONE, short_stop, key="faults", controllers=BARE_AND_WITH, shown=True)
    yield Case("faults", NONE_OF_TWO, short_stop, 2, key="faults", controllers=BARE_AND_WITH)
    every = [
        Fault(name, AT_S, FOR_S, ALL, amount=LOSS if name == "loss" else None)
        for name, kind in KINDS.items()
        if kind.stage is not Stage.BUS
    ]
    for fault in sorted((*every, *MORE), key=lambda f: list(KINDS).index(f.kind)):
        two = fault.kind.startswith("swap")
        yield Case(
            "faults", name_of(fault), short_stop, 2 if two else 1, key="faults", bare=NONE_OF_TWO if two else NONE,
            controllers=tuple(WITH[law] for law in LAWS), fault=fault,
        )  # fmt: skip
    # who demands falls silent, too: the bare runs have it as well
    away = Fault("link-down", AT_S, FOR_S)
    yield Case("faults", AWAY, short_stop, world=_away(away), key="faults", controllers=BARE_AND_WITH)


def name_of(fault: Fault) -> str:
    """For a row."""
    return f"{fault.kind}, {'all signals' if fault.of == ALL else fault.of.replace('_', ' ')}"


def _away(fault: Fault) -> Callable[[DriveScenario, Rng], DriveScenario]:
    return lambda s, _: replace(s, train=replace(s.train, faults=(fault,)))
