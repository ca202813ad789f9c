"""The bank: four Kalman filters with steady-state gains for every axle, as one matrix product per tick."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wrcd.estimator.design import CHANNELS, MODELS, STATES, Design, FloatArray, closed_loop
from wrcd.estimator.tables import SpeedTable

BoolArray = NDArray[np.bool_]
SPEED_STEP = 0.1  # m/s: matrices are made at multiples of this, and are linear between them


class Bank:
    """Innovations of 4 models x n axles.

    Per model, with x the state predicted for this tick and z = [yaw rate, lateral acceleration]:

        e  = z - H x            innovation
        x' = Phi (x + K e)      state predicted for the next tick
        w  = V L^-1 e           innovation in units of its own expected size, S = L L', V the channels' weights

    All three are one product of a (9 x 7) matrix with [x; z]. The matrices are built at nodes SPEED_STEP apart, from
    the design's tables, and interpolated at every tick: a speed that moves about never makes the gains toggle.

    Between the design's speeds A = Phi (I - K H) and B = Phi K are linear: with Phi, K and H linear each by itself, a
    filter that is stable at both ends was not so between them, and its residual grew within a minute.
    """

    STATE = {"states": "x"}
    TRANSIENT = ("_fused", "_between", "_in")

    def __init__(self, design: Design, axles: int) -> None:
        self._range = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        tables = closed_loop(design.Phi, design.K, design.H), design.Phi @ design.K, design.H, design.whiten
        self._tables = [SpeedTable(table, design.speeds_m_s) for table in tables]
        self._fused: dict[int, FloatArray] = {}
        self._between: dict[int, tuple[FloatArray, FloatArray]] = {}
        self.x: FloatArray = np.zeros((MODELS, STATES, axles))
        self._in: FloatArray = np.zeros((MODELS, STATES + CHANNELS, axles))

    def reset(self, axle: int) -> None:
        """Forget what an axle's filters know."""
        self.x[:, :, axle] = 0.0

    def step(self, z: FloatArray, present: BoolArray, speed_m_s: float) -> tuple[FloatArray, FloatArray]:
        """One tick: z and present (2, n). Returns innovations e and whitened innovations w, both (4, 2, n).

        A channel that is not present counts as what the model predicts: its innovation is exactly zero.
        """
        M = self._matrices(speed_m_s)
        zs = np.broadcast_to(z, (MODELS, *z.shape))
        if not present.all():
            zs = np.where(present, zs, -M[:, STATES : STATES + CHANNELS, :STATES] @ self.x)
        out = M @ np.concatenate((self.x, zs), axis=1)
        self.x = out[:, :STATES]
        e, w = out[:, STATES : STATES + CHANNELS], out[:, STATES + CHANNELS :]
        if not present.all():
            e = np.where(present, e, 0.0)
        return e, w

    def step_all(self, z: FloatArray, speeds_m_s: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """m ticks z (m, 2, n) with all measurements. Returns e and w, both (m, 4, 2, n)."""
        m, n = len(z), z.shape[2]
        out = np.empty((m, MODELS, STATES + 2 * CHANNELS, n))
        both = self._in
        both[:, :STATES] = self.x
        for k in range(m):
            both[:, STATES:] = z[k]
            np.matmul(self._matrices(speeds_m_s[k]), both, out=out[k])
            both[:, :STATES] = out[k, :, :STATES]
        self.x = both[:, :STATES].copy()
        return out[:, :, STATES : STATES + CHANNELS], out[:, :, STATES + CHANNELS :]

    def _matrices(self, speed: float) -> FloatArray:
        """(4, 9, 7) at a speed, held within the grid."""
        low, high = self._range
        at = min(max(speed, low), high) / SPEED_STEP
        node = int(at)
        found = self._between.get(node)
        if found is None:
            below = self._node(node)
            found = self._between[node] = below, self._node(node + 1) - below
        below, rise = found
        out: FloatArray = below + (at - node) * rise
        return out

    def _node(self, number: int) -> FloatArray:
        found = self._fused.get(number)
        if found is None:
            A, B, H, W = (table.at(number * SPEED_STEP) for table in self._tables)
            # rows: x' = A x + B z; e = z - H x; w = W e
            M = np.zeros((MODELS, STATES + 2 * CHANNELS, STATES + CHANNELS))
            M[:, :STATES, :STATES] = A
            M[:, :STATES, STATES:] = B
            M[:, STATES : STATES + CHANNELS, :STATES] = -H
            M[:, STATES : STATES + CHANNELS, STATES:] = np.eye(CHANNELS)
            M[:, STATES + CHANNELS :, :STATES] = -W @ H
            M[:, STATES + CHANNELS :, STATES:] = W
            found = self._fused[number] = M
        return found
