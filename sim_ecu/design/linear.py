"""The small-signal wheelset, equations (13)-(15), with the errata mended, and its steady-state filters.

The errata are in docs/explanation/vehicle.md."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from sim_ecu.physics.contact import CreepCurve, peak, traction_ratio
from sim_ecu.physics.wheelset import GRAVITY, Bogie, Wheelset

FloatArray = NDArray[np.float64]
TRACK_DECAY = -0.5  # 1/s, n of (14): y_t drifts back, which keeps it observable


@dataclass(frozen=True, slots=True)
class Point:
    """Where a curve is linearised, and what the model is tuned with.

    creep_of_peak: the creep as a share of the one at the peak (1 = saturation point). noise: y_t' (m/s), yaw
    acceleration (rad/s2), lateral acceleration (m/s2), each per root Hz. yaw_rate_weight (0 … 2): how much the yaw rate
    counts in the residual, against the lateral acceleration's 2 - yaw_rate_weight.
    """

    name: str
    curve: CreepCurve
    creep_of_peak: float
    noise: tuple[float, float, float]
    yaw_rate_weight: float = 1.0


def slope_and_secant(w: Wheelset, curve: CreepCurve, creep_of_peak: float, speed_m_s: float) -> tuple[float, float]:
    """g11 = dF/dcreep and g22 = F/creep of one wheel (N) at a point of a curve."""
    c = w.contact
    creep = peak(speed_m_s, c, *curve.row())[0] * creep_of_peak
    d = 1e-4 * creep
    up, down = (traction_ratio(creep + s * d, speed_m_s, c, *curve.row()) for s in (1, -1))
    g11 = w.normal_N * (up - down) / (2 * d)
    return g11, w.normal_N * traction_ratio(creep, speed_m_s, c, *curve.row()) / creep


def model(w: Wheelset, g11: float, g22: float, v: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A (s, s), G (s, 3), C (2, s) of x = [psi, y', psi', y_t, y - y_t], inputs [y_t', yaw accel, lateral accel].

    Against the printed (13)-(15): conicity in the yaw row, the yaw stiffness negative, -n in the last row, and the
    gravitational stiffness F_g in the lateral row and the output, with what roll adds to the accelerometer.
    In a bogie two states follow, of the frame's end over the wheelset: y_f, y_f'. The frame does not turn. Measured on
    training conditions, with the frame as ground and these the error is 2 % larger, with its yaw as states 4 %.
    """
    n = TRACK_DECAY
    held = np.zeros((2, 5)) if w.bogie is None else _primary(w, w.bogie)
    s = held.shape[1]
    lateral, yaw = np.zeros(s), np.zeros(s)
    lateral[:5] = 2 * g22 / w.m_w, -2 * g22 / (v * w.m_w), 0.0, 0.0, -2 * w.normal_N * w.gamma / (w.L_g * w.m_w)
    yaw[:5] = (
        -w.k_w / w.I_w if w.bogie is None else 0.0, 0.0, -2 * w.L_g**2 * g11 / (v * w.I_w), 0.0,
        -2 * w.L_g * w.gamma * g11 / (w.r_0 * w.I_w),
    )  # fmt: skip
    lateral, yaw = lateral + held[0] / w.m_w, yaw + held[1] / w.I_w
    A, G = np.zeros((s, s)), np.zeros((s, 3))
    A[0, 2], A[1], A[2], A[3, 3], A[4, 1], A[4, 3] = 1.0, lateral, yaw, n, 1.0, -n
    G[1, 2], G[2, 1], G[3, 0], G[4, 0] = 1.0, 1.0, 1.0, -1.0
    if w.bogie is not None:
        A[5:] = _frame(w.bogie, held[0])
    C = np.array([np.zeros(s), lateral])
    C[0, 2] = 1.0
    C[1, 4] += GRAVITY * w.gamma / w.L_g
    return A, G, C


def _primary(w: Wheelset, b: Bogie) -> FloatArray:
    """(2, 7): force and moment of the primary suspension on a wheelset, over the states; y = y_t + (y - y_t)."""
    k, c = b.primary_lateral_N_m, b.primary_lateral_damping_N_s_m
    return np.array([
        [0.0, -c, 0.0, -k, -k, k, c],
        [-b.primary_yaw_N_m_rad, 0.0, -b.primary_yaw_damping_N_m_s_rad, 0.0, 0.0, 0.0, 0.0],
    ])  # fmt: skip


def _frame(b: Bogie, force: FloatArray) -> FloatArray:
    """(2, 7): the frame's end over a wheelset, from the primary suspension's force (7,) on the wheelset.

    An end of a frame whose yaw inertia is near its mass times the semi-wheelbase squared moves without the other one:
    it is half of the frame, held by half of the secondary suspension, and the body stands still.
    """
    mass = 0.5 * b.frame_mass_kg
    moved = np.zeros(7)
    moved[5], moved[6] = 0.5 * b.secondary_lateral_N_m, 0.5 * b.secondary_lateral_damping_N_s_m
    return np.array([[0.0, 0, 0, 0, 0, 0, 1], -(force + moved) / mass])


