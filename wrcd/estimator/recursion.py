"""Recursive filters of many channels: running means, and sections of second order, stepped by blocks of ticks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.estimator.design import FloatArray

MAX_TICKS = 4  # of a block: that of the window


def exponential(gain: float) -> tuple[FloatArray, ...]:
    """Matrices (m + 1, m + 1), by m, that take [p; s_1 … s_m] to [p; p_1 … p_m]: p_k is gain (s_k - p_(k-1)) more than
    the one before."""
    out = []
    for m in range(MAX_TICKS + 1):
        k = np.arange(m + 1)
        age = k[:, None] - k
        weights = np.where(age >= 0, (1.0 - gain) ** np.maximum(age, 0), 0.0)
        weights[:, 1:] *= gain
        out.append(weights)
    return tuple(out)


def smoothed(matrices: Sequence[FloatArray], before: FloatArray, values: FloatArray) -> FloatArray:
    """(m + 1, …): what a running mean was `before` (…) and is after each of m values (m, …)."""
    m = len(values)
    both = np.empty((m + 1, before.size))
    both[0] = before.reshape(-1)
    both[1:] = values.reshape(m, -1)
    out: FloatArray = (matrices[m] @ both).reshape(m + 1, *before.shape)
    return out


def unrolled(step: FloatArray, outputs: int) -> tuple[FloatArray, ...]:
    """Matrices, by m, of m steps at once of a filter with one input.

    step takes [u; x] to [y; x'], y of so many rows. They take [u_1 … u_m; x] to [y_1; … y_m; x'].
    """
    states = step.shape[1] - 1
    B, A, D, C = step[outputs:, :1], step[outputs:, 1:], step[:outputs, :1], step[:outputs, 1:]
    out = []
    for m in range(MAX_TICKS + 1):
        whole = np.zeros((m * outputs + states, m + states))
        x = np.zeros((states, m + states))
        x[:, m:] = np.eye(states)
        for k in range(m):
            rows = slice(k * outputs, (k + 1) * outputs)
            whole[rows] = C @ x
            whole[rows, k : k + 1] += D
            x = A @ x
            x[:, k : k + 1] += B
        whole[m * outputs :] = x
        out.append(whole)
    return tuple(out)


def state_space(sos: FloatArray) -> FloatArray:
    """[A B; C D] (2 k + 1, 2 k + 1) of k sections in cascade; rows of sos: b0 b1 b2 1 a1 a2 (transposed form II)."""
    k = len(sos)
    M = np.zeros((2 * k + 1, 2 * k + 1))
    row = np.zeros(2 * k + 1)  # the signal between the sections, as a function of [state; input]
    row[-1] = 1.0
    for i, (b0, b1, b2, _, a1, a2) in enumerate(sos):
        out = b0 * row
        out[2 * i] += 1.0
        M[2 * i] = b1 * row - a1 * out
        M[2 * i, 2 * i + 1] += 1.0
        M[2 * i + 1] = b2 * row - a2 * out
        row = out
    M[-1] = row
    return M


@dataclass(init=False, repr=False, eq=False)
class Sections:
    """A recursive filter over `channels` signals of every axle."""

    _x: FloatArray

    def __init__(self, sos: FloatArray, channels: int, axles: int) -> None:
        M = state_space(sos)
        # as [y; x'] = … [u; x]
        self._steps = unrolled(np.roll(M, (1, 1), axis=(0, 1)), 1)
        self._x = np.zeros((2 * len(sos), channels, axles))

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._x[:, :, axle] = 0.0

    def checkpoint(self) -> FloatArray:
        """The state, for rollback()."""
        return self._x

    def rollback(self, to: FloatArray) -> None:
        """Undo everything since a checkpoint."""
        self._x = to

    def step(self, u: FloatArray) -> FloatArray:
        """Filter one or more ticks: u (m, channels, n), m up to recursion.MAX_TICKS. Returns the same shape."""
        m = len(u)
        x = np.concatenate((u, self._x))
        out = (self._steps[m] @ x.reshape(len(x), -1)).reshape(x.shape)
        self._x = out[m:]
        y: FloatArray = out[:m]
        return y
