"""Irregularity of a track of a given spectrum, as a function of distance: alignment, cross-level and gauge."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sim_ecu.physics.compiled import compiled

FloatArray = NDArray[np.float64]
OMEGA_C = 0.8246  # rad/m, upper corner of the ERRI spectra
OMEGA_R = 0.0206  # rad/m, lower corner: a wavelength of 305 m
OMEGA_S = 0.438  # rad/m, third corner, of cross-level and gauge
# Roughness A_a (m rad) of alignment by name; anything between or beyond is given as a number.
QUALITY = {"good": 2.119e-7, "poor": 6.125e-7}
RAILS_M = 1.5  # from rail to rail: a height over the gauge is an angle times this
SPACING_M = 0.05  # nodes; the wheelset's fastest modes see 1 to 2 ms between them at 25 to 50 m/s
BLOCK = 2048  # nodes made at a time, so that the profile does not depend on how far it is read
ALIGNMENT, CROSS_LEVEL, GAUGE, NODE_COLUMNS = 0, 2, 4, 6  # columns of a node: each a value, and behind it its slope
SHORTEST_M, LONGEST_M = 3.0, 25.0  # the wavelengths by which EN 13848 and UIC 518 judge a track


@dataclass(frozen=True, slots=True)
class Density:
    """A one-sided density over Omega (rad/m), rational, with its level in the quantity's unit squared times rad/m.

    S = level Oc^2 / ((O^2 + Or^2)(O^2 + Oc^2)) with the corners (Or, Oc); with a third corner Os it is also multiplied
    by O^2 / (O^2 + Os^2).
    """

    level: float
    corners_rad_m: tuple[float, ...]

    def at(self, omega_rad_m: FloatArray) -> FloatArray:
        """The density at each Omega."""
        square = omega_rad_m**2
        out = self.level * self.corners_rad_m[1] ** 2 * square ** (len(self.corners_rad_m) - 2)
        for corner in self.corners_rad_m:
            out = out / (square + corner**2)
        return np.asarray(out)


Densities = tuple[Density, ...]


@dataclass(frozen=True, slots=True)
class Spectrum:
    """What a track is drawn from. A quantity is the sum of independent parts; without any it is 0.

    alignment: y_t, m. cross_level: roll of the track, rad, left rail higher positive. gauge: its widening, m.
    """

    name: str = field(compare=False)
    alignment: Densities
    cross_level: Densities = ()
    gauge: Densities = ()

    @classmethod
    def of_roughness(cls, A_a_m_rad: float, name: str = "") -> "Spectrum":
        """Return alignment alone, of the ERRI form with a roughness of one's own."""
        return cls(name or f"{A_a_m_rad:g}", (Density(A_a_m_rad, (OMEGA_R, OMEGA_C)),))

    def scaled(self, factor: float) -> "Spectrum":
        """Return the same with all densities so many times as high."""
        return self._with(lambda d: replace(d, level=d.level * factor))

    def with_corner(self, factor: float) -> "Spectrum":
        """Return the same with its upper corners moved by a factor: what is long stays."""
        return self._with(
            lambda d: replace(d, corners_rad_m=(d.corners_rad_m[0], d.corners_rad_m[1] * factor, *d.corners_rad_m[2:]))
        )

    @property
    def quantities(self) -> tuple[Densities, Densities, Densities]:
        """Alignment, cross-level and gauge."""
        return self.alignment, self.cross_level, self.gauge

    def _with(self, change: Callable[[Density], Density]) -> "Spectrum":
        return Spectrum(self.name, *(tuple(map(change, parts)) for parts in self.quantities))


def deviation(parts: Densities, shortest_m: float = SHORTEST_M, longest_m: float = LONGEST_M) -> float:
    """Return a quantity's standard deviation over a band of wavelengths."""
    omega = 2 * math.pi / np.geomspace(longest_m, shortest_m, 4001)
    return math.sqrt(sum(float(np.trapezoid(d.at(omega), omega)) for d in parts))


def _erri(name: str, A_a: float, A_v: float, A_g: float) -> Spectrum:
    """Cross-level is an angle: A_v over the square of half the distance between the rails. A_g in rad m."""
    three = (OMEGA_R, OMEGA_C, OMEGA_S)
    return replace(
        Spectrum.of_roughness(A_a, name),
        cross_level=(Density(A_v / (RAILS_M / 2) ** 2, three),),
        gauge=(Density(A_g, three),),
    )