FREQUENCIES = 4096


# scipy's solver orders eigenvalues, and gives up where two of them are alike: in a bogie at 4 of 672
# speeds and models. Sensors noisier by a billionth have the same gains, and another order. It gives up at any noise
# where the pencil is very ill-conditioned, as of a soft bogie with strong yaw dampers.
NUDGE, NUDGES = 1e-9, 10
DOUBLINGS = 40  # of ticks: the slowest mode forgets within 2^13


def _riccati(Phi: FloatArray, H: FloatArray, Q: FloatArray, R: FloatArray) -> FloatArray:
    """(s, s): steady covariance before the update. Raises LinAlgError where none is found."""
    for k in range(NUDGES):
        try:
            return np.asarray(solve_discrete_are(Phi.T, H.T, Q, R * (1.0 + k * NUDGE)))
        except ValueError:
            continue
    P = _doubled(Phi, H, Q, R)
    # The states differ by orders of magnitude, and y_t and y - y_t are nearly opposite: in coordinates in which the
    # covariance is the unit matrix twice, the same steps are exact to 1e-8, as scipy's solver is.
    sigma = np.sqrt(np.diag(P))
    size, axes = np.linalg.eigh(P / np.outer(sigma, sigma))
    T = sigma[:, None] * axes * np.sqrt(np.maximum(size, np.finfo(float).eps * size[-1]))
    inverse = np.linalg.inv(T)
    return np.asarray(T @ _doubled(inverse @ Phi @ T, H @ T, inverse @ Q @ inverse.T, R) @ T.T)


def _doubled(Phi: FloatArray, H: FloatArray, Q: FloatArray, R: FloatArray) -> FloatArray:
    """The same by structure-preserving doubling (Chu, Fan, Lin, Wang 2004): a step goes over twice as many ticks."""
    A, G, P = Phi.T, H.T @ np.linalg.solve(R, H), Q
    for _ in range(DOUBLINGS):
        over = np.linalg.solve(np.eye(len(A)) + G @ P, np.hstack((A, G)))
        through, seen = np.hsplit(over, 2)
        more = A.T @ P @ through
        P = P + 0.5 * (more + more.T)
        if np.abs(more).max() <= np.finfo(float).eps * np.abs(P).max():
            return np.asarray(P)
        G = G + A @ seen @ A.T
        G, A = 0.5 * (G + G.T), A @ through
    raise np.linalg.LinAlgError("the filter has no steady gain")


@dataclass(frozen=True, slots=True)
class Gains:
    """One model at one speed: discrete matrices, noise covariances, steady-state gain and innovation covariance."""

    g11: float
    g22: float
    Phi: FloatArray
    H: FloatArray
    Q: FloatArray
    R: FloatArray
    P: FloatArray  # before the update
    K: FloatArray
    S: FloatArray

    def whiten(self, point: Point) -> FloatArray:
        """(2, 2): innovations in units of their own expected size, each channel with its weight in the residual."""
        share = np.sqrt([point.yaw_rate_weight, 2.0 - point.yaw_rate_weight])
        return np.asarray(share[:, None] * np.linalg.inv(np.linalg.cholesky(self.S)))

    def noise_power(self, W: FloatArray, lowpass: FloatArray, sensor_noise: tuple[float, float]) -> FloatArray:
        """(2,): power that each sensor's noise alone leaves in the whitened innovations after a low-pass (sections).

        W (2, 2) whitens them.
        The integral over all frequencies of the filter's transfer function from a measurement to its innovations.
        """
        from scipy.signal import freqz_sos  # takes half a second, as filterpy does: only who makes a design pays

        w = np.pi * (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES
        _, band = freqz_sos(lowpass, worN=w)
        forgets = self.Phi @ (np.eye(len(self.Phi)) - self.K @ self.H)
        inverse = np.linalg.inv(np.exp(1j * w)[:, None, None] * np.eye(len(self.Phi)) - forgets)
        through = W @ (np.eye(len(self.R)) - self.H @ inverse @ self.Phi @ self.K)
        power = np.abs(through * band[:, None, None]) ** 2
        return np.asarray(power.mean(axis=0).sum(axis=0) * np.square(sensor_noise))


def steady_state(
    w: Wheelset, point: Point, speed_m_s: float, tick_s: float, sensor_noise: tuple[float, float]
) -> Gains:
    """Kalman gain of a model at a speed. sensor_noise: rms per sample, gyro (rad/s) and accelerometer (m/s2)."""
    from filterpy.common import van_loan_discretization

    g11, g22 = slope_and_secant(w, point.curve, point.creep_of_peak, speed_m_s)
    A, G, H = model(w, g11, g22, speed_m_s)
    Phi, Q = van_loan_discretization(A, G * np.array(point.noise), tick_s)
    Q = 0.5 * (Q + Q.T)
    R = np.diag(np.square(sensor_noise))
    P = _riccati(np.asarray(Phi), H, Q, R)
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T  # K = P H' S^-1
    return Gains(g11, g22, np.asarray(Phi), H, Q, R, P, K, S)
