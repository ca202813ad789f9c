"""The JSON schema says what the parser says, as far as a schema can: keys, types, ranges, words, what is needed."""

import copy
import json
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support import schema as made
from tests.support.json_schema import accepts
from wrcd import resources
from wrcd.bus.dbc import Database
from wrcd.config import declared, keys
from wrcd.config.config import load_config
from wrcd.core.vocabulary import MESSAGES, snake
from wrcd.errors import InputError, InputErrors
from wrcd.estimator.design import load_design

SCHEMA = json.loads(files("wrcd").joinpath("data/wrcd.schema.json").read_text(encoding="utf-8"))
DESIGN = load_design(resources.DESIGN)
NO_DBC = "there is no DBC here"
WHOLE: dict[str, Any] = {
    "bus": {"interface": "virtual", "channel": "x", "timestamps": "kernel"},
    "dbc": {"file": "a.dbc", "encoding": "cp1252"},
    "estimator": {"design": "d.json"},
    "wheelset": {"name": "multiple-unit"},
    "limits": {"min_speed_m_s": 4, "not_available_after_ms": 90.5},
    "recorder": {"folder": "f", "seconds": 30, "max_files": 3, "max_mb": 10},
    "vehicle": {
        "speed": {"signal": "B.V", "timeout_ms": 60},
        "direction": {"signal": "B.Dir", "reverse": [1, "back"]},
        "torque_is_total": True,
        "status_message": {"message": "S", "cycle_ms": 1000, "overruns": "O"},
    },
    "axle": [
        {
            "number": 1,
            "yaw_rate": {
                "signal": "A.Yaw", "sign": -1, "unit": "deg/s", "scale": 0.5, "offset": 1, "range": [-1, 1.5],
                "timeout_ms": 15, "invalid": [7], "status": "A.S", "ok": ["Ok", 1], "degraded": [2], "e2e": "P11",
                "data_id": 3,
            },
            "lateral_acceleration": {"signal": "A.Acc", "status": False},
            "torque": [{"signal": "T.M", "at": "motor", "gear_ratio": 4.5, "share": 0.5}, "T.B"],
            "axle_load": "B.L",
            "adhesion": {
                "message": "X", "e2e": "none", "validity": {"signal": "V", "valid": "Good", "error": 3},
                "mu_available": {"signal": "F", "not_available": 255, "unit": "1", "range": [0, 1]},
                "sample_age": "Age",
            },
            "detail": "D",
        }
    ],
}  # fmt: skip
VALUES: tuple[Any, ...] = (
    True, False, 0, 1, -1, 2, 9, 70_000, -5, 0.5, 3.0, 1e9, "", "x", "A.B", "A.B.C", ".", "P11", "motor", "cp1252",
    [], [1], ["x"], [1, 2], [0.5, "x"], [True], ["A.B", "C.D"], {}, {"signal": "A.B"}, {"signal": "x"},
    {"message": "x"}, {"signal": 3}, {"valid": 1}, [{}], [{"signal": "E.F"}],
)  # fmt: skip


def toml(value: Any) -> str:
    """A value as TOML writes it within a line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def parses(folder: Path, document: dict[str, Any]) -> bool:
    """Whether the parser has nothing to say of a document but that its DBC is not there."""
    path = folder / "train.toml"
    path.write_text("\n".join(f"{key} = {toml(value)}" for key, value in document.items()))

    def no_dbc(path: Path, encoding: str | None = None) -> Database:
        raise InputError(NO_DBC)

    with pytest.raises(InputError) as error:
        load_config(path, no_dbc, lambda path: DESIGN)
    found = error.value.errors if isinstance(error.value, InputErrors) else (error.value,)
    return all(NO_DBC in str(e) for e in found)


def places(document: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Every place in a document at which something stands."""
    inside = (
        document.items() if isinstance(document, dict) else enumerate(document) if isinstance(document, list) else ()
    )
    for key, value in inside:
        if (*path, key)[0] != "wheelset":  # any key of the design's, compared with it
            yield (*path, key)
            yield from places(value, (*path, key))


def changed(document: dict[str, Any], path: tuple[str | int, ...], value: Any) -> dict[str, Any]:
    """A document with another value at a place; None takes it away."""
    document = copy.deepcopy(document)
    at: Any = document
    for part in path[:-1]:
        at = at[part]
    if value is None:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return document


