"""A vehicle's constants by Whittle's likelihood of its signals' cross-spectra, found by Fisher scoring.

In each bin of each block the cross-spectra of the four signals are taken for
    S = H_y H_y* P_y + H_c H_c* P_c + noise + eps^2 (power of each channel)
with H of wrcd/fit/bogie.py. P_y of alignment and P_c of cross-level are free in every bin: no spectrum of the track
need be known. Free in every block are the creep force's secant and slope, of the log the vehicle's constants, what is
wrong with sensors, their noise, and eps, what neither track nor noise explains. Powers and slopes are eliminated from
the Fisher matrix by Schur complements.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrcd.fit.bogie import PRIOR_SIGMA, BogieConstants, response
from wrcd.fit.stretches import CHANNELS, Blocks, BoolArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
# One standard deviation of what is known before. Of the sensors of the leading (1) and the trailing wheelset (2): by
# how many s the accelerometer is read before the gyro, the log of its gain and the gyro's, by how many rad the gyro is
# askew.
# By how many s the trailing wheelset's clock is late against the leading one's; the log of the speed's scale.
SENSOR_SIGMA: Mapping[str, float] = {
    "lead_1": 0.003, "lead_2": 0.003, "gain_1": 0.02, "gain_2": 0.02, "gyro_gain_1": 0.02,
    "gyro_gain_2": 0.02, "askew_1": 0.035, "askew_2": 0.035,
    "late": 0.005, "speed_scale": 0.02,
}  # fmt: skip
# Logs of factors on NOISE (of a gyro, rad/s, and an accelerometer, m/s2, rms a sample) and on INCOHERENCE
NOISE_SIGMA: Mapping[str, float] = {
    "yaw_noise_1": 1.5, "lateral_noise_1": 1.5, "yaw_noise_2": 1.5, "lateral_noise_2": 1.5, "incoherence": 1.0,
}  # fmt: skip
UNKNOWNS = (*PRIOR_SIGMA, *SENSOR_SIGMA, *NOISE_SIGMA)
OF_VEHICLE = len(PRIOR_SIGMA)
_OF_RESPONSE = OF_VEHICLE + len(SENSOR_SIGMA)
_LATE, _SPEED_SCALE, _INCOHERENCE = (UNKNOWNS.index(name) for name in ("late", "speed_scale", "incoherence"))
_NOISES = slice(_OF_RESPONSE, _INCOHERENCE)
NOISE, INCOHERENCE = np.array([3e-4, 0.01, 3e-4, 0.01]), 0.03
LEAST_POWER = (1e-3 * NOISE) ** 2  # of a channel, which may be none: a signal that stands still
# Logs: of the creep force's secant about a rail between damp and dry, of the slope over it, of a bin's power about a
# curve of second order over the log of the wave number. The secant's is wide: all blocks together would tell the scale
# of all stiffnesses and masses by what is a guess.
SECANT_SIGMA, SLOPE_SIGMA, POWER_SIGMA = 3.0, 0.25, 2.0
USUAL_SLOPE = 0.7  # k_A + k_S of that rail
SLOPES, POWERS = 2, 2  # unknowns of a block, and of a bin
MAX_STEPS, ENOUGH = 60, 0.02  # the valley along all masses is flat: 20 are too few
_DELTA = 1e-4  # of numerical derivatives
_ROW, _COLUMN = np.triu_indices(CHANNELS, 1)


@dataclass(frozen=True, slots=True)
class Guess:
    """Values of all unknowns. unknowns (U,): by UNKNOWNS; slopes (B, 2): logs of g22 and of g11 / g22; powers
    (B, F, 2): logs of those of alignment and cross-level."""

    unknowns: FloatArray
    slopes: FloatArray
    powers: FloatArray


@dataclass(frozen=True, slots=True)
class Judged:
    """A guess, what it makes of the signals, and how likely it is.

    H (B, F, CHANNELS, 2); L: Cholesky factor of S; white: L^-1 R L^-H of the measured R, one where the guess is right;
    objective: log of likelihood times prior.
    """

    guess: Guess
    H: ComplexArray
    L: ComplexArray
    white: ComplexArray
    objective: float


@dataclass(frozen=True, slots=True)
class Scores:
    """Of a guess: gradient (U,) and Fisher matrix (U, U) without powers and slopes; own (B, 2) and taken (B, 2, U): the
    slopes' step, less what the unknowns' step takes of it."""

    gradient: FloatArray
    fisher: FloatArray
    own: FloatArray
    taken: FloatArray


class BogieFit:
    """The fit of one vehicle. nominal: constants that factors are on; sigma: other priors than the usual ones; start:
    unknowns that do not begin at 0."""

    def __init__(
        self, blocks: Blocks, nominal: BogieConstants, sigma: Mapping[str, float] | None = None,
        start: Mapping[str, float] | None = None,
    ) -> None:  # fmt: skip
        self.blocks, self.nominal = blocks, nominal
        known = {**PRIOR_SIGMA, **SENSOR_SIGMA, **NOISE_SIGMA, **(sigma or {})}
        self.sigma = np.array([known[name] for name in UNKNOWNS])
        self._secant = np.log(nominal.slope_N * USUAL_SLOPE)
        first = np.array([(start or {}).get(name, 0.0) for name in UNKNOWNS])
        self._begin(first, np.zeros((len(blocks), SLOPES)))

    def _begin(self, unknowns: FloatArray, slopes: FloatArray) -> None:
        H = self._seen(unknowns, slopes)
        powers = self._least_squares(H)
        self._expected = self._smooth(powers)
        self.best = self._judged(Guess(unknowns, slopes, self._refined(H, unknowns, powers, 8)), H)
        self.scores = self._scores(self.best)

    # what a guess makes of the signals

    def _bogie(self, unknowns: FloatArray, slopes: FloatArray) -> ComplexArray:
        """(B, F, 2 wheelsets, 3 signals, 2 sources)."""
        b = self.blocks
        c = self.nominal.changed(dict(zip(UNKNOWNS, unknowns[:OF_VEHICLE].tolist(), strict=False)))
        g22 = np.exp(self._secant + slopes[:, 0])
        of_blocks = (
            b.speed_m_s * np.exp(unknowns[_SPEED_SCALE]), g22 * np.exp(slopes[:, 1]), g22, c.wheelbase_m / b.speed_m_s
        )  # fmt: skip
        v, g11, secant, later = (np.repeat(a, len(b.frequency_hz)) for a in of_blocks)
        out = response(c, v, g11, secant, np.tile(b.frequency_hz, len(b)), later)
        return out.reshape(len(b), len(b.frequency_hz), *out.shape[1:])

    def _sensed(self, bogie: ComplexArray, unknowns: FloatArray) -> ComplexArray:
        """H: the bogie's signals as the sensors give them."""
        lead, gain, gyro_gain, askew = unknowns[OF_VEHICLE:_LATE].reshape(4, 2)
        turn = 2j * np.pi * self.blocks.frequency_hz[:, None]
        H = np.empty((*bogie.shape[:2], CHANNELS, POWERS), np.complex128)
        for k in range(2):
            H[:, :, 2 * k] = (bogie[:, :, k, 0] + askew[k] * bogie[:, :, k, 2]) * np.exp(gyro_gain[k])
            H[:, :, 2 * k + 1] = bogie[:, :, k, 1] * np.exp(gain[k] - turn * lead[k])
        H[:, :, 2:] *= np.exp(-turn * unknowns[_LATE])[:, :, None]
        return H

    def _seen(self, unknowns: FloatArray, slopes: FloatArray) -> ComplexArray:
        return self._sensed(self._bogie(unknowns, slopes), unknowns)

    def _spectra(self, H: ComplexArray, powers: FloatArray, unknowns: FloatArray) -> ComplexArray:
        """S (B, F, CHANNELS, CHANNELS)."""
        strong = H * np.exp(0.5 * powers)[:, :, None, :]
        S = strong @ strong.conj().swapaxes(2, 3)
        at = np.arange(CHANNELS)
        noise = NOISE**2 * np.exp(2 * unknowns[_NOISES])
        S[:, :, at, at] = S[:, :, at, at].real * (1 + self._incoherent_share(unknowns)) + noise
        return np.asarray(S)

    @staticmethod
    def _incoherent_share(unknowns: FloatArray) -> float:
        return float((INCOHERENCE * np.exp(unknowns[_INCOHERENCE])) ** 2)

    # how likely it is

    def _likelihood(self, S: ComplexArray) -> tuple[FloatArray, ComplexArray, ComplexArray]:
        """Log-likelihood of each bin (B, F), L and white."""
        L = np.asarray(np.linalg.cholesky(S))
        white = np.asarray(np.linalg.solve(L, np.linalg.solve(L, self.blocks.cross).conj().swapaxes(2, 3)))
        determinant = 2 * np.log(np.einsum("bfii->bfi", L).real).sum(axis=-1)
        fit = -(determinant + np.einsum("bfii->bf", white).real) * self.blocks.independent[:, None]
        return fit, L, white

    def _power_prior(self, powers: FloatArray) -> FloatArray:
        out: FloatArray = -0.5 * (((powers - self._expected) / POWER_SIGMA) ** 2).sum(axis=-1)
        return out

    def _judged(self, guess: Guess, H: ComplexArray | None = None) -> Judged:
        H = self._seen(guess.unknowns, guess.slopes) if H is None else H
        fit, L, white = self._likelihood(self._spectra(H, guess.powers, guess.unknowns))
        prior = -0.5 * ((guess.unknowns / self.sigma) ** 2).sum()
        prior -= 0.5 * ((guess.slopes / (SECANT_SIGMA, SLOPE_SIGMA)) ** 2).sum()
        return Judged(guess, H, L, white, float(fit.sum() + prior + self._power_prior(guess.powers).sum()))

    # the powers of a bin

    def _least_squares(self, H: ComplexArray) -> FloatArray:
        """Powers (B, F, 2) to begin with, the channels in units of their own level."""
        R = self.blocks.cross
        unit = 1 / np.sqrt(np.maximum(np.einsum("bfii->bfi", R).real, LEAST_POWER))
        H, R = H * unit[..., None], R * unit[..., None] * unit[..., None, :]
        both = np.abs(H.conj().swapaxes(2, 3) @ H) ** 2
        seen = np.einsum("bfik,bfij,bfjk->bfk", H.conj(), R, H).real
        ridge = 1e-6 * np.einsum("bfii->bf", both)[..., None, None] * np.eye(POWERS)
        powers = np.linalg.solve(both + ridge, seen[..., None])[..., 0]
        alone = seen / np.einsum("bfkk->bfk", both)
        return np.asarray(np.log(np.maximum(powers, 0.02 * alone)))

    def _smooth(self, powers: FloatArray) -> FloatArray:
        """What powers are expected about: of each block a curve of second order over the log of the wave number.

        It has to follow the fit. Held at what the first guess of the vehicle makes of the signals it holds that guess.
        """
        x = np.log(self.blocks.frequency_hz)
        A = np.stack((np.ones_like(x), x - x.mean(), (x - x.mean()) ** 2), axis=1)
        return np.asarray(np.einsum("fk,kg,bgc->bfc", A, np.linalg.pinv(A), powers))

    def _refined(self, H: ComplexArray, unknowns: FloatArray, powers: FloatArray, steps: int) -> FloatArray:
        """Powers by damped Fisher steps, each bin by itself."""
        fit, L, white = self._likelihood(self._spectra(H, powers, unknowns))
        now, n = fit + self._power_prior(powers), self.blocks.independent[:, None, None]
        damping = np.full(now.shape, 1e-2)
        for _ in range(steps):
            gradient, fisher = self._power_scores(H, unknowns, powers, L, white)
            gradient = gradient * n - (powers - self._expected) / POWER_SIGMA**2
            fisher = fisher * n[..., None] + np.eye(POWERS) / POWER_SIGMA**2
            fisher += (damping * np.einsum("bfii->bf", fisher))[..., None, None] * np.eye(POWERS)
            moved = powers + np.clip(np.linalg.solve(fisher, gradient[..., None])[..., 0], -2, 2)
            fit, L_moved, white_moved = self._likelihood(self._spectra(H, moved, unknowns))
            fit += self._power_prior(moved)
            better = fit > now
            powers, now = np.where(better[..., None], moved, powers), np.where(better, fit, now)
            L = np.where(better[..., None, None], L_moved, L)
            white = np.where(better[..., None, None], white_moved, white)
            damping = np.where(better, damping / 5, damping * 8)
        return powers

    def _power_scores(
        self, H: ComplexArray, unknowns: FloatArray, powers: FloatArray, L: ComplexArray, white: ComplexArray
    ) -> tuple[FloatArray, FloatArray]:
        """Gradient (B, F, 2) and Fisher matrix (B, F, 2, 2) of one independent value."""
        strong = H * np.exp(0.5 * powers)[:, :, None, :]
        inverse, share = np.linalg.inv(L), self._incoherent_share(unknowns)
        whitened, incoherent = inverse @ strong, np.sqrt(share) * np.abs(strong)
        each = []
        for k in range(POWERS):
            own = whitened[..., k, None] * whitened[..., None, :, k].conj()
            beside = inverse * incoherent[:, :, None, :, k]
            each.append(own + beside @ beside.conj().swapaxes(2, 3))
        A, error = np.stack(each, axis=2), white - np.eye(CHANNELS)
        gradient = np.einsum("bfkij,bfji->bfk", A, error).real
        return gradient, np.einsum("bfkij,bflji->bfkl", A, A).real

    def _better_powers(self, judged: Judged) -> FloatArray:
        """Of each bin the better of its powers and of those found anew: it may be in another one's valley."""
        guess = judged.guess

        def of_bins(powers: FloatArray) -> FloatArray:
            fit = self._likelihood(self._spectra(judged.H, powers, guess.unknowns))[0]
            return fit + self._power_prior(powers)

        anew = self._refined(judged.H, guess.unknowns, self._least_squares(judged.H), 6)
        return np.where((of_bins(anew) > of_bins(guess.powers))[..., None], anew, guess.powers)

    # the steps

    def _jacobian(self, judged: Judged) -> FloatArray:
        """(B, F, U + 4, 16): derivatives of the whitened S by unknowns, slopes and powers, Hermitian as 16 numbers."""
        x, slopes, powers = judged.guess.unknowns, judged.guess.slopes, judged.guess.powers
        bogie = self._bogie(x, slopes)
        S, inverse = self._spectra(judged.H, powers, x), np.linalg.inv(judged.L)

        def column(moved: ComplexArray) -> FloatArray:
            return _as_real(inverse @ ((moved - S) / _DELTA) @ inverse.conj().swapaxes(2, 3))

        columns = []
        for u in range(len(x)):
            y = x.copy()
            y[u] += _DELTA
            if u < OF_VEHICLE or u == _SPEED_SCALE:
                H = self._seen(y, slopes)
            else:
                H = self._sensed(bogie, y) if u < _OF_RESPONSE else judged.H
            columns.append(column(self._spectra(H, powers, y)))
        for u in range(SLOPES):
            moved = slopes + _DELTA * (np.arange(SLOPES) == u)
            columns.append(column(self._spectra(self._seen(x, moved), powers, x)))
        of_powers = (powers + _DELTA * (np.arange(POWERS) == u) for u in range(POWERS))
        columns += [column(self._spectra(judged.H, moved, x)) for moved in of_powers]
        return np.stack(columns, axis=2)

    def _scores(self, judged: Judged) -> Scores:
        guess, n, u = judged.guess, self.blocks.independent, len(UNKNOWNS)
        A, error = self._jacobian(judged), _as_real(judged.white - np.eye(CHANNELS))
        g = np.einsum("bfpk,bfk->bfp", A, error) * n[:, None, None]
        F = (A @ A.swapaxes(2, 3)) * n[:, None, None, None]
        F[:, :, u + SLOPES :, u + SLOPES :] += np.eye(POWERS) / POWER_SIGMA**2
        g[:, :, u + SLOPES :] -= (guess.powers - self._expected) / POWER_SIGMA**2
        F, g, _, _ = _eliminated(F, g, POWERS)
        F, g = F.sum(axis=1), g.sum(axis=1)
        sigma = np.array([SECANT_SIGMA, SLOPE_SIGMA])
        F[:, u:, u:] += np.diag(1 / sigma**2)
        g[:, u:] -= guess.slopes / sigma**2
        F, g, own, taken = _eliminated(F, g, SLOPES)
        prior = 1 / self.sigma**2
        return Scores(g.sum(axis=0) - guess.unknowns * prior, F.sum(axis=0) + np.diag(prior), own, taken)

    def run(self, steps: int = MAX_STEPS, shown: Callable[[int], object] | None = None) -> None:
        """Climb to the most likely guess. shown: is called with the number of each step."""
        damping = 1e-2
        for step in range(steps):
            if shown is not None:
                shown(step)
            now = self.best
            self._expected = self._smooth(now.guess.powers)
            powers = self._better_powers(now) if step % 3 == 2 else now.guess.powers
            powers = self._refined(now.H, now.guess.unknowns, powers, 2)
            now = self._judged(replace(now.guess, powers=powers), now.H)
            scores = self._scores(now)
            self.best, self.scores = now, scores
            for _ in range(6):
                new = self._judged(self._moved(now, scores, damping))
                if new.objective > now.objective:
                    break
                damping *= 6
            else:
                return
            self.best, damping = new, damping / 4
            if new.objective - now.objective < ENOUGH:
                break
        self.scores = self._scores(self.best)

    def _moved(self, now: Judged, scores: Scores, damping: float) -> Guess:
        damped = scores.fisher + damping * np.diag(np.diag(scores.fisher))
        step = np.clip(np.linalg.solve(damped, scores.gradient), -0.5, 0.5)
        of_slopes = np.clip(scores.own - scores.taken @ step, -0.5, 0.5)
        x, slopes = now.guess.unknowns + step, now.guess.slopes + of_slopes
        return Guess(x, slopes, self._refined(self._seen(x, slopes), x, now.guess.powers, 3))

    # what came of it

    @property
    def logs(self) -> dict[str, float]:
        """By name, the unknowns."""
        return dict(zip(UNKNOWNS, self.best.guess.unknowns.tolist(), strict=True))

    @property
    def constants(self) -> BogieConstants:
        """The vehicle's."""
        return self.nominal.changed({name: self.logs[name] for name in PRIOR_SIGMA})

    @property
    def incoherence(self) -> float:
        """Amplitude that neither track nor noise explains, as a share of each signal's: 0.03 to 0.065 in good fits."""
        return float(np.sqrt(self._incoherent_share(self.best.guess.unknowns)))

    @property
    def covariance(self) -> FloatArray:
        """(U, U), of the unknowns, if the model were right."""
        return np.asarray(np.linalg.inv(self.scores.fisher))

    @property
    def expected(self) -> ComplexArray:
        """S (B, F, CHANNELS, CHANNELS) of the best guess."""
        return np.asarray(self.best.L @ self.best.L.conj().swapaxes(2, 3))

    @property
    def misfit(self) -> FloatArray:
        """(B,): by how much the signals are stronger than expected, 0 where they are not."""
        out: FloatArray = np.einsum("bfii->bf", self.best.white).real.mean(axis=1) / CHANNELS - 1
        return out

    def keep(self, which: BoolArray) -> None:
        """Go on with the blocks that are True in (B,)."""
        self.blocks = self.blocks.some(which)
        self._begin(self.best.guess.unknowns, self.best.guess.slopes[which])


