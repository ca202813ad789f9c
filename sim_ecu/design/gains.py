"""Discretisation and steady-state gains of the bank over a grid of speeds."""

from dataclasses import dataclass

import numpy as np
from filterpy.common import van_loan_discretization
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are
from scipy.signal import freqz_sos

from sim_ecu.design.linear import Point, model, slope_and_secant
from sim_ecu.physics.wheelset import Wheelset

FloatArray = NDArray[np.float64]
FREQUENCIES = 4096


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
    g11, g22 = slope_and_secant(w, point.curve, point.creep_of_peak, speed_m_s)
    A, G, H = model(w, g11, g22, speed_m_s)
    Phi, Q = van_loan_discretization(A, G * np.array(point.noise), tick_s)
    Q = 0.5 * (Q + Q.T)
    R = np.diag(np.square(sensor_noise))
    P = solve_discrete_are(Phi.T, H.T, Q, R)
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T  # K = P H' S^-1
    return Gains(g11, g22, np.asarray(Phi), H, Q, R, P, K, S)
