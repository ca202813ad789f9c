"""Rules and moments in words."""

import math

import numpy as np

from wrcd.estimator.design import MODELS, Design

LEAST_SHARE = 0.15  # slopes smaller than this share of a rule's largest are left out of its sentence


def condition(design: Design, rule: int) -> str:
    """When a rule (from 0) speaks: "residual 1 Low, …, torque T_3, Fast"."""
    names = [s.names[k] for s, k in zip(design.sets, design.rules[rule], strict=True)]
    residuals = ", ".join(f"residual {m + 1} {names[m]}" for m in range(MODELS))
    return f"{residuals}, torque {names[MODELS]}, {names[MODELS + 1]}"


def says(design: Design, rule: int) -> str:
    """What it says: the output in the middle of its sets with the adhesion it stands for, and what moves it."""
    base = float(design.bases[rule])
    mu = float(np.clip(np.polyval(design.polynomial, np.clip(base, 0.0, 100.0)), *design.adhesion_range_pct))
    slopes = design.slopes[rule]
    inputs = [*(f"residual {m + 1}" for m in range(MODELS)), "torque", "speed"]
    # per doubling, which a person can picture, not per decade
    moves = [
        f"{s * math.log10(2.0):+.0f} per doubling of {name}"
        for s, name in zip(slopes, inputs, strict=True)
        if abs(s) >= LEAST_SHARE * np.abs(slopes).max(initial=0.0) and abs(s) * math.log10(2.0) >= 0.5
    ]
    return f"output {base:.0f} (adhesion {mu:.1f} %)" + (f"; {', '.join(moves)}" if moves else "")


def sentence(design: Design, rule: int) -> str:
    """A rule as a sentence."""
    return f"If {condition(design, rule)}, then {says(design, rule)}."


def bounds(design: Design) -> list[str]:
    """What the names of the sets mean: the middle of each in the input's own unit."""
    inputs = [
        *((f"residual {m + 1}, over residual {MODELS}", design.residual_sets[m]) for m in range(MODELS - 1)),
        (f"residual {MODELS}, times what model {MODELS} expects", design.residual_sets[MODELS - 1]),
        ("torque, as adhesion in use, %", design.torque_sets),
        ("speed, m/s", design.speed_sets),
    ]
    lines = []
    for what, sets in inputs:
        unit = 100.0 if sets is design.torque_sets else 1.0
        parts = ", ".join(f"{n} about {unit * 10**c:.3g}" for n, c in zip(sets.names, sets.centres, strict=True))
        lines.append(f"{what}: {parts}")
    return lines
