"""What stands in C and in Python has one value."""

import re
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.support.processes import ROOT
from wrcd.core import configuration
from wrcd.estimator import answer, design, estimator
from wrcd.estimator.design_members import LIMITS
from wrcd.estimator.paper import bank, fuzzy, rule_inputs, window
from wrcd.estimator.records import EstimateDoubt
from wrcd.estimator.signals import gate, joints, noise
from wrcd.estimator.trust import changes, health, interval, memory, pair

FOLDER = ROOT / "wrcd/estimator/c"
# Of each file with constants: the modules that have them, under the same names
TWINS: dict[str, tuple[ModuleType, ...]] = {
    "wrcd_estimator.h": (design, configuration, window),
    "parts.h": (design, health, window),
    "answer.c": (answer, memory, changes, interval, rule_inputs, fuzzy),
    "bank.c": (bank,),
    "estimator.c": (estimator, joints),
    "pair.c": (pair, health, design),
    "rules.c": (fuzzy,),
    "signals.c": (gate, joints, noise),
    "window.c": (window,),
}
PARTS = {"GATE": gate, "JOINTS": joints, "NOISE": noise}  # whose names have that before them in C
# under another name, or in another form
RENAMED: dict[str, Any] = {
    "REGIMES": len(design.REGIMES), "BLOCK_TICKS": window.BLOCK_TICKS, "HOLD": joints.HOLD_TICKS,
    "SUMS": window.COLUMNS, "BANDS": pair.BANDS, "PAIR_OUTPUTS": pair.BANDS + 1,
    "PAIR_STATES": len(design.PAIR_STATES), "PAIR_ROWS": health.ROWS, "PAIR_SPANS": max(health.SPANS),
    "REMEMBERED": len(memory.Remembered._fields), "REMEMBER_TICKS": memory.STEP_TICKS,
    "LOOK_TICKS": health.SPAN_TICKS, "OUTPUTS": pair.BANDS + 1, "STATES": len(design.PAIR_STATES),
    "LEAST_RATIO": health.MIN_RATIO, "MAX_BOGIES": configuration.MAX_AXLES // 2, "W": design.MODELS * design.CHANNELS,
    **{field.upper(): k for k, field in enumerate(memory.Remembered._fields)},
    **{doubt.name: int(doubt) for doubt in EstimateDoubt}, "NO_DOUBT": 0,
}  # fmt: skip
# room in C's memory, bits of its answers, places in a span's row
ONLY_C = {
    "ABI", "MAX_SECTIONS", "MAX_SETS", "MAX_POLYNOMIAL", "MAX_HIDDEN", "PAIR_FILTER", "OUTLIERS", "NEEDS_RESET", "PI",
    "PLACES", "POWER", "CROSS_POWER", "FINE", "VARIANCE", "OF_PARTNER", "PARTNER", "GIVEN", "S", "SAID",
}  # fmt: skip


def constants(text: str, known: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """The named constants of a C source, of which some are known; enumerations among them."""
    text = re.sub(r"/\*.*?\*/|//[^\n]*", "", text, flags=re.DOTALL)
    for enumeration, definitions in re.findall(r"\benum(?: \w+)? \{([^}]*)\}|\bconst (?:double|int) ([^;]*);", text):
        before = -1
        for part in filter(None, map(str.strip, split(enumeration or definitions))):
            name, _, value = map(str.strip, part.partition("="))
            declared = value or enumeration
            if declared and re.fullmatch(r"[A-Z][A-Z0-9_]*(\[\w+\])*", name):
                said = (
                    value.replace("{", "[")
                    .replace("}", "]")
                    .replace(" / 2", " // 2" if " / 2" in value and "." not in value else " / 2")
                )
                before = eval(said, {}, known) if value else before + 1
                bare = re.sub(r"\[.*|^WRCD_", "", name)
                known |= {name.partition("[")[0]: before, bare: before}
                yield bare, before


def split(body: str) -> Iterator[str]:
    """At the commas that are in no braces."""
    depth, begin = 0, 0
    for k, sign in enumerate(body):
        depth += (sign == "{") - (sign == "}")
        if sign == "," and not depth:
            yield body[begin:k]
            begin = k + 1
    yield body[begin:]


def shared() -> dict[str, Any]:
    """What the headers say."""
    known: dict[str, Any] = {}
    for name in ("wrcd_estimator.h", "parts.h"):
        dict(constants((FOLDER / name).read_text(), known))
    return known


def twin(file: str, name: str) -> Any:
    """Python's value of a constant of C."""
    if name in RENAMED:
        return RENAMED[name]
    part, _, rest = name.partition("_")
    if part in PARTS and hasattr(PARTS[part], rest):
        return getattr(PARTS[part], rest)
    for module in TWINS[file]:
        if hasattr(module, name):
            return getattr(module, name)
    raise AssertionError(f"{file} has {name}, and Python none")


@pytest.mark.parametrize("file", sorted(TWINS))
def test_named_constants_of_c_are_those_of_python(file: str) -> None:
    found = dict(constants((FOLDER / file).read_text(), shared()))
    differ = {}
    for name, ours in found.items():
        if name in ONLY_C:
            continue
        theirs = twin(file, name)
        theirs = theirs.start if isinstance(theirs, slice) else theirs
        theirs = len(theirs) if isinstance(ours, int) and isinstance(theirs, tuple) else theirs
        if not np.array_equal(np.ravel(np.asarray(ours, float)), np.ravel(np.asarray(theirs, float))):
            differ[name] = ours, theirs
    assert differ == {}
    assert found


def test_limits_of_a_design_are_those_of_the_header() -> None:
    known = shared()
    of_c = {"states": "STATES", "rules": "RULES", "powers": "POLYNOMIAL", "sets": "SETS", "hidden_units": "HIDDEN"}
    assert {name: known[f"MAX_{of_c.get(name, 'SECTIONS')}"] for name in LIMITS} == LIMITS


def test_every_source_is_looked_at() -> None:
    with_constants = {p.name for p in FOLDER.iterdir() if dict(constants(p.read_text(), shared()))}
    assert with_constants == set(TWINS)
