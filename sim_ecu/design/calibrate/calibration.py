"""The fit of a vehicle to its logs: constants with honest intervals, or the reason why there are none."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

from sim_ecu.design.calibrate.known_vehicle import OF_90_PERCENT, KnownVehicle
from sim_ecu.physics.wheelset import Wheelset
from wrcd.fit.bogie import PRIOR_SIGMA, SHAFT, BogieConstants
from wrcd.fit.stretches import Blocks, BogieSignals, LeftOut, blocks_of
from wrcd.fit.whittle import MIN_BLOCKS, UNKNOWNS, BogieFit, run_trimmed

EVERY_BINS = 2  # of the frequencies: a Hann window smears each over its neighbours
MIN_STRETCHES = 20
MAX_INCOHERENCE = 0.10  # good fits have 3 to 6.5 %; at 11 to 19 % constants were wrong by a factor of two
# Clocks of both axles that are 10 ms apart have an optimum of their own, with a wrong conicity: where the signals are
# more incoherent than this, the fit is begun again with such clocks; where they are by far, that is in vain.
SUSPICIOUS, HOPELESS, LATE_S = 0.055, 0.2, (0.0, 0.01, -0.01)
OF_SHAFT = ("k_s", "C_s")
# Standard deviations by the curvature of the likelihood are too small: the model is linear, the train is not. Over 16
# simulated vehicles, 20 minutes each, 97 % of the true constants lie in an interval whose standard deviation is so many
# times as large, times the square of the incoherence over USUAL_INCOHERENCE, and no smaller than LEAST (log).
TIMES, USUAL_INCOHERENCE, LEAST = 1.5, 0.04, 0.03
BELOW_BAND = "secondary_yaw_N_m_rad"  # it acts below 1 Hz, and is found up to three times as large
# What is known before within a little. Its distances, in standard deviations, squared and added: of six honest fits
# 0.7 to 7.7; with a load of 1.3 times 29, of half 65.
KNOWN_WITHIN, MAX_DISTANCE = ("m_w", "I_w", "frame_mass_kg", "frame_yaw_inertia_kg_m2", "r_0"), 16.0
MAX_SPEED_SCALE, MAX_NOISE_TIMES = 0.15, 20.0
LITTLE_KNOWN = math.log(1.5)  # half width (log) of a constant that is next to unknown
# Half widths (log) of the 90 % interval above which a design minds; what is not among them matters next to nothing.
NEEDED = {"gamma": 0.10, "primary_yaw_N_m_rad": 0.20, "secondary_yaw_damping_N_m_s_rad": 0.25}


@dataclass(frozen=True, slots=True)
class Calibration:
    """What came of it. fit: None where there are too few stretches. refused: why no vehicle is found, or ""."""

    known: KnownVehicle
    blocks: Blocks
    left_out: Counter[LeftOut]
    fit: BogieFit | None
    refused: str

    @property
    def stretches(self) -> int:
        """How many were used."""
        return int((self.blocks if self.fit is None else self.fit.blocks).stretches.sum())

    def half_width(self, name: str) -> float:
        """Log by which an unknown may be off, with 90 %."""
        assert self.fit is not None
        k = UNKNOWNS.index(name)
        times = TIMES * max(1.0, self.fit.incoherence / USUAL_INCOHERENCE) ** 2
        sigma = math.hypot(times * math.sqrt(self.fit.covariance[k, k]), LEAST)
        return OF_90_PERCENT * min(sigma, float(self.fit.sigma[k]))  # no more than before

    @property
    def wheelset(self) -> Wheelset:
        """The vehicle that was found. Its load is the known one, so that the body's mass follows."""
        assert self.fit is not None
        w, found = self.known.wheelset, asdict(self.fit.constants)
        assert w.bogie is not None
        own = {name: found[name] for name in ("m_w", "I_w", "gamma", "r_0", *OF_SHAFT)}
        held = {name: found[name] for name in PRIOR_SIGMA if name not in own and name != SHAFT}
        held["body_mass_kg"] = 2 * (w.M_v - found["m_w"]) - found["frame_mass_kg"]
        return replace(w, **own, bogie=replace(w.bogie, **held))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """By name, between what a constant lies with 90 %; of those that are known."""
        assert self.fit is not None
        found, out = asdict(self.fit.constants), {}
        for name in filter(self.is_told, PRIOR_SIGMA):
            times = math.exp(self.half_width(name))
            for each in OF_SHAFT if name == SHAFT else (name,):
                out[each] = found[each] / times, found[each] * times
        return out

    def is_told(self, name: str) -> bool:
        """Whether the logs, or what was known before, tell a constant."""
        assert self.fit is not None
        is_there = name == SHAFT or asdict(self.fit.constants)[name] > 0.0
        return is_there and name != BELOW_BAND and self.half_width(name) <= LITTLE_KNOWN

    @property
    def lacking(self) -> dict[str, float]:
        """Constants that are not known well enough, and how many times too wide their intervals are."""
        if self.fit is None:
            return {}
        return {n: w / most for n, most in NEEDED.items() if (w := self.half_width(n)) > most}


