"""Rails that change, and torque that slips: transitions, drops, slip cycles; the paper's own cases."""

import itertools
from collections.abc import Iterator

import numpy as np

from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.physics.track import SPECTRA
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.scenario import AxleScenario, FloatArray
from sim_ecu.score.suites.nominal import RUN_S
from sim_ecu.score.suites.run import (
    AXLES,
    TEST,
    Lot,
    Rng,
    Run,
    any_track,
    axle,
    by_four,
    drive,
    one_rail,
    rails,
    scenario,
)  # fmt: skip

PAPER_RUNS = 12
PAPER_M_S = 25.0
CHANGING_M_S = (15.0, 40.0)
TRANSITIONS_S = (5.0, 9.0, 13.0)  # there, back, end
TRANSITIONS_TIMES = 3  # over all cases
DROP_S = (5.0, 9.5)  # down, end
DROPS_TIMES = 3  # over all cases
END_SHARES = (0.3, 0.9)  # of the new peak: half of the drops end with so much torque
SLIDE_SHARES = (1.1, 0.9)  # of the new and of the old peak: between them lies the torque of the other half
CYCLES_TIMES = 2  # over all cases
CYCLES_HZ = (0.5, 1.0)
CYCLE_CREEP = 2.0  # of the peak's: how far a wheel slips
# what goes up and back: the creep, or a torque beyond what the rail carries, which is then let go altogether
CYCLES = (("creep_of_peak", 0.3, CYCLE_CREEP), ("utilisation", 0.0, 1.6))
RISE = 0.7  # share of a cycle in which the creep grows; then the torque is taken back
ORDER = sorted(CURVES, key=lambda c: -CURVES[c].mu_0)


def paper(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Each curve held at its peak at 25 m/s: where the paper shows its results."""
    rng = lot.generator(1)
    letters = list(CURVES) * max(2, round(PAPER_RUNS * AXLES / len(CURVES) * scale))
    for number, part in enumerate(by_four(letters, rng)):
        held = drive("creep_of_peak", (0.0, 0.0), (0.5, 1.0))
        axles = [axle(lot, i, one_rail(CURVES[c]), held, SPECTRA["good"], rng) for i, c in part]
        played = scenario(w, RUN_S, PAPER_M_S, axles)
        yield Run("paper", "held at the peak", number, played, tuple(c for _, c in part))


def transitions(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Dry to each other curve and back, in traction and braking, at torques that a dry rail carries easily."""
    rng = lot.generator(4)
    cases = [(c, u, s) for u in (0.15, 0.3, 0.6) for s in (1.0, -1.0) for c in ORDER[1:]]
    there_s, back_s, end_s = TRANSITIONS_S
    for number, part in enumerate(by_four(cases * max(1, round(TRANSITIONS_TIMES * scale)), rng)):
        v = float(rng.uniform(*CHANGING_M_S))
        axles = []
        for i, (letter, share, sign) in part:
            rail = rails([(0.0, "A"), (there_s * v, letter), (back_s * v, "A")])
            torque = sign * share * _carried(w, v, "A")
            axles.append(_pulled(lot, i, rail, torque, rng))
        curves = tuple(letter for _, (letter, _, _) in part)
        played = scenario(w, end_s, v, axles)
        yield Run("transitions", "dry, another, dry", number, played, curves, changes_s=(there_s, back_s))


def drops(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Down to every curve from dry and from every higher one, in traction and braking; half of them end unsaturated."""
    rng = lot.generator(5)
    pairs = [*itertools.combinations(ORDER, 2)]
    cases = [(high, low, sign, slides) for high, low in pairs for sign in (1.0, -1.0) for slides in (False, True)]
    down_s, end_s = DROP_S
    every = list(by_four(cases * DROPS_TIMES, rng))
    for number, part in enumerate(every[: max(2, round(len(every) * scale))]):
        v = float(rng.uniform(*CHANGING_M_S))
        axles = []
        for i, (high, low, sign, slides) in part:
            old, new = _carried(w, v, high), _carried(w, v, low)
            ends = (
                (SLIDE_SHARES[0] * new, SLIDE_SHARES[1] * old) if slides else (END_SHARES[0] * new, END_SHARES[1] * new)
            )
            torque = sign * float(rng.uniform(min(ends), max(ends)))
            axles.append(_pulled(lot, i, rails([(0.0, high), (down_s * v, low)]), torque, rng))
        curves = tuple(f"{high} to {low}" for _, (high, low, _, _) in part)
        yield Run("drops", "down", number, scenario(w, end_s, v, axles), curves, changes_s=(down_s,))


def cycles(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Torque that goes through the peak and is taken back, again and again, as a wheel-slide protection does it."""
    rng = lot.generator(6)
    cases = [(c, s, hertz, cycle) for c in ORDER for s in (1.0, -1.0) for hertz in CYCLES_HZ for cycle in CYCLES]
    every = list(by_four(cases * CYCLES_TIMES, rng))
    for number, part in enumerate(every[: max(2, round(len(every) * scale))]):
        v = float(rng.uniform(*CHANGING_M_S))
        axles = []
        for i, (letter, sign, hertz, (demand, low, high)) in part:
            points = sawtooth(hertz, RUN_S, sign * low, sign * high)
            slips = drive(demand, *points, limit=CYCLE_CREEP)
            axles.append(axle(lot, i, one_rail(CURVES[letter]), slips, any_track(rng), rng))
        curves = tuple(letter for _, (letter, *_) in part)
        yield Run("cycles", "slip cycles", number, scenario(w, RUN_S, v, axles), curves)


def sawtooth(hertz: float, seconds: float, low: float, high: float) -> list[tuple[float, float]]:
    """(s, demand) of slip cycles: slowly up, faster back."""
    points = [(0.0, 0.0), (0.5, low)]
    for t in np.arange(0.5, seconds, 1.0 / hertz):
        points += [(float(t + RISE / hertz), high), (float(t + 1.0 / hertz), low)]
    return points


def _carried(w: Wheelset, speed_m_s: float, letter: str) -> float:
    """Torque (N m) that a rail carries at its peak."""
    return float(peak(speed_m_s, w.contact, *CURVES[letter].row())[1] * 2 * w.normal_N * w.r_0)


def _pulled(lot: Lot, place: int, rail: FloatArray, torque: float, rng: Rng) -> AxleScenario:
    held = drive("torque_N_m", (0.0, 0.0), (0.5, torque), limit=1.2)
    return axle(lot, place, rail, held, any_track(rng), rng)