def _fra(name: str, A_a_cm2: float, A_v_cm2: float, omega_s: float) -> Spectrum:
    """Alignment k A_a Oc^2 / (O^2 (O^2 + Oc^2)), its O^2 held at a wavelength of 305 m, the longest that it is said to
    hold for; cross-level and gauge 4 k A_v Oc^2 / ((O^2 + Oc^2)(O^2 + Os^2)), heights and widths; k = 1/4."""
    omega_c, k, m2 = 0.8245, 0.25, 1e-4
    width = Density(4 * k * A_v_cm2 * m2, (omega_s, omega_c))
    return Spectrum(
        name,
        (Density(k * A_a_cm2 * m2, (2 * math.pi / 305.0, omega_c)),),
        (replace(width, level=width.level / RAILS_M**2),),
        (width,),
    )


def _mm(*parts: tuple[float, float, float], over_m: float = 1.0) -> Densities:
    """Parts of two corners, with levels in mm^2 rad/m; over_m: of an angle, by the height over such a width."""
    return tuple(Density(level * 1e-6 / over_m**2, (low, high)) for level, low, high in parts)


# ERRI: report B 176 RP 1, with low and high disturbance. FRA: Garg and Dukkipati, Dynamics of Railway Vehicle Systems
# (1984), with the classes' constants as in Lei and Noda, J. Sound Vib. 258 (2002) 147. Chinese high-speed lines without
# ballast: TB/T 3352-2014, powers of the wave number by pieces, here two parts each that we fitted. From 3 to 60 m they
# are within 14 % of the density, and over 3 to 25 m within 1 % of the standard deviation; at 2 m gauge is twice it.
SPECTRA = {
    s.name: s
    for s in (
        *(Spectrum.of_roughness(A_a, name) for name, A_a in QUALITY.items()),
        _erri("erri-low", 2.119e-7, 4.032e-7, 5.32e-8),
        _erri("erri-high", 6.125e-7, 1.08e-6, 1.032e-7),
        _fra("fra-4", 0.3027, 0.5376, 1.1312),
        _fra("fra-5", 0.0762, 0.2095, 0.8209),
        _fra("fra-6", 0.0339, 0.0339, 0.4380),
        Spectrum(
            "china-hs",
            _mm((0.01638, 0.02223, 0.2282), (0.04536, 0.4984, 1.186)),
            _mm((0.008506, 0.02696, 0.1427), (0.04838, 0.4748, 2.830), over_m=RAILS_M),
            _mm((0.04648, 0.6278, 2.276), (0.002430, 0.06229, 0.3775)),
        ),
    )
}


