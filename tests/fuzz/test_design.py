"""Whatever a design file holds, it is refused with an InputError or nothing that is not finite comes out as Valid."""

import copy
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz.strategies import mutated
from tests.support.sensor_simulator import SensorSimulator
from wrcd import resources
from wrcd.checksum import checksum
from wrcd.config.config import load_config
from wrcd.core.causes import Validity
from wrcd.core.design import load_design, parse_design
from wrcd.errors import InputError

CONFIG = load_config(None)
# Elements that a window may have here: the arithmetic of a longer one is the same and takes seconds.
MAX_TICKS = 2_000


def small() -> dict[str, Any]:
    """The packaged design at three speeds about 25 m/s with short windows: the same file, sooner read and warm."""
    document: dict[str, Any] = json.loads(resources.DESIGN.read_text())
    bank = document["bank"]
    near = int(np.argmin(np.abs(np.array(bank["speeds_m_s"]) - 25.0)))
    for key in ("speeds_m_s", "Phi", "K", "H", "noise_power", "whiten"):
        bank[key] = bank[key][near - 1 : near + 2]
    return document | {"window_s": 0.25, "recent_s": 0.05, "longest_s": 0.3}


SMALL = small()


def paths(node: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Where something can be changed: every table and value, of long lists the first entries and the last."""
    if path:
        yield path
    if isinstance(node, dict):
        for key, value in node.items():
            yield from paths(value, (*path, key))
    elif isinstance(node, list):
        for i in sorted({0, 1, len(node) - 1} & set(range(len(node)))):
            yield from paths(node[i], (*path, i))


PATHS = [p for p in paths(SMALL) if p[0] not in ("versions", "fit", "checksum")]
VALUES: st.SearchStrategy[Any] = (
    st.floats()
    | st.integers(-10, 300)
    | st.sampled_from(
        (0, -1, 1e-300, 1e300, 10**400, -(10**400), None, True, "", "1.5", [], {}, [[]], [1.0], {"name": []})
    )
    | st.text(max_size=3)
)


FACTORS = (-1.0, 0.0, 1e-6, 0.5, 2.0, 10.0, 1e6, 1e150)
Change = tuple[tuple[str | int, ...], str, Any]  # where, what is done, with what
CHANGES: st.SearchStrategy[list[Change]] = st.lists(
    st.tuples(st.sampled_from(PATHS), st.just("scale"), st.sampled_from(FACTORS))
    | st.tuples(st.sampled_from(PATHS), st.just("set"), VALUES)
    | st.tuples(st.sampled_from(PATHS), st.just("drop"), st.none()),
    min_size=1,
    max_size=3,
)


def changed(changes: list[Change]) -> dict[str, Any]:
    """The small design after some changes. Where an earlier one has taken its place away, a change does nothing."""
    out = copy.deepcopy(SMALL)
    for (*way, last), kind, value in changes:
        node: Any = out
        try:
            for step in way:
                node = node[step]
            if kind == "drop":
                del node[last]
            else:
                node[last] = node[last] * value if kind == "scale" else value
        except (KeyError, IndexError, TypeError):
            continue
    return out


def judge(document: Any, file: Path) -> None:
    """Refuse it, or run a core with it: one axle's good frames for a window and a half."""
    try:
        design = parse_design(document, file)
    except InputError:
        return
    if design.window_ticks > MAX_TICKS:
        return
    sim = SensorSimulator(replace(CONFIG, design=design))
    # a matrix of absurd numbers overflows; the daemon goes on then, and so must this
    with np.errstate(all="ignore"):
        for _ in range(min(3 + math.ceil(1.5 * design.window_s / 0.005), 400)):
            sim.run(5)
            for report in sim.core.reports:
                numbers = (report.mu_available_pct, report.mu_used_pct)
                assert all(x is None or (math.isfinite(x) and 0 <= x <= 100) for x in numbers)
                if report.validity is Validity.VALID:
                    assert report.mu_available_pct is not None
                    assert report.confidence != "None"


def test_small_design_is_valid() -> None:
    document = SMALL | {"checksum": checksum(SMALL)}
    sim = SensorSimulator(replace(CONFIG, design=parse_design(document, "small")))
    validities = [f["Validity"] for f in sim.run(600)]
    after = validities[validities.index("Valid") :]
    assert len(after) >= 15
    assert after.count("Valid") == len(after)


@given(changes=CHANGES, right=st.integers(0, 9))
def test_changed_design_works_or_is_rejected(changes: list[Change], right: int) -> None:
    document = changed(changes)
    if right:  # most would never be looked at otherwise
        try:
            document["checksum"] = checksum(document)
        except (ValueError, RecursionError):
            return
    judge(document, Path("design.json"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("design")


TEXT = json.dumps({"format": SMALL["format"], "name": "x", "bank": {"tick_s": 0.005, "models": [1, 2.5, "a", None]}})


@given(text=mutated(TEXT), right=st.booleans())
def test_mutated_design_file_is_rejected(folder: Path, text: str, right: bool) -> None:
    try:
        document = json.loads(text)
        if right and isinstance(document, dict):
            text = json.dumps(document | {"checksum": checksum(document)})
    except (ValueError, RecursionError):
        pass
    (folder / "design.json").write_text(text, "utf-8", "surrogatepass")
    with pytest.raises(InputError):
        load_design(folder / "design.json")


@given(content=st.binary(max_size=100))
def test_arbitrary_design_file_is_rejected(folder: Path, content: bytes) -> None:
    (folder / "design.json").write_bytes(content)
    with pytest.raises(InputError):
        load_design(folder / "design.json")
