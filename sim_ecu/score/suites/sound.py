"""Sound sensors for minutes: on the grid's conditions, through canted curves, where the rail is held at its peak, and
hours of dry rail: how often, and for how long, is it called low?

What judges a pair of sensors takes nine seconds and more, and the runs of the other suites end after ten.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sim_ecu.physics.contact import CURVES, CreepCurve
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.track import SPECTRA
from sim_ecu.physics.wheelset import GRAVITY, Wheelset
from sim_ecu.play.scenario import FloatArray, path_of, read_scenario
from sim_ecu.score.suites.nominal import GOLDEN, Variant, condition, spread, varied
from sim_ecu.score.suites.run import (
    AXLES,
    SPEEDS,
    TEST,
    UTILISATIONS,
    Lot,
    Rng,
    Run,
    any_track,
    axle,
    drive,
    one_rail,
    scenario,
)  # fmt: skip
from wrcd.config.section import Section, TomlSource

SOUND_RUNS = 10  # of each suite
LONG_S, CANTED_S, PEAK_S = 120.0, 60.0, 60.0
LONG = "120 s"
CANTED = Variant("canted curves", speeds=(15.0, 45.0))
PEAK = "held at the peak"
# Radius (m), the acceleration that the cant does not balance (m/s2), cant (rad): of main lines.
RADII_M, UNBALANCED_M_S2, MAX_CANT_RAD = (300.0, 3000.0), (-0.4, 0.65), 0.1
CURVES_S = ((6.0, 24.0), (33.0, 51.0))  # from when to when each curve lies
RAMP_S = 3.0  # of each transition
RAILS = (("A",), ("C",), ("E",), ("D", "F"))  # of each axle; of two, one after the other

PACKAGED_SEEDS = 6  # from 1 on
PACKAGED_CURVES, PACKAGED_GREASY = (f"packaged {name}, seeds 1 to {PACKAGED_SEEDS}" for name in ("curves", "greasy"))
PACKAGED_FROM = 1000  # their numbers are beyond those of the other runs
PACKAGED = {PACKAGED_CURVES: "curves", PACKAGED_GREASY: "greasy"}


long = varied("long", (Variant(LONG),), SOUND_RUNS, 0, LONG_S)


def canted(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """The grid's contacts through a curve each way, with what the cant does not balance; and the packaged ones."""
    for n in spread(scale, SOUND_RUNS, 1):
        run = condition("canted", w, n, CANTED, CANTED_S, lot)
        rng, v = lot.generator(8, n), float(run.scenario.speed.values[0])
        axles = tuple(replace(a, rail=_through_curves(a.rail, v, rng)) for a in run.scenario.axles)
        yield replace(run, scenario=replace(run.scenario, axles=axles))
    yield from _packaged("canted", PACKAGED_CURVES, w, scale, lot)


def _through_curves(rail: FloatArray, speed_m_s: float, rng: Rng) -> FloatArray:
    """The rail's contact through two curves, the first to either side and the second to the other."""
    contact = CreepCurve("", "", *rail[0, 1:6])
    ramp_m, side = RAMP_S * speed_m_s, float(rng.choice((-1.0, 1.0)))
    sections = [RailSection(0.0, contact)]
    for begins_s, ends_s in CURVES_S:
        least_m = speed_m_s**2 / (MAX_CANT_RAD * GRAVITY + UNBALANCED_M_S2[1])
        radius_m = np.exp(rng.uniform(*np.log((max(RADII_M[0], least_m), RADII_M[1]))))
        needed = (speed_m_s**2 / radius_m - rng.uniform(*UNBALANCED_M_S2)) / GRAVITY
        cant = float(np.clip(needed, 0.0, MAX_CANT_RAD))
        sections += [
            RailSection(begins_s * speed_m_s, contact, side / float(radius_m), side * cant, ramp_m),
            RailSection(ends_s * speed_m_s, contact, 0.0, 0.0, ramp_m),
        ]
        side = -side
    return rail_table(sections)


def peak(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """All of the rail in use throughout, on dry, wet, greasy and low rail; and the packaged one."""
    rng = lot.generator(9)
    held = drive("utilisation", (0.0, 0.0), (0.5, 1.0))
    low, high = SPEEDS
    for number in range(max(2, round(SOUND_RUNS * scale))):
        v = low + (high - low) * ((0.5 + number * GOLDEN) % 1.0)
        letters = tuple(rails[number % len(rails)] for rails in RAILS)
        axles = [axle(lot, i, one_rail(CURVES[c]), held, any_track(rng), rng) for i, c in enumerate(letters)]
        yield Run("peak", PEAK, number, scenario(w, PEAK_S, v, axles), letters)
    yield from _packaged("peak", PACKAGED_GREASY, w, scale, lot)


def _packaged(suite: str, group: str, w: Wheelset, scale: float, lot: Lot) -> Iterator[Run]:
    """A packaged scenario with its own first seeds, which are no lot's: only the score plays it.

    A lone wheelset's track has alignment alone, as its training had.
    """
    path = path_of(PACKAGED[group])
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    if w.bogie is None:
        data["track"] = "good"
    for seed in range(1, 1 + max(1, round(PACKAGED_SEEDS * scale)) * (lot == TEST)):
        top = Section(data | {"seed": seed}, TomlSource(path, {}, None), ())
        played = replace(read_scenario(top, path.stem), wheelset=w)
        letters = (str(data["rail"][0]["curve"]),) * len(played.axles)
        yield Run(suite, group, PACKAGED_FROM + seed, played, letters)


DRY_HOURS = 3.0  # of all axles together
DRY_RUN_S = 25.0
DRY_STEP_S = 5.0  # between the torques of a course
DRY_COASTING = 0.25  # of the axles, in the middle of their run


def dry_hours(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Many short, poor tracks, each with another seed, at all utilisations and speeds, coasting included."""
    rng = lot.generator(7)
    for number in range(max(2, round(DRY_HOURS * 3600 / (DRY_RUN_S * AXLES) * scale))):
        v = float(rng.uniform(*SPEEDS))
        axles = []
        for i in range(AXLES):
            t = np.arange(0.0, DRY_RUN_S + 1.0, DRY_STEP_S)
            wanted = rng.uniform(*UTILISATIONS, len(t)) * float(rng.choice([1.0, 1.0, -1.0]))
            if rng.random() < DRY_COASTING:
                wanted[1:-1] = 0.0
            pulled = drive("utilisation", *zip(t.tolist(), wanted.tolist(), strict=True))
            axles.append(axle(lot, i, one_rail(CURVES["A"]), pulled, SPECTRA["poor"], rng))
        yield Run("dry-hours", "dry, poor track", number, scenario(w, DRY_RUN_S, v, axles), ("A",) * AXLES)
