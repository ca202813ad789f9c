"""One tick of the bank, and of the whole estimator, compiled and in numpy, against filterpy."""

from collections.abc import Callable, Iterator

import numpy as np
from filterpy.kalman import KalmanFilter

from sim_ecu.design.brief import load_source
from sim_ecu.design.linear import Gains
from tests.bench.timing import Case, Goal, Row, in_turn, show
from tests.reference.filters import Models
from wrcd import resources
from wrcd.estimator.design import Design, FloatArray, load_design
from wrcd.estimator.engine import Engine, make_estimator
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.paper.bank import Bank
from wrcd.estimator.records import Tick
from wrcd.native import library

AXLES = (1, 4, 8, 32)
SPEED_M_S = 60.0  # a speed of the design's grid and of the bank's nodes: the reference discretises there exactly
TICKS = 400  # that are measured over again
TORQUE_RATIO = 0.05


def measurements(design: Design, axles: int, ticks: int = TICKS, seed: int = 1) -> FloatArray:
    """z (ticks, 2, n): noise some times as large as the sensors' own."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((ticks, 2, axles)) * (4.0 * design.noise_rms[:, None])


class Peer:
    """filterpy.KalmanFilter, predict and update with covariances, four of them per axle."""

    def __init__(self, gains: list[Gains], axles: int) -> None:
        self._filters = [[_filter(g) for g in gains] for _ in range(axles)]

    def step(self, z: FloatArray) -> None:
        """z (2, n)."""
        for axle, filters in enumerate(self._filters):
            for f in filters:
                f.update(z[:, axle])
                f.predict()

    @property
    def innovations(self) -> FloatArray:
        """(4, 2, n) of the newest tick."""
        return np.array([[f.y for f in filters] for filters in self._filters]).transpose(1, 2, 0)


def _filter(g: Gains) -> KalmanFilter:
    f = KalmanFilter(dim_x=len(g.P), dim_z=2)
    f.x, f.P, f.F, f.H, f.Q, f.R = np.zeros(len(g.P)), g.P.copy(), g.Phi, g.H, g.Q, g.R
    return f


def gains() -> list[Gains]:
    """The four models at SPEED_M_S, as the rig makes them."""
    return Models(load_source(resources.DESIGN)).at(SPEED_M_S)


def rows() -> Iterator[Row]:
    """The bank by axles, then the estimator by axles."""
    design, models = load_design(resources.DESIGN), gains()
    for axles in AXLES:
        show(f"the bank's step, {axles} axles")
        yield _bank(design, models, axles)
    for axles in AXLES[:-1]:  # as many as a train has
        show(f"the estimator's step, {axles} axles")
        yield _estimator(design, models, axles)


def _bank(design: Design, models: list[Gains], axles: int) -> Row:
    z = measurements(design, axles)
    present = np.ones((2, axles), dtype=bool)
    bank, peer = Bank(design, axles), Peer(models, axles)

    def ours(count: int) -> None:
        for i in range(count):
            bank.step(z[i % TICKS], present, SPEED_M_S)

    def peers(count: int) -> None:
        for i in range(count):
            peer.step(z[i % TICKS])

    cases = {"numpy": Case(ours, TICKS), "filterpy": Case(peers, max(4, 64 // axles))}
    row = Row("tick: the bank's step, µs", f"{axles} axles", times=in_turn(cases, 2.5))
    row.compare("filterpy", "numpy", Goal("≥", 60) if axles == 32 else None)
    return row


def _estimator(design: Design, models: list[Gains], axles: int) -> Row:
    """The whole step: offset, joints, gate, bank, noise, identity, window. filterpy's is the bank's part alone."""
    z, peer = measurements(design, axles), Peer(models, axles)
    present, ratio = np.ones((2, axles), dtype=bool), np.full(axles, TORQUE_RATIO)

    def steps(estimator: Engine) -> Callable[[int], None]:
        number = 0

        def run(count: int) -> None:
            nonlocal number
            for _ in range(count):
                result = estimator.step(Tick(number, z[number % TICKS], present, ratio, SPEED_M_S))
                if result.notable:
                    for axle in np.flatnonzero(result.needs_reset).tolist():
                        estimator.reset(axle)
                number += 1

        run(2 * TICKS)  # the window is full
        return run

    def peers(count: int) -> None:
        for i in range(count):
            peer.step(z[i % TICKS])

    cases = {"reference": Case(steps(Estimator(design, axles)), 200), "filterpy": Case(peers, max(4, 64 // axles))}
    if library() is not None:
        cases["compiled"] = Case(steps(make_estimator(design, axles)), 2000)
    row = Row("Estimator.step, µs (filterpy: its filters alone)", f"{axles} axles", times=in_turn(cases, 2.0))
    row.note = "" if library() is not None else "no compiled estimator"
    row.compare("reference", "compiled")
    row.compare("filterpy", "compiled")
    return row