@compiled
def _colour(
    noise: NDArray[np.float64], phi: NDArray[np.float64], root: NDArray[np.float64], state: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Advance the state (order,) in place by one node for each row of noise; (n, 2): its last two at each."""
    count, order = noise.shape
    out, then = np.empty((count, 2)), np.empty(order)
    for i in range(count):
        for j in range(order):
            driven, kept = 0.0, 0.0
            for k in range(j + 1):
                driven += root[j, k] * noise[i, k]
            for k in range(order):
                kept += phi[j, k] * state[k]
            then[j] = kept + driven
        state[:] = then
        out[i, 0], out[i, 1] = state[order - 2], state[order - 1]
    return out


class _Part:
    """A profile of one density and its slope, made in both directions from the origin.

    White noise of intensity pi level drives a chain of lags, one for each corner: with two corners
    y'' + (Or + Oc) y' + Or Oc y = Oc w, with three y is the slope of what such a chain of three gives. The state, that
    and its derivatives, is sampled exactly (matrix exponential), so a cubic through nodes and slopes has no spurious
    kinks. The start is stationary; what lies behind it is made backwards: the same law with the sign of every odd
    derivative turned.
    """

    def __init__(self, density: Density, ahead: np.random.Generator, behind: np.random.Generator) -> None:
        self._ahead, self._behind = ahead, behind
        falling: FloatArray = np.poly(-np.array(density.corners_rad_m)).astype(
            np.float64
        )  # of the highest derivative first
        n = len(falling) - 1
        a = np.diag(np.ones(n - 1), 1)
        a[-1] = -falling[:0:-1]
        q = math.pi * density.level * density.corners_rad_m[1] ** 2
        # van Loan: the covariance of the noise gathered over one spacing
        big = np.zeros((2 * n, 2 * n))
        big[:n, :n], big[n - 1, 2 * n - 1], big[n:, n:] = -a, q, a.T
        e = expm(big * SPACING_M)
        self._phi = e[n:, n:].T.copy()
        self._root = np.linalg.cholesky(self._phi @ e[:n, n:])
        last = np.linalg.cholesky(_stationary(falling, q)) @ ahead.standard_normal(n)
        self._turned = (-1.0) ** np.arange(n)
        self._first, self._last = last * self._turned, last
        self.origin = last[-2:].copy()

    def ahead(self, count: int) -> FloatArray:
        """So many nodes more, (count, 2)."""
        return _colour(self._ahead.standard_normal((count, len(self._last))), self._phi, self._root, self._last)

    def behind(self, count: int) -> FloatArray:
        """So many nodes more before the first, (count, 2) in the order of distance."""
        noise = self._behind.standard_normal((count, len(self._first)))
        return np.asarray(_colour(noise, self._phi, self._root, self._first)[::-1] * self._turned[-2:])


def _stationary(falling: FloatArray, q: float) -> FloatArray:
    """Covariance of a chain of two or three lags, its derivatives included, under white noise of density q."""
    if len(falling) == 3:
        _, a1, a0 = falling
        slope = q / (2 * a1)
        return np.diag(slope * np.array([1 / a0, 1.0]))
    _, a2, a1, a0 = falling
    slope = q / (2 * (a2 * a1 - a0))
    return np.asarray(slope * np.array([[a2 / a0, 0.0, -1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, a1]]))


class Track:
    """Nodes every SPACING_M, made on demand and always the same at a place for a seed.

    spectrum: a number is the roughness of alignment alone. Each part of a quantity has random numbers of its own, so
    cross-level and gauge leave the alignment of a seed as it is. The level of a part scales the irregularity of a seed
    and leaves its shape. behind_m: what lies behind the origin, for the followers of a train that stands there.
    """

    def __init__(self, spectrum: Spectrum | float, seed: int | np.random.SeedSequence, behind_m: float = 0.0) -> None:
        of = spectrum if isinstance(spectrum, Spectrum) else Spectrum.of_roughness(spectrum)
        self._parts = [
            (2 * quantity, _Part(density, *_generators(seed, quantity, k)))
            for quantity, parts in enumerate(of.quantities)
            for k, density in enumerate(parts)
            if density.level > 0
        ]
        self.rolls = any(column for column, _ in self._parts)  # whether it has cross-level or gauge
        self.start_m = 0.0  # where the first node lies
        # (n, NODE_COLUMNS): y_t in m, dy_t/dx, roll of the track in rad, its slope, widening in m, its slope
        self.nodes = self._gathered(1, lambda part: part.origin)
        self.ensure_behind(behind_m)

    def ensure_behind(self, behind_m: float) -> None:
        """Lengthen what lies behind the origin to at least so much; the other nodes stay as they are."""
        count = math.ceil(behind_m / SPACING_M) - round(-self.start_m / SPACING_M)
        if count > 0:
            self.nodes = np.concatenate([self._gathered(count, lambda part: part.behind(count)), self.nodes])
            self.start_m = -math.ceil(behind_m / SPACING_M) * SPACING_M

    def reach(self, distance_m: float) -> FloatArray:
        """Nodes (n, NODE_COLUMNS) that cover at least start_m … distance_m; node i lies at start_m + i * SPACING_M."""
        need = int((distance_m - self.start_m) / SPACING_M) + 2
        blocks = math.ceil((need - len(self.nodes)) / BLOCK)
        if blocks > 0:
            ahead = (self._gathered(BLOCK, lambda part: part.ahead(BLOCK)) for _ in range(blocks))
            self.nodes = np.concatenate([self.nodes, *ahead])
        return self.nodes

    def _gathered(self, count: int, of: Callable[[_Part], FloatArray]) -> FloatArray:
        """Return so many nodes: the sum of what each part has in its quantity's columns."""
        out = np.zeros((count, NODE_COLUMNS))
        for column, part in self._parts:
            out[:, column : column + 2] += of(part)
        return out


def _generators(
    seed: int | np.random.SeedSequence, quantity: int, part: int
) -> tuple[np.random.Generator, np.random.Generator]:
    """Random numbers of a part, ahead of the origin and behind it."""
    whole = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)

    def spawned(*key: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(whole.entropy, spawn_key=(*whole.spawn_key, *key)))

    if quantity == part == 0:
        return spawned(), spawned(1)
    return spawned(2, quantity, part, 0), spawned(2, quantity, part, 1)


@compiled
def irregularity(nodes: NDArray[np.float64], distance_m: float) -> float:
    """y_t (m) at a distance from the first node: cubic Hermite interpolation between the nodes."""
    return between_nodes(nodes, 0, 0, nodes.shape[0], distance_m, ALIGNMENT)


@compiled
def between_nodes(nodes: NDArray[np.float64], base: int, first: int, end: int, distance_m: float, column: int) -> float:
    """The same of any quantity, by its column, on a track whose node k, from first to before end, is
    nodes[base + k]."""
    at = distance_m / SPACING_M
    k = min(max(int(at), first), end - 2)
    t, i = at - k, base + k
    y0, d0 = nodes[i, column], nodes[i, column + 1] * SPACING_M
    y1, d1 = nodes[i + 1, column], nodes[i + 1, column + 1] * SPACING_M
    y: float = y0 + t * (d0 + t * (3 * (y1 - y0) - 2 * d0 - d1 + t * (2 * (y0 - y1) + d0 + d1)))
    return y
