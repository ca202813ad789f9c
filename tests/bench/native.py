"""The arithmetic of the bank as C, compiled when it is measured. The limit, not something to ship."""

import ctypes
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from wrcd.estimator.design import CHANNELS, MODELS, Design, FloatArray, closed_loop
from wrcd.estimator.paper.bank import SPEED_STEP, SpeedTable

SOURCE = r"""
#include <string.h>

enum { MODELS = 4, CHANNELS = 2, MOST = 32 };

/* out = M [x; z] for every model, M linear between nodes; all arrays are (…, axles) in C order */
void bank(const double *nodes, int states, int first, double step, const double *speeds, int ticks, int n,
          const double *z, double *x, double *e, double *w)
{
    const int rows = states + 2 * CHANNELS, columns = states + CHANNELS;
    for (int t = 0; t < ticks; t++) {
        const double at = speeds[t] / step;
        const int node = (int)at;
        const double share = at - node;
        const double *below = nodes + (node - first) * MODELS * rows * columns;
        const double *above = below + MODELS * rows * columns;
        const double *zt = z + t * CHANNELS * n;
        for (int m = 0; m < MODELS; m++) {
            double out[MOST][64];
            for (int r = 0; r < rows; r++) {
                for (int a = 0; a < n; a++)
                    out[r][a] = 0.0;
                for (int c = 0; c < columns; c++) {
                    const int i = (m * rows + r) * columns + c;
                    const double f = below[i] + share * (above[i] - below[i]);
                    const double *v = c < states ? x + (m * states + c) * n : zt + (c - states) * n;
                    for (int a = 0; a < n; a++)
                        out[r][a] += f * v[a];
                }
            }
            for (int r = 0; r < rows; r++) {
                double *to = r < states ? x + (m * states + r) * n
                    : r < states + CHANNELS ? e + ((t * MODELS + m) * CHANNELS + r - states) * n
                    : w + ((t * MODELS + m) * CHANNELS + r - states - CHANNELS) * n;
                memcpy(to, out[r], n * sizeof *to);
            }
        }
    }
}
"""
MAX_AXLES = 64  # of the C loop's buffers


@cache
def library() -> ctypes.CDLL | None:
    """The compiled source, or None where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder) / "limit.c", Path(folder) / "limit.so"
        source.write_text(SOURCE)
        subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", out, source, "-lm"], check=True)
        return ctypes.CDLL(str(out))  # stays mapped when the file is gone


def fused(design: Design, speed_m_s: float) -> FloatArray:
    """(4, s + 4, s + 2): rows x' = A x + B z; e = z - H x; w = W e, as in wrcd/estimator/paper/bank.py."""
    tables = closed_loop(design.Phi, design.K, design.H), design.Phi @ design.K, design.H, design.whiten
    A, B, H, W = (SpeedTable(t, design.speeds_m_s).at(speed_m_s) for t in tables)
    eye = np.broadcast_to(np.eye(CHANNELS), (MODELS, CHANNELS, CHANNELS))
    blocks = [np.concatenate(pair, axis=2) for pair in ((A, B), (-H, eye), (-W @ H, W))]
    return np.concatenate(blocks, axis=1)


class BankLoop:
    """The bank's step of many ticks in one call."""

    def __init__(self, c: ctypes.CDLL, design: Design, axles: int, speeds_m_s: FloatArray) -> None:
        assert axles <= MAX_AXLES
        self._call, self._n, self._speeds = c.bank, axles, np.ascontiguousarray(speeds_m_s)
        self._first = int(speeds_m_s.min() / SPEED_STEP)
        last = int(speeds_m_s.max() / SPEED_STEP) + 1
        self._nodes = np.array([fused(design, i * SPEED_STEP) for i in range(self._first, last + 1)])
        self.x = np.zeros((MODELS, design.states, axles))

    def run(self, z: FloatArray, e: FloatArray, w: FloatArray) -> None:
        """z (ticks, 2, n) to e and w (ticks, 4, 2, n), which are written into."""
        self._call(
            _pointer(self._nodes), self.x.shape[1], self._first, ctypes.c_double(SPEED_STEP), _pointer(self._speeds),
            len(z), self._n, _pointer(z), _pointer(self.x), _pointer(e), _pointer(w),
        )  # fmt: skip


def _pointer(a: "np.ndarray[tuple[int, ...], np.dtype[np.generic]]") -> ctypes.c_void_p:
    assert a.flags.c_contiguous
    return ctypes.c_void_p(a.ctypes.data)
