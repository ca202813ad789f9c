"""The arithmetic of bank and rules as C, compiled when it is measured. The limit, not something to ship."""

import ctypes
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from wrcd.estimator.bank import SPEED_STEP
from wrcd.estimator.design import CHANNELS, COLUMNS, MODELS, STATES, Design, FloatArray, closed_loop
from wrcd.estimator.fuzzy import LOG_SPREADS, MIN_FIRING
from wrcd.estimator.tables import SpeedTable

SOURCE = r"""
#include <math.h>
#include <string.h>

enum { MODELS = 4, STATES = 5, CHANNELS = 2, ROWS = STATES + 2 * CHANNELS, COLS = STATES + CHANNELS };

/* out = M [x; z] for every model, M linear between nodes; all arrays are (…, axles) in C order */
void bank(const double *nodes, int first, double step, const double *speeds, int ticks, int n, const double *z,
          double *x, double *e, double *w)
{
    for (int t = 0; t < ticks; t++) {
        const double at = speeds[t] / step;
        const int node = (int)at;
        const double share = at - node;
        const double *below = nodes + (node - first) * MODELS * ROWS * COLS, *above = below + MODELS * ROWS * COLS;
        const double *zt = z + t * CHANNELS * n;
        for (int m = 0; m < MODELS; m++) {
            double out[ROWS][64];
            for (int r = 0; r < ROWS; r++) {
                for (int a = 0; a < n; a++)
                    out[r][a] = 0.0;
                for (int c = 0; c < COLS; c++) {
                    const int i = (m * ROWS + r) * COLS + c;
                    const double f = below[i] + share * (above[i] - below[i]);
                    const double *v = c < STATES ? x + (m * STATES + c) * n : zt + (c - STATES) * n;
                    for (int a = 0; a < n; a++)
                        out[r][a] += f * v[a];
                }
            }
            for (int r = 0; r < ROWS; r++) {
                double *to = r < STATES ? x + (m * STATES + r) * n
                    : r < STATES + CHANNELS ? e + ((t * MODELS + m) * CHANNELS + r - STATES) * n
                    : w + ((t * MODELS + m) * CHANNELS + r - STATES - CHANNELS) * n;
                memcpy(to, out[r], n * sizeof *to);
            }
        }
    }
}

static double held(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

/* rows of inputs -> output, firing, spread; centres (inputs, widest) hold sizes[i] each */
void fuzzy(const double *inputs, int n, int columns, int rules, int sets, int widest, const double *centres,
           const int *sizes, const int *chosen, const double *offset, const double *slopes, const double *spread_offset,
           const double *spread_slopes, const double *low, const double *high, double min_firing, double min_log,
           double max_log, double *output, double *firing, double *spread)
{
    for (int a = 0; a < n; a++) {
        const double *x = inputs + a * columns;
        double degree[16][16], in[64];
        for (int i = 0; i < sets; i++) {
            const double *c = centres + i * widest;
            const double v = held(x[i], c[0], c[sizes[i] - 1]);
            for (int j = 0; j < sizes[i]; j++) {
                const double rise = j > 0 ? (v - c[j - 1]) / (c[j] - c[j - 1]) : 1.0;
                const double fall = j < sizes[i] - 1 ? (c[j + 1] - v) / (c[j + 1] - c[j]) : 1.0;
                degree[i][j] = held(rise < fall ? rise : fall, 0.0, 1.0);
            }
        }
        for (int i = 0; i < columns; i++)
            in[i] = held(x[i], low[i], high[i]);
        double total = 0.0, sum = 0.0, logs = 0.0;
        for (int r = 0; r < rules; r++) {
            double weight = 1.0;
            for (int i = 0; i < sets; i++)
                weight *= degree[i][chosen[r * sets + i]];
            if (weight == 0.0)
                continue;
            double says = offset[r], wide = spread_offset[r];
            for (int i = 0; i < columns; i++) {
                says += slopes[r * columns + i] * in[i];
                wide += spread_slopes[r * columns + i] * in[i];
            }
            total += weight;
            sum += weight * says;
            logs += weight * wide;
        }
        firing[a] = total;
        output[a] = total >= min_firing ? held(sum / total, 0.0, 100.0) : NAN;
        spread[a] = total >= min_firing ? pow(10.0, held(logs / total, min_log, max_log)) : NAN;
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
    """(4, 9, 7): rows x' = A x + B z; e = z - H x; w = W e, as in wrcd/estimator/bank.py."""
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
        self.x = np.zeros((MODELS, STATES, axles))

    def run(self, z: FloatArray, e: FloatArray, w: FloatArray) -> None:
        """z (ticks, 2, n) to e and w (ticks, 4, 2, n), which are written into."""
        self._call(
            _pointer(self._nodes), self._first, ctypes.c_double(SPEED_STEP), _pointer(self._speeds), len(z), self._n,
            _pointer(z), _pointer(self.x), _pointer(e), _pointer(w),
        )  # fmt: skip


class RulesLoop:
    """The inference over rows of inputs in one call."""

    def __init__(self, c: ctypes.CDLL, design: Design) -> None:
        sets = design.sets
        self._call = c.fuzzy
        widest = max(len(s.centres) for s in sets)
        self._centres = np.zeros((len(sets), widest))
        for i, s in enumerate(sets):
            self._centres[i, : len(s.centres)] = s.centres
        self._sizes = np.array([len(s.centres) for s in sets], dtype=np.int32)
        self._rules = np.ascontiguousarray(design.rules, dtype=np.int32)
        middle = np.tile(design.middle, (len(design.rules), 1))
        for i, s in enumerate(sets):
            middle[:, i] = s.centres[design.rules[:, i]]
        self._offset = design.bases - (design.slopes * middle).sum(axis=1)
        self._spread_offset = np.log10(design.spreads) - (design.spread_slopes * middle).sum(axis=1)
        self._design = design

    def run(self, inputs: FloatArray, output: FloatArray, firing: FloatArray, spread: FloatArray) -> None:
        """inputs (n, COLUMNS) to output, firing and spread (n,), which are written into."""
        d = self._design
        self._call(
            _pointer(inputs), len(inputs), COLUMNS, len(d.rules), *self._centres.shape, _pointer(self._centres),
            _pointer(self._sizes), _pointer(self._rules), _pointer(self._offset), _pointer(d.slopes),
            _pointer(self._spread_offset), _pointer(d.spread_slopes), _pointer(d.low), _pointer(d.high),
            ctypes.c_double(MIN_FIRING), *map(ctypes.c_double, LOG_SPREADS), _pointer(output), _pointer(firing),
            _pointer(spread),
        )  # fmt: skip


def _pointer(a: "np.ndarray[tuple[int, ...], np.dtype[np.generic]]") -> ctypes.c_void_p:
    assert a.flags.c_contiguous
    return ctypes.c_void_p(a.ctypes.data)
