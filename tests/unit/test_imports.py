"""The house's import rules, read from the source."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RULES = {
    "wrcd": {"sim_ecu", "scipy", "filterpy", "skfuzzy", "numba", "matplotlib", "e2e"},
    "wrcd/estimator": {"can", "cantools", "time", "logging", "datetime", "wrcd.bus", "wrcd.core", "wrcd.recorder", "wrcd.service", "wrcd.tools"},
    "wrcd/bus": {"numpy", "time", "datetime", "wrcd.estimator", "wrcd.core", "wrcd.recorder", "wrcd.service", "wrcd.tools"},
    "sim_ecu/physics": {"wrcd", "can", "cantools", "sim_ecu.play", "sim_ecu.design"},
    "sim_ecu/play/encoder.py": {"wrcd.bus"},
}


def imported(source: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{a.name}" for a in node.names)


@pytest.mark.parametrize("place", RULES)
def test_nothing_imports_what_it_must_not(place: str) -> None:
    found = ROOT / place
    sources = [found] if found.is_file() else sorted(found.rglob("*.py"))
    assert sources
    wrong = [
        f"{s.relative_to(ROOT)} imports {name}"
        for s in sources
        for name in imported(s)
        for banned in RULES[place]
        if name == banned or name.startswith(banned + ".")
    ]
    assert wrong == []


@pytest.mark.parametrize("room", ["filters", "rules"])
def test_the_reference_engine_shares_no_arithmetic_with_the_fast_one(room: str) -> None:
    names = set(imported(ROOT / f"sim_ecu/design/reference_{room}.py"))
    assert {n for n in names if n.startswith("wrcd")} == {"wrcd.estimator.design", "wrcd.estimator.design.Design"}
