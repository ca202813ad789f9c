"""Rules of a design as sentences: for `wrcd why`, report, replay --explain and `sim-ecu design --explain`."""

import math
from dataclasses import dataclass

import numpy as np

from wrcd.core.design import Design
from wrcd.core.design_members import BANDS_HZ
from wrcd.core.terms import LAG, MODELS


@dataclass(frozen=True, slots=True)
class Column:
    """One of what the rules' outputs move with."""

    name: str
    correlation: bool = False


CHANNEL_WORDS = YAW, LAT = "yaw rate", "lateral acceleration"
ACROSS = (YAW, YAW), (LAT, LAT), (YAW, LAT), (LAT, YAW)  # of own signals and the partner's
BAND_WORDS = tuple(f"{low:g} to {high:g} Hz" for low, high in BANDS_HZ)
COLUMN_WORDS = (
    *(Column(f"residual {m + 1}") for m in range(MODELS)),
    Column("torque"),
    Column("speed"),
    *(Column(f"{what} persistence {m + 1}", True) for m in range(MODELS) for what in CHANNEL_WORDS),
    *(Column(f"coupling {m + 1}", True) for m in range(MODELS)),
    Column("window length"),
    *(Column(f"{what} noise") for what in CHANNEL_WORDS),
    Column("the highest torque of half a second over that of the moment"),
    Column("the torque of the moment over the lowest of half a second"),
    Column("the step of residuals 1 and 2"),
    Column("the step of residual 3"),
    Column("the step of residual 4"),
    Column("the largest step, up or down"),
    *(Column(f"the power of {what} in {band}") for band in BAND_WORDS for what in CHANNEL_WORDS),
    *(Column(f"{YAW} with {LAT} in {band}", True) for band in BAND_WORDS),
    *(
        Column(f"{own} with the {their} of the axle {way} in {band}", True)
        for way in ("ahead", "behind")
        for own, their in ACROSS
        for band in BAND_WORDS
    ),
)
GLOSSARY = (
    f"persistence m: correlation of model m's innovation with itself {LAG} ticks before. Near 1 it is slow: "
    "the model misses a slow motion, such as hunting. Near 0 or below it is fast: the model misses the yaw spring.",
    "coupling m: correlation of model m's two innovations. Away from 0, yaw and lateral motion that the track drives "
    "together are missed together: the model's contact is not the present one.",
    "with: correlation over the window of two signals in a band, the other axle's a wheelbase apart. What the track "
    "drives, both axles of a bogie show; what shakes one axle box, it alone.",
    "step: a residual of the newest part over that of the half second before, unfiltered. A drop of adhesion makes one "
    "and stays; a slip cycle comes back.",
)

CORRECTED = ", the output corrected by "
MIN_SHARE = 0.15  # slopes smaller than this share of a rule's largest are left out of its sentence


def condition(design: Design, rule: int) -> str:
    """When a rule (from 0) speaks: "residual 1 Low, …, torque T_3, Fast"."""
    names = [s.names[k] for s, k in zip(design.sets, design.rules[rule], strict=True)]
    parts = [*(f"residual {m + 1} {names[m]}" for m in range(MODELS)), f"torque {names[MODELS]}"]
    return ", ".join(parts if len(design.speed_sets.names) == 1 else [*parts, names[MODELS + 1]])


def says(design: Design, rule: int) -> str:
    """What it says: adhesion and output in the middle of its sets, and what corrects the output."""
    base = float(design.bases[rule])
    mu = float(np.clip(np.polyval(design.polynomial, np.clip(base, 0.0, 100.0)), *design.adhesion_range_pct))
    if design.consequents:
        return f"{design.consequents[rule]} (output {base:.0f}, adhesion {mu:.1f} %)"
    slopes = design.slopes[rule]
    # per doubling, which a person can picture, not per decade; of a correlation per 0.1
    steps = np.array([0.1 if c.correlation else math.log10(2.0) for c in COLUMN_WORDS])
    moves = [
        f"{move:+.0f} per {'0.1' if c.correlation else 'doubling'} of {c.name}"
        for move, c in zip(slopes * steps, COLUMN_WORDS, strict=True)
        if abs(move) >= MIN_SHARE * np.abs(slopes * steps).max(initial=0.0) and abs(move) >= 0.5
    ]
    return f"adhesion {mu:.1f} % (output {base:.0f})" + (f"{CORRECTED}{', '.join(moves)}" if moves else "")


def sentence(design: Design, rule: int) -> str:
    """A rule as a sentence."""
    return f"If {condition(design, rule)}, then {says(design, rule)}."


def bounds(design: Design) -> list[str]:
    """What the names of the sets mean: the middle of each in the input's own unit."""
    if design.form == "paper":
        residuals = [(f"residual {m + 1}, in the sensors' noise", s) for m, s in enumerate(design.residual_sets)]
    else:
        residuals = [(f"residual {m + 1}, over residual {MODELS}", s) for m, s in enumerate(design.residual_sets[:-1])]
        residuals.append((f"residual {MODELS}, times what model {MODELS} expects", design.residual_sets[-1]))
    inputs = [*residuals, ("torque, as adhesion in use, %", design.torque_sets)]
    if len(design.speed_sets.names) > 1:
        inputs.append(("speed, m/s", design.speed_sets))
    lines = []
    for what, sets in inputs:
        unit = 100.0 if sets is design.torque_sets else 1.0
        parts = ", ".join(f"{n} about {unit * 10**c:.3g}" for n, c in zip(sets.names, sets.centres, strict=True))
        lines.append(f"{what}: {parts}")
    return lines


def model_words(design: Design, winner: int) -> str:
    """A winning model in words, "" for none."""
    return design.model_names[winner - 1] if 1 <= winner <= len(design.model_names) else ""


def rule_words(design: Design, rule: int) -> str:
    """A rule by its number as a sentence, "" for none."""
    return sentence(design, rule - 1) if 1 <= rule <= len(design.rules) else ""
