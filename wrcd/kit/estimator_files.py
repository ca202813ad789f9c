"""`wrcd kit --estimator`: the estimator in C with a design as its table, and what it makes of a track."""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np

import wrcd.core
from wrcd import __version__
from wrcd.core.design import FORMAT, Design
from wrcd.core.design_members import members
from wrcd.core.estimator import Estimator, step_through
from wrcd.core.records import Estimate
from wrcd.core.terms import COLUMNS, INPUTS, MODELS, PAIR_FEATURES, PairState
from wrcd.kit.design_table import DesignTable
from wrcd.kit.files import filled, headed
from wrcd.kit.golden_track import TICKS, shown, track

_SOURCES = Path(wrcd.core.__file__).parent / "c"
SOURCES = (
    "wrcd_estimator.h", "parts.h", "signals.c", "bank.c", "residuals.c", "rules.c", "memory.c", "interval.c",
    "health.c", "estimator.c",
)  # fmt: skip
MADE = ("design.h", "design.c", "vectors.h", "test_estimator.c", "example.c", "Makefile", "README.md")
EVERY = 25  # ticks from one estimate of the vectors to the next


def name_of(design: Design) -> str:
    """A design's name as it can stand in a comment and a string of C."""
    return re.sub(r"[^\w.+ -]", "_", design.name, flags=re.ASCII)


def files_of(design: Design, axles: int) -> dict[str, bytes]:
    """Every file's bytes by its name. The same design gives the same bytes."""
    of = members(design)
    table = DesignTable(of)
    values = {
        "VERSION": __version__,
        "NAME": name_of(design),
        "FORMAT": FORMAT,
        "CHECKSUM": design.checksum,
        "AXLES": str(axles),
        "TICK_S": repr(design.tick_s),
        "TORQUE_NM": repr(2.0 * design.normal_N * design.r_0),
        "LONGEST": str(of["longest"]),
        "WHEELBASE_TICKS": str(of["longest_wheelbase_ticks"]),
        "ARRAY_BYTES": str(table.array_bytes),
        "TABLE": table.text,
        "OBJECTS": " ".join(name.replace(".c", ".o") for name in SOURCES if name.endswith(".c")),
        **operations(design, axles),
        **_vectors(design, axles),
    }
    # a state has room for as many axles as there are
    room = f"WRCD_MAX_AXLES = {axles},"
    bodies = {name: (_SOURCES / name).read_text().replace("WRCD_MAX_AXLES = 8,", room) for name in SOURCES}
    bodies |= {name: filled(f"estimator/{name}", values) for name in MADE}
    of_what = f"{name_of(design)} {FORMAT} {design.checksum}"
    return {name: headed(name, body, "design", of_what) for name, body in bodies.items()}


def operations(design: Design, axles: int) -> Mapping[str, str]:
    """Count multiply-adds by the design's dimensions, roughly: of a usual tick, and of one with all that may come.

    That is: samples left out, new matrices, the rules asked for the memory and an estimate, the pairs judged.
    """
    s, rules = design.states, len(design.rules)
    bank = MODELS * (s + 2) * (s + 4)
    filters = 5 * (8 * len(design.lowpass) + len(design.highpass)) + 8 * 6 + 60  # and the gate, the window's sums
    pair = 2 * 3 * 5 + 2 * 3 * 16 // 2
    # the window's sums, the rules, of which two sets of each input hold at once, and what those say
    asked = 9 * 60 + INPUTS * rules + 2**INPUTS * 2 * (COLUMNS + 1) + 2 * COLUMNS
    hidden = 0 if design.health is None else len(design.health.hidden_bias)
    matrices = 2 * MODELS * (2 * (s * s + 4 * s + 4) + 4 * (s + 2))
    usual = bank + axles * (bank + filters + (pair if hidden else 0))
    most = usual + matrices + axles * (bank + 2 * 2 * asked + (PAIR_FEATURES + len(PairState)) * hidden)
    return {"USUAL": f"{math.ceil(usual / 100)}00", "MOST": f"{math.ceil(most / 100)}00"}


def _vectors(design: Design, axles: int) -> dict[str, str]:
    """The track, and what the estimator says after every EVERY ticks and of the pairs at the end."""
    ticks, estimator = track(design, axles), Estimator(design, axles)
    stops = range(EVERY - 1, TICKS, EVERY)
    said = [_rows(estimator.estimate()) for _ in step_through(estimator, ticks, stops[:-1], resets=True)]
    return {
        "TICKS": str(TICKS),
        "ESTIMATES": str(len(said)),
        "EVERY": str(EVERY),
        "FIRST_TICK": str(ticks.number),
        "Z": _lines(shown(z) for z in ticks.z),
        "RATIOS": _lines(map(shown, ticks.torque_ratio)),
        "SPEEDS": _lines(f"{v:.12g}" for v in ticks.speeds_m_s),
        "SAID": _lines("{" + ",\n     ".join(rows) + "}" for rows in said),
        "LOG_ODDS": _lines(map(shown, estimator.health.log_odds)),
        "OUTLIERS": str(estimator.outliers),
    }


def _rows(estimate: Estimate) -> list[str]:
    """An estimate as C has it, by axle."""
    columns = {f.name: np.asarray(getattr(estimate, f.name), dtype=np.float64) for f in fields(estimate)}
    return [
        "{" + ", ".join(f".{name} = {shown(column[axle])}" for name, column in columns.items()) + "}"
        for axle in range(len(estimate.fuzzy))
    ]


def _lines(rows: Iterable[str]) -> str:
    return ",\n".join(f"    {row}" for row in rows)