def calibrate(
    runs: Sequence[BogieSignals], known: KnownVehicle, shown: Callable[[int], object] | None = None
) -> Calibration:
    """Find the constants of a vehicle from runs of it. shown: is called with the number of each step."""
    nominal = BogieConstants.of(asdict(known.wheelset))
    blocks, left_out = blocks_of(runs, nominal.wheelbase_m)
    if len(blocks) < MIN_BLOCKS or blocks.stretches.sum() < MIN_STRETCHES:
        found = f"{blocks.stretches.sum():.0f} in {len(blocks)} rows of one speed"
        refused = f"too few calm stretches: {found}; {MIN_STRETCHES} in {MIN_BLOCKS} are needed"
        return Calibration(known, blocks, left_out, None, refused)
    fit, trimmed = _best(blocks.every(EVERY_BINS), nominal, known, shown)
    left_out[LeftOut.MISFIT] += trimmed
    c = Calibration(known, blocks, left_out, fit, _refusal(fit))
    if not c.refused and not any(map(c.is_told, NEEDED)):
        return replace(c, refused="neither conicity nor yaw stiffness nor yaw damper is known from this")
    return c


def _refusal(fit: BogieFit) -> str:
    """Why a fit is not to be believed, or ""."""
    if not fit.incoherence <= MAX_INCOHERENCE:
        return (
            f"the signals are incoherent by {100 * fit.incoherence:.0f} %, {100 * MAX_INCOHERENCE:.0f} % at most: "
            "this bogie on a track does not make them; look at order, signs and units of the axles, and the wheelbase"
        )
    x, sigma = fit.logs, dict(zip(UNKNOWNS, fit.sigma.tolist(), strict=True))
    distance = sum((x[name] / sigma[name]) ** 2 for name in KNOWN_WITHIN)
    if not (distance <= MAX_DISTANCE and abs(x["speed_scale"]) <= MAX_SPEED_SCALE):
        far = max(KNOWN_WITHIN, key=lambda name: abs(x[name] / sigma[name])) if distance > MAX_DISTANCE else "the speed"
        return f"{far} would be far from what is usual: look at load, wheel radius, wheelbase and the sensors' units"
    if noisy := [n for n in UNKNOWNS if "noise" in n and not x[n] <= math.log(MAX_NOISE_TIMES)]:
        return f"{', '.join(noisy)} would be more than {MAX_NOISE_TIMES:g} times the usual: a sensor is dead or shaken"
    return ""


def _best(
    blocks: Blocks, nominal: BogieConstants, known: KnownVehicle, shown: Callable[[int], object] | None
) -> tuple[BogieFit, int]:
    """The fit with the least incoherence, and how many stretches were trimmed for it."""
    fits: list[tuple[BogieFit, int]] = []
    for late_s in LATE_S:
        fit = BogieFit(blocks, nominal, known.sigma, {"late": late_s})
        fits.append((fit, run_trimmed(fit, shown)))
        if not SUSPICIOUS < fit.incoherence < HOPELESS:
            break
    return min(fits, key=lambda each: each[0].incoherence)
