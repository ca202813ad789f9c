"""Linear recursions over a block of ticks as one matrix product."""

from collections.abc import Sequence

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
