"""The bank: four Kalman filters with steady-state gains for every axle, as one matrix product per tick."""

import numpy as np
from numpy.typing import NDArray

from wrcd.estimator.design import CHANNELS, MODELS, STATES, Design, FloatArray, closed_loop

BoolArray = NDArray[np.bool_]
SPEED_STEP = 0.1  # m/s: matrices are made at multiples of this, and are linear between them


def scheduled_speed(speed_m_s: float, speeds: FloatArray) -> float:
    """The speed whose gains apply: held within the design's grid."""
    return float(min(max(speed_m_s, speeds[0]), speeds[-1]))


def at_speed(table: FloatArray, speeds: FloatArray, speed_m_s: float) -> FloatArray:
    """A table (v, …) at a speed, linear between the grid's speeds."""
    i = int(np.clip(np.searchsorted(speeds, speed_m_s) - 1, 0, len(speeds) - 2))
    t = (speed_m_s - speeds[i]) / (speeds[i + 1] - speeds[i])
    out: FloatArray = (1.0 - t) * table[i] + t * table[i + 1]
    return out


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

    STATE = ("x",)
    TRANSIENT = ("_fused",)

    def __init__(self, design: Design, axles: int) -> None:
        self._d = design
        self._tables = closed_loop(design.Phi, design.K, design.H), design.Phi @ design.K, design.H, design.whiten
        self._fused: dict[int, FloatArray] = {}
        self.x: FloatArray = np.zeros((MODELS, STATES, axles))

    def reset(self, axle: int) -> None:
        """Forget what an axle's filters know."""
        self.x[:, :, axle] = 0.0

    def step(self, z: FloatArray, present: BoolArray, speed_m_s: float) -> tuple[FloatArray, FloatArray]:
        """One tick: z and present (2, n). Returns innovations e and whitened innovations w, both (4, 2, n).

        A channel that is not present counts as what the model predicts: its innovation is exactly zero.
        """
        M = self._matrices(scheduled_speed(speed_m_s, self._d.speeds_m_s))
        zs = np.broadcast_to(z, (MODELS, *z.shape))
        if not present.all():
            zs = np.where(present, zs, -M[:, STATES : STATES + CHANNELS, :STATES] @ self.x)
        out = M @ np.concatenate((self.x, zs), axis=1)
        self.x = out[:, :STATES]
        e, w = out[:, STATES : STATES + CHANNELS], out[:, STATES + CHANNELS :]
        if not present.all():
            e = np.where(present, e, 0.0)
        return e, w

    def _matrices(self, speed: float) -> FloatArray:
        """(4, 9, 7) at a speed within the grid."""
        at = speed / SPEED_STEP
        node = int(at)
        below, above = self._node(node), self._node(node + 1)
        out: FloatArray = below + (at - node) * (above - below)
        return out

    def _node(self, number: int) -> FloatArray:
        found = self._fused.get(number)
        if found is None:
            speeds = self._d.speeds_m_s
            speed = scheduled_speed(number * SPEED_STEP, speeds)
            A, B, H, W = (at_speed(t, speeds, speed) for t in self._tables)
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