def beyond_a_schema(document: dict[str, Any]) -> bool:
    """Two numbers of which the second is not the greater one, a number given twice, a signal mapped twice."""
    text = json.dumps(document)
    ranges = [at(document, p) for p in places(document) if p[-1] == "range"]
    signals = [s for s in ("A.B", "E.F", "C.D") if text.count(f'"{s}"') > 1]
    return bool(signals) or any(
        isinstance(r, list) and len(r) == 2 and all(type(x) in (int, float) for x in r) and r[0] >= r[1] for r in ranges
    )


def at(document: Any, path: tuple[str | int, ...]) -> Any:
    for part in path:
        document = document[part]
    return document


def test_file_is_made_from_the_declarations() -> None:
    assert made.FILE.read_text(encoding="utf-8") == made.text(), "python -m tests.support.schema"


def test_whole_document_is_good(tmp_path: Path) -> None:
    assert accepts(SCHEMA, WHOLE)
    assert parses(tmp_path, WHOLE)


@pytest.mark.parametrize("path", list(places(WHOLE)), ids=str)
def test_value_is_refused_by_both_or_by_neither(tmp_path: Path, path: tuple[str | int, ...]) -> None:
    for value in (None, *VALUES):
        document = changed(WHOLE, path, value)
        if not beyond_a_schema(document):
            assert accepts(SCHEMA, document) == parses(tmp_path, document), (path, value)


def every_key() -> Iterator[tuple[tuple[str | int, ...], dict[str, Any], keys.Key]]:
    """The place of every declared key, a document that has it not, and the key."""
    for name, group in declared.TABLES.items():
        where: tuple[str | int, ...] = ("axle", 0) if name == "axle" else (name,)
        for key in group:
            if isinstance(key, keys.Sub) and key.tables in MESSAGES:
                outer = changed(WHOLE, (*where, key.name), {"message": "X"})
                for inner in declared.output_keys(key.tables):
                    yield (*where, key.name, inner.name), outer, inner
            yield (*where, key.name), WHOLE, key
    for quantity, table in (
        ("axle_load", "plain input"),
        ("yaw_rate", "signed input"),
        ("brake_torque", "torque input"),
    ):
        outer = changed(WHOLE, ("axle", 0, quantity), {"signal": "Q.Q"})
        for key in declared.INPUTS[table]:
            yield ("axle", 0, quantity, key.name), outer, key
    for name, field in MESSAGES["adhesion"].items():
        outer = changed(WHOLE, ("axle", 0, "adhesion", snake(name)), {"signal": "Q"})
        for key in declared.field_keys(field):
            yield ("axle", 0, "adhesion", snake(name), key.name), outer, key


@pytest.mark.parametrize(
    ("path", "document", "key"), list(every_key()), ids=lambda x: str(x) if type(x) is tuple else ""
)
def test_key_takes_the_same_ends_of_its_range(
    tmp_path: Path, path: tuple[str | int, ...], document: dict[str, Any], key: keys.Key
) -> None:
    values: list[Any] = [True, 3, "x", "A.B", 0.3, [1], {"signal": "A.B"}, {"message": "x"}]
    if isinstance(key, keys.Number | keys.Whole):
        values = [key.low, key.high, key.low - 1, key.high + 1] if abs(key.low) < 1e9 else [0, 0.0, -3, 1e9]
    elif isinstance(key, keys.Choice):
        values += key.options
    for value in values:
        one = changed(document, path, value)
        if not beyond_a_schema(one):
            assert accepts(SCHEMA, one) == parses(tmp_path, one), (path, value)


PLACES = list(places(WHOLE))


@given(
    edits=st.lists(
        st.tuples(
            st.sampled_from(PLACES), st.sampled_from((None, *VALUES)), st.sampled_from(("", "sign", "yaw_rate", "zz"))
        ),
        min_size=1,
        max_size=3,
    )
)
def test_document_with_some_changes_is_refused_by_both_or_by_neither(
    tmp_path_factory: pytest.TempPathFactory, edits: list[tuple[tuple[str | int, ...], Any, str]]
) -> None:
    document = WHOLE
    for path, value, other in edits:
        try:
            document = changed(document, (*path[:-1], other) if other and isinstance(path[-1], str) else path, value)
        except (KeyError, IndexError, TypeError):
            continue  # an earlier change has taken its place away
    if not beyond_a_schema(document) and document.get("wheelset") == WHOLE["wheelset"]:
        assert accepts(SCHEMA, document) == parses(tmp_path_factory.getbasetemp(), document)
