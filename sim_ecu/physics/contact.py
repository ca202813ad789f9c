"""Polach's contact law with Kalker's coefficient, and the creep curves of the study (Fig. 1 of the paper)."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sim_ecu.physics.compiled import compiled

# Kalker's coefficient c11 over the ratio of the semi-axes a/b, Poisson's ratio 0.25 (Kalker's table E3).
KALKER_A_OVER_B = np.array(
    [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    + [1 / 0.9, 1 / 0.8, 1 / 0.7, 1 / 0.6, 1 / 0.5, 1 / 0.4, 1 / 0.3, 1 / 0.2, 1 / 0.1]
)
KALKER_C11 = np.array(
    [3.31, 3.37, 3.44, 3.53, 3.62, 3.72, 3.81, 3.91, 4.01, 4.12, 4.22, 4.36, 4.54, 4.78, 5.10, 5.57, 6.34, 7.78, 11.7]
)
RATIO_TOLERANCE = 0.02  # how far a case's a/b may be rounded


def kalker_c11(a_m: float, b_m: float) -> float:
    """Longitudinal creep coefficient c11 (no unit) of a contact ellipse with semi-axes a (rolling direction) and b."""
    return float(np.interp(a_m / b_m, KALKER_A_OVER_B, KALKER_C11))


@dataclass(frozen=True, slots=True)
class CreepCurve:
    """Parameters of Polach's law for one state of the rail.

    mu_0 is the friction at zero slip speed, A the ratio of friction at infinite to that at zero slip speed,
    B (s/m) how fast it falls; k_A and k_S reduce Kalker's slope in the area of adhesion and of slip.
    """

    name: str
    surface: str
    mu_0: float
    A: float
    B: float
    k_A: float
    k_S: float

    def row(self) -> tuple[float, float, float, float, float]:
        """The five numbers in the order that the compiled functions take them."""
        return (self.mu_0, self.A, self.B, self.k_A, self.k_S)


# A and C are Polach's dry and wet parameters (Wear 258:992-1000, 2005); the others are this project's own.
CURVES = {
    c.name: c
    for c in (
        CreepCurve("A", "dry", 0.55, 0.40, 0.60, 1.00, 0.40),
        CreepCurve("B", "damp", 0.42, 0.40, 0.40, 0.70, 0.28),
        CreepCurve("C", "wet", 0.30, 0.40, 0.20, 0.30, 0.10),
        CreepCurve("E", "greasy", 0.15, 0.40, 0.20, 0.25, 0.08),
        CreepCurve("D", "low", 0.06, 0.40, 0.20, 0.20, 0.07),
        CreepCurve("F", "very low", 0.03, 0.40, 0.10, 0.15, 0.05),
    )
}


def curve_between(mu_0: float) -> CreepCurve:
    """A curve of the family with friction mu_0: every parameter linear in ln mu_0 between the six, flat beyond."""
    table = sorted(CURVES.values(), key=lambda c: c.mu_0)
    x = [math.log(c.mu_0) for c in table]
    at = math.log(mu_0)
    rest = {k: float(np.interp(at, x, [getattr(c, k) for c in table])) for k in ("A", "B", "k_A", "k_S")}
    return replace(table[0], name=f"{mu_0:.4g}", surface="between", mu_0=mu_0, **rest)


class Contact(NamedTuple):
    """What of the contact does not depend on the rail's state."""

    normal_N: float  # load N of one wheel
    stiffness_N: float  # G pi a b c11 / 4: epsilon = stiffness * creep / (N mu_f)


def contact(normal_N: float, a_m: float, b_m: float, shear_Pa: float, c11: float) -> Contact:
    """Contact constants of one wheel from its load, ellipse and material."""
    return Contact(normal_N, shear_Pa * math.pi * a_m * b_m * c11 / 4)


@compiled
def traction_ratio(
    creep: float, speed_m_s: float, c: Contact, mu_0: float, A: float, B: float, k_A: float, k_S: float
) -> float:
    """F/N at a total creep (>= 0) and speed: Polach's law (no unit)."""
    w = creep * speed_m_s  # slip speed
    mu_f = mu_0 * ((1.0 - A) * math.exp(-B * w) + A)
    eps = c.stiffness_N * creep / (c.normal_N * mu_f)
    kae = k_A * eps
    return 2.0 * mu_f / math.pi * (kae / (1.0 + kae * kae) + math.atan(k_S * eps))


