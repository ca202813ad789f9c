"""Lateral track irregularity of a given spectrum, as a function of distance."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sim_ecu.physics.compiled import compiled

OMEGA_C = 0.8246  # rad/m, upper corner of the spectrum
OMEGA_R = 0.0206  # rad/m, lower corner
# Roughness A_a (m rad) by name; anything between or beyond is given as a number.
QUALITY = {"good": 2.119e-7, "poor": 6.125e-7}
SPACING_M = 0.05  # nodes; the wheelset's fastest modes see 1 to 2 ms between them at 25 to 50 m/s
BLOCK = 2048  # nodes made at a time, so that the profile does not depend on how far it is read


@compiled
def _colour(
    noise: NDArray[np.float64], phi: NDArray[np.float64], root: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    out = np.empty((noise.shape[0], 2))
    y, dy = start[0], start[1]
    for i in range(noise.shape[0]):
        e0 = root[0, 0] * noise[i, 0]
        e1 = root[1, 0] * noise[i, 0] + root[1, 1] * noise[i, 1]
        y, dy = phi[0, 0] * y + phi[0, 1] * dy + e0, phi[1, 0] * y + phi[1, 1] * dy + e1
        out[i, 0] = y
        out[i, 1] = dy
    return out


class Track:
    """y_t and its slope at nodes every SPACING_M, made on demand and always the same at a place for a seed.

    White noise drives y'' + (Or + Oc) y' + Or Oc y = Oc w, whose one-sided spectrum is
    S(O) = A_a Oc^2 / ((O^2 + Or^2)(O^2 + Oc^2)) when w has intensity pi A_a. Both states are sampled exactly
    (matrix exponential), so a cubic through nodes and slopes has no spurious kinks. The start is stationary; what lies
    behind it, for the followers of a train that stands there, is made backwards: the same law with the slope's sign
    turned. Roughness scales the irregularity of a seed and leaves its shape. corner_rad_m is the spectrum's Oc.
    """

    def __init__(
        self,
        roughness_m_rad: float,
        seed: int | np.random.SeedSequence,
        behind_m: float = 0.0,
        corner_rad_m: float = OMEGA_C,
    ) -> None:
        self._seed = seed
        self._rng = np.random.default_rng(seed)
        a = np.array([[0.0, 1.0], [-OMEGA_R * corner_rad_m, -(OMEGA_R + corner_rad_m)]])
        q = math.pi * roughness_m_rad * corner_rad_m**2
        # van Loan: the covariance of the noise gathered over one spacing
        big = np.zeros((4, 4))
        big[:2, :2], big[:2, 2:], big[2:, 2:] = -a, np.diag([0.0, q]), a.T
        e = expm(big * SPACING_M)
        self._phi = e[2:, 2:].T.copy()
        self._root = np.linalg.cholesky(self._phi @ e[:2, 2:]) if q > 0 else np.zeros((2, 2))
        sigma = np.sqrt(q / (2 * (OMEGA_R + corner_rad_m)) * np.array([1 / (OMEGA_R * corner_rad_m), 1.0]))
        self.sigma_m = float(sigma[0])  # standard deviation of y_t
        origin = (sigma * self._rng.standard_normal(2))[None, :]
        behind = self._behind(origin[0], math.ceil(behind_m / SPACING_M), seed)
        self.start_m = -len(behind) * SPACING_M  # where the first node lies
        self.nodes = np.concatenate([behind, origin])  # (n, 2): y_t in m, dy_t/dx

    def _behind(
        self, origin: NDArray[np.float64], nodes: int, seed: int | np.random.SeedSequence
    ) -> NDArray[np.float64]:
        """The nodes before the origin; how many are requested does not change them."""
        turned = np.array([1.0, -1.0])
        whole = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
        rng = np.random.default_rng(np.random.SeedSequence(whole.entropy, spawn_key=(*whole.spawn_key, 1)))
        back: NDArray[np.float64] = (
            _colour(rng.standard_normal((nodes, 2)), self._phi, self._root, origin * turned)[::-1] * turned
        )
        return back

    rolls = False

    def ensure_behind(self, behind_m: float) -> None:
        """Stub until the merge."""
        have = round(-self.start_m / SPACING_M)
        need = math.ceil(behind_m / SPACING_M)
        if need > have:
            self.nodes = np.concatenate([self._behind(self.nodes[have], need, self._seed), self.nodes[have:]])
            self.start_m = -need * SPACING_M

    def reach(self, distance_m: float) -> NDArray[np.float64]:
        """Nodes (n, 2) that cover at least start_m … distance_m; node i lies at start_m + i * SPACING_M."""
        need = int((distance_m - self.start_m) / SPACING_M) + 2
        parts = [self.nodes]
        have = len(self.nodes)
        while have < need:
            parts.append(_colour(self._rng.standard_normal((BLOCK, 2)), self._phi, self._root, parts[-1][-1]))
            have += BLOCK
        if len(parts) > 1:
            self.nodes = np.concatenate(parts)
        return self.nodes


@compiled
def irregularity(nodes: NDArray[np.float64], distance_m: float) -> float:
    """y_t (m) at a distance from the first node: cubic Hermite interpolation between the nodes."""
    return between_nodes(nodes, 0, 0, nodes.shape[0], distance_m, 0)


@compiled
def between_nodes(
    nodes: NDArray[np.float64], base: int, first: int, end: int, distance_m: float, column: int
) -> float:
    """The same of a track whose node k, from first to before end, is nodes[base + k]."""
    at = distance_m / SPACING_M
    k = min(max(int(at), first), end - 2)
    t, i = at - k, base + k
    y0, d0 = nodes[i, column], nodes[i, column + 1] * SPACING_M
    y1, d1 = nodes[i + 1, column], nodes[i + 1, column + 1] * SPACING_M
    y: float = y0 + t * (d0 + t * (3 * (y1 - y0) - 2 * d0 - d1 + t * (2 * (y0 - y1) + d0 + d1)))
    return y
