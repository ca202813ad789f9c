"""One tick of the bank, and of the whole estimator, against filterpy and a C loop of the same arithmetic."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from filterpy.kalman import KalmanFilter

from sim_ecu.design.brief import load_source
from sim_ecu.design.linear import Gains
from tests.bench.native import BankLoop, library
from tests.bench.timing import Case, Goal, Row, in_turn, show
from tests.reference.filters import Models
from wrcd import resources
from wrcd.estimator.design import MODELS, Design, FloatArray, load_design
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.paper.bank import Bank
from wrcd.estimator.records import Tick

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
    for axles in AXLES:
        show(f"the estimator's step, {axles} axles")
        yield _estimator(design, models, axles)


def _bank(design: Design, models: list[Gains], axles: int) -> Row:
    z, c = measurements(design, axles), library()
    present = np.ones((2, axles), dtype=bool)
    bank, peer = Bank(design, axles), Peer(models, axles)

    def ours(count: int) -> None:
        for i in range(count):
            bank.step(z[i % TICKS], present, SPEED_M_S)

    def peers(count: int) -> None:
        for i in range(count):
            peer.step(z[i % TICKS])

    cases = {"ours": Case(ours, TICKS), "filterpy": Case(peers, max(4, 64 // axles))}
    if c is not None:
        loop = BankLoop(c, design, axles, np.full(TICKS, SPEED_M_S))
        e, w = np.empty((2, TICKS, MODELS, 2, axles))
        cases["C"] = Case(partial(_all_ticks, loop, z, e, w), TICKS)
    row = Row("tick: the bank's step, µs", f"{axles} axles", times=in_turn(cases, 2.5))
    row.note = "" if c is not None else "C skipped: no compiler (cc)"
    row.compare("filterpy", "ours", Goal("≥", 60) if axles == 32 else None)
    row.compare("ours", "C", Goal("≤", 15) if axles == 32 else None)
    return row


def _all_ticks(loop: BankLoop, z: FloatArray, e: FloatArray, w: FloatArray, count: int) -> None:
    loop.run(z[:count], e, w)


def _estimator(design: Design, models: list[Gains], axles: int) -> Row:
    """The whole step: offset, joints, gate, bank, noise, identity, window. filterpy's is the bank's part alone."""
    z = measurements(design, axles)
    estimator, peer = Estimator(design, axles), Peer(models, axles)
    present, ratio = np.ones((2, axles), dtype=bool), np.full(axles, TORQUE_RATIO)
    number = 0

    def ours(count: int) -> None:
        nonlocal number
        for _ in range(count):
            result = estimator.step(Tick(number, z[number % TICKS], present, ratio, SPEED_M_S))
            for axle in np.flatnonzero(result.needs_reset).tolist():
                estimator.reset(axle)
            number += 1

    def peers(count: int) -> None:
        for i in range(count):
            peer.step(z[i % TICKS])

    ours(2 * TICKS)  # the window is full
    cases = {"ours": Case(ours, 200), "filterpy": Case(peers, max(4, 64 // axles))}
    row = Row("Estimator.step, µs (filterpy: its filters alone)", f"{axles} axles", times=in_turn(cases, 2.0))
    row.compare("filterpy", "ours")
    return row