@compiled
def peak(speed_m_s: float, c: Contact, mu_0: float, A: float, B: float, k_A: float, k_S: float) -> tuple[float, float]:
    """(creep, F/N) at the peak of the creep curve at this speed: what "available adhesion" means here.

    Golden-section search over ln(creep) from 1e-4 to 0.6 after a coarse scan; the curves have one peak.
    """
    lo, hi, n = math.log(1e-4), math.log(0.6), 24
    best, best_mu = 0, -1.0
    for i in range(n + 1):
        mu = traction_ratio(math.exp(lo + (hi - lo) * i / n), speed_m_s, c, mu_0, A, B, k_A, k_S)
        if mu > best_mu:
            best, best_mu = i, mu
    left = lo + (hi - lo) * max(best - 1, 0) / n
    right = lo + (hi - lo) * min(best + 1, n) / n
    g = 0.6180339887498949
    for _ in range(40):
        x1, x2 = right - g * (right - left), left + g * (right - left)
        f1 = traction_ratio(math.exp(x1), speed_m_s, c, mu_0, A, B, k_A, k_S)
        f2 = traction_ratio(math.exp(x2), speed_m_s, c, mu_0, A, B, k_A, k_S)
        if f1 > f2:
            right = x2
        else:
            left = x1
    creep = math.exp(0.5 * (left + right))
    return creep, traction_ratio(creep, speed_m_s, c, mu_0, A, B, k_A, k_S)


def creep_force(
    a_over_b: float, semi_axis_a_mm: float, semi_axis_b_mm: float, normal_load_N: float, shear_modulus_MPa: float,
    poisson: float, friction: float, creep_x: float, creep_y: float, *, k_A: float = 1.0, k_S: float = 1.0,
) -> tuple[float, float]:  # fmt: skip
    """(Fx, Fy) over mu N (no unit) of a single contact without spin, to be laid beside another program's.

    Polach's law (Wear 258, 2005) with Kalker's c11 (table E3), which is for a Poisson's ratio of 0.25: poisson has no
    part in it. a is the semi-axis in the rolling direction; creep_x and creep_y are creepages (no unit), friction is
    constant, k_A and k_S are as of CreepCurve. The force has the signs of the creepages; CONTACT's has the opposite
    ones. Raises ValueError, which names the argument, for a size that is not above 0, what is not finite, and a ratio
    that is not the axes' or is beyond Kalker's table.
    """
    sizes = {
        "semi_axis_a_mm": semi_axis_a_mm, "semi_axis_b_mm": semi_axis_b_mm, "normal_load_N": normal_load_N,
        "shear_modulus_MPa": shear_modulus_MPa, "friction": friction, "k_A": k_A, "k_S": k_S,
    }  # fmt: skip
    for name, size in sizes.items():
        if not 0.0 < size < math.inf:
            raise ValueError(f"{name} is {size:g}, not above 0 and finite")
    for name, creep in (("creep_x", creep_x), ("creep_y", creep_y)):
        if not math.isfinite(creep):
            raise ValueError(f"{name} is {creep:g}, not finite")
    if not KALKER_A_OVER_B[0] <= a_over_b <= KALKER_A_OVER_B[-1]:
        raise ValueError(f"a_over_b is {a_over_b:g}, beyond Kalker's table")
    if abs(a_over_b / (semi_axis_a_mm / semi_axis_b_mm) - 1.0) > RATIO_TOLERANCE:
        raise ValueError(f"a_over_b is {a_over_b:g}, but the semi-axes make it {semi_axis_a_mm / semi_axis_b_mm:.4g}")
    a, b = semi_axis_a_mm * 1e-3, semi_axis_b_mm * 1e-3
    c = contact(normal_load_N, a, b, shear_modulus_MPa * 1e6, kalker_c11(a, b))
    creep = math.hypot(creep_x, creep_y)
    if creep == 0.0:
        return 0.0, 0.0
    # A = 1 and B = 0: friction does not fall, so that the speed (1 m/s) does not matter
    size = traction_ratio(creep, 1.0, c, friction, 1.0, 0.0, k_A, k_S) / friction
    return size * creep_x / creep, size * creep_y / creep
