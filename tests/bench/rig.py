"""The rig's simulation: a train against real time, and a batch of bogies against one after another."""

from collections.abc import Iterator

import numpy as np

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.simulation import Axle, Simulation, advance_side_by_side
from sim_ecu.physics.track import SPECTRA, Track
from sim_ecu.play.vehicles import load_vehicle
from tests.bench.timing import Case, Figure, Goal, Row, in_turn, show

TICK_US = 5_000
SPEED_M_S, UTILISATION = 25.0, 0.5
SAMPLES = 200  # in one call: a second
BOGIES = 64
UNIT = load_vehicle("multiple-unit")


def bogies(curve: str, number: int, seed: int = 1) -> Simulation:
    """So many bogies of the default vehicle, 19 m apart on one track with cross-level and gauge."""
    assert UNIT.bogie is not None
    rail, track = rail_table([RailSection(0.0, CURVES[curve])]), Track(SPECTRA["erri-low"], seed)
    places = [-19.0 * k - at for k in range(number) for at in (0.0, UNIT.bogie.wheelbase_m)]
    track.ensure_behind(-places[-1])
    return Simulation(UNIT, [Axle(rail, track, at) for at in places], SPEED_M_S)


def rows() -> Iterator[Row]:
    """Four axles by rail, then the batch."""
    for curve, word in (("A", "dry"), ("C", "wet")):
        show(f"the rig's four axles on {word} rail")
        yield _train(curve, word)
    show(f"the rig's {BOGIES} bogies side by side")
    yield _batch()


def _train(curve: str, word: str) -> Row:
    sim = bogies(curve, 2)

    def run(count: int) -> None:
        sim.advance(command(count, 4, utilisation=UTILISATION), np.full(count, SPEED_M_S))

    row = Row("rig: a sample of 5 ms, µs", f"four axles on two bogies, {word} rail")
    row.times = in_turn({"ours": Case(run, SAMPLES)}, 3.0)
    row.figures.append(Figure("real time / ours", TICK_US / row.times["ours"].median, Goal("≥", 15), unit="times"))
    return row


def _batch() -> Row:
    """Of bogies that start alike on tracks of their own; a unit is a sample of all of them."""
    held, one, all_of_them = (
        np.full(SAMPLES, SPEED_M_S), command(SAMPLES, 2, utilisation=UTILISATION),
        command(SAMPLES, 2 * BOGIES, utilisation=UTILISATION),
    )  # fmt: skip
    alone, together = ([bogies("C", 1, seed) for seed in range(BOGIES)] for _ in range(2))

    def one_by_one(_: int) -> None:
        for sim in alone:
            sim.advance(one, held)

    def side_by_side(_: int) -> None:
        advance_side_by_side(together, all_of_them, held)

    row = Row("rig: a sample of 5 ms, µs", f"{BOGIES} bogies, wet rail")
    row.times = in_turn({"side by side": Case(side_by_side, SAMPLES), "one by one": Case(one_by_one, SAMPLES)}, 8.0)
    row.compare("one by one", "side by side", Goal("≥", 3))
    return row
