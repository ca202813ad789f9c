"""The configuration's JSON schema, made from the declarations by which it is parsed.

python -m tests.support.schema   writes wrcd/data/wrcd.schema.json again
"""

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from wrcd.config import declared, keys
from wrcd.config.packaged_designs import PATH, packaged_designs
from wrcd.core.configuration import MAX_AXLES
from wrcd.core.vocabulary import MESSAGES

FILE = Path(__file__).parents[2] / "wrcd" / "data" / "wrcd.schema.json"
RAW = {"type": ["integer", "string"]}


def value(key: keys.Key) -> dict[str, Any]:
    """What a key takes."""
    match key:
        case keys.Sub():
            return _sub(key)
        case keys.DesignFile():
            return {"anyOf": [{"enum": packaged_designs()}, {"type": "string", "pattern": PATH}]}
        case keys.SignalName():
            signal = {"type": "string", "pattern": keys.MESSAGE_SIGNAL}
            return {"anyOf": [signal, {"const": False}]} if key is declared.STATUS else signal
        case keys.Choice():
            return {"enum": list(key.options)}
        case keys.Number():
            if math.isinf(key.high):
                return {"type": "number", "not": {"const": 0}} if key.nonzero else {"type": "number"}
            return {"type": "number", "minimum": key.low, "maximum": key.high}
        case keys.Whole():
            return {"type": "integer", "minimum": key.low, "maximum": key.high}
        case keys.Sign():
            return {"enum": [1, -1]}
        case keys.Flag():
            return {"type": "boolean"}
        case keys.Interval():
            return {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
        case keys.RawValue():
            return dict(RAW)
        case keys.RawValues():
            return {"type": "array", "items": RAW, "minItems": 1}
        case _:
            return {"type": "string"}


def described(key: keys.Key) -> dict[str, Any]:
    """The same, with what it means and its default."""
    shown = {} if key.default is None or isinstance(key, keys.Sub) else {"default": key.default}
    return {"description": key.what, **value(key), **shown}


def table(declarations: Iterable[keys.Key]) -> dict[str, Any]:
    """A table of some keys, and of no others."""
    every = tuple(declarations)
    needed = [k.name for k in every if k.needed]
    out = {"type": "object", "additionalProperties": False, "properties": {k.name: described(k) for k in every}}
    return {**out, "required": needed} if needed else out


def _sub(key: keys.Sub) -> dict[str, Any]:
    inner = {"$ref": f"#/$defs/{key.tables}"}
    text = {"type": "string", "pattern": keys.MESSAGE_SIGNAL} if key.tables in declared.INPUTS else {"type": "string"}
    one = [text, inner]
    several = [{"type": "array", "items": {"anyOf": one}, "minItems": 1}] if key.several else []
    return {"anyOf": [*one, *several]}


def _torque() -> dict[str, Any]:
    """The gear ratio is of a torque at the motor."""
    at, ratio = declared.AT.name, declared.GEAR_RATIO.name
    motor = {"properties": {at: {"const": "motor"}}, "required": [at]}
    return {"if": motor, "then": {"required": [ratio]}, "else": {"not": {"required": [ratio]}}}


def _input(name: str) -> dict[str, Any]:
    """What stands beside a status is of it; one that does not count has none."""
    status = {"properties": {"status": {"type": "string"}}, "required": ["status"]}
    alone = [{"not": {"required": [key.name]}} for key in (declared.OK, declared.DEGRADED, declared.STATUS_TIMEOUT)]
    more = [{"if": status, "else": {"allOf": alone}}]
    if name == "torque input":
        more.append(_torque())
    return {**table(declared.INPUTS[name]), "allOf": more}


def _has(of: str, key: str) -> dict[str, Any]:
    return {"required": [of], "properties": {of: {"required": [key]}}}


def schema() -> dict[str, Any]:
    """The whole schema."""
    defs = {name: _input(name) for name in declared.INPUTS}
    for kind, fields in MESSAGES.items():
        defs[kind] = table(declared.output_keys(kind))
        for name, carried in fields.items():
            defs[f"{kind}.{name}"] = table(declared.field_keys(carried))
    tables = {name: table(ks) for name, ks in declared.TABLES.items()}
    axles = {"type": "array", "items": tables.pop("axle"), "minItems": 1, "maxItems": MAX_AXLES}
    wheelset = {"type": "object", "description": "any key of the design's wheelset, to be compared with it"}
    speed = [_has("vehicle", "speed"), _has("limits", declared.CONSTANT_SPEED.name)]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Configuration of wrcd",
        "description": "What a TOML file for `wrcd --config` may say. Names are looked up in the DBC by `wrcd check`.",
        "type": "object",
        "additionalProperties": False,
        "properties": {**tables, "axle": axles, "wheelset": wheelset},
        "required": ["axle"],
        "oneOf": speed,
        "if": _has("dbc", declared.DBC_FILE.name),
        "then": {
            "anyOf": [
                {"required": ["wheelset"], "properties": {"wheelset": {"minProperties": 1}}},
                _has("estimator", declared.DESIGN.name),
            ]
        },
        "$defs": defs,
    }


def text() -> str:
    """As it stands in the file."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
