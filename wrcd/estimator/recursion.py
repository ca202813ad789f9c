"""Recursive filters of many channels: sections of second order."""

import numpy as np

from wrcd.estimator.design import FloatArray


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


class Sections:
    """A recursive filter over `channels` signals of every axle."""

    _x: FloatArray

    def __init__(self, sos: FloatArray, channels: int, axles: int) -> None:
        self._M = state_space(sos)
        self._x = np.zeros((2 * len(sos), channels, axles))

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._x[:, :, axle] = 0.0

    def step(self, u: FloatArray) -> FloatArray:
        """Filter one tick: u (channels, n). Returns the same shape."""
        x = np.concatenate((self._x, u[None]))
        out = (self._M @ x.reshape(len(x), -1)).reshape(x.shape)
        self._x = out[:-1]
        y: FloatArray = out[-1]
        return y