MAX_MISFIT, MAX_TRIMMED_AT_ONCE, MIN_BLOCKS, ROUNDS = 0.15, 0.2, 3, 5


def run_trimmed(fit: BogieFit, shown: Callable[[int], object] | None = None) -> int:
    """Run a fit, leave out the blocks that fit worst, which no gate has seen, and run it again. Returns how many
    stretches were left out."""
    fit.run(shown=shown)
    before = fit.blocks.stretches.sum()
    for _ in range(ROUNDS):
        misfit = fit.misfit
        limit = max(MAX_MISFIT, float(np.quantile(misfit, 1 - MAX_TRIMMED_AT_ONCE, method="lower")))
        kept = misfit <= limit
        if kept.all() or kept.sum() < MIN_BLOCKS:
            break
        fit.keep(kept)
        fit.run(shown=shown)
    return int(before - fit.blocks.stretches.sum())


def _as_real(M: ComplexArray) -> FloatArray:
    """A Hermitian (..., n, n) as (..., n * n) real numbers with the same sum of squares."""
    upper = np.sqrt(2) * M[..., _ROW, _COLUMN]
    return np.concatenate((np.einsum("...ii->...i", M).real, upper.real, upper.imag), axis=-1)


def _eliminated(F: FloatArray, g: FloatArray, last: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Fisher matrices (..., p, p) and gradients (..., p) without the last unknowns; those ones' own steps (..., last),
    and what the others' steps (..., last, p - last) take of them."""
    k = F.shape[-1] - last
    C, D = F[..., :k, k:], F[..., k:, k:]
    taken = np.asarray(np.linalg.solve(D, C.swapaxes(-1, -2)))
    own = np.asarray(np.linalg.solve(D, g[..., k:, None])[..., 0])
    return F[..., :k, :k] - C @ taken, g[..., :k] - (C @ own[..., None])[..., 0], own, taken
