"""What a JSON schema says of a value: the keywords that ours uses, and no others. TOML tells 1 from 1.0 and true."""

import re
from collections.abc import Callable
from typing import Any

_TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,), "array": (list,), "string": (str,), "boolean": (bool,), "integer": (int,),
    "number": (int, float),
}  # fmt: skip
ANNOTATIONS = {"$schema", "$defs", "title", "description", "default"}


def accepts(schema: dict[str, Any], value: Any, root: dict[str, Any] | None = None) -> bool:
    """Whether a value is one that the schema allows. Raises KeyError for a keyword that is not known here."""
    root = schema if root is None else root

    def holds(s: dict[str, Any]) -> bool:
        return accepts(s, value, root)

    for keyword, argument in schema.items():
        if keyword in ANNOTATIONS or keyword in ("then", "else"):
            continue
        if keyword == "$ref":
            if not holds(root["$defs"][argument.removeprefix("#/$defs/")]):
                return False
        elif keyword in ("anyOf", "oneOf", "allOf"):
            held = [holds(s) for s in argument]
            if not {"anyOf": any(held), "allOf": all(held), "oneOf": held.count(True) == 1}[keyword]:
                return False
        elif keyword == "not":
            if holds(argument):
                return False
        elif keyword == "if":
            if not holds(schema.get("then" if holds(argument) else "else", {})):
                return False
        elif not _plain(keyword, argument, value, schema, root):
            return False
    return True


def _same(a: Any, b: Any) -> bool:
    return type(a) is type(b) and a == b


def _plain(keyword: str, argument: Any, value: Any, schema: dict[str, Any], root: dict[str, Any]) -> bool:
    if keyword == "type":
        kinds = argument if isinstance(argument, list) else [argument]
        return any(type(value) in _TYPES[kind] for kind in kinds)
    if keyword == "enum":
        return any(_same(value, x) for x in argument)
    if keyword == "const":
        return _same(value, argument) or (argument == 0 and type(value) is float and value == 0)
    # the others say something of one type only
    of, check = _KEYWORDS[keyword]
    return type(value) not in of or check(argument, value, schema, root)


def _properties(argument: Any, value: Any, schema: dict[str, Any], root: dict[str, Any]) -> bool:
    return all(accepts(s, value[key], root) for key, s in argument.items() if key in value)


def _no_others(argument: Any, value: Any, schema: dict[str, Any], root: dict[str, Any]) -> bool:
    assert argument is False
    return set(value) <= set(schema["properties"])


_NUMBER = (int, float)
_KEYWORDS: dict[str, tuple[tuple[type, ...], Callable[[Any, Any, dict[str, Any], dict[str, Any]], bool]]] = {
    "properties": ((dict,), _properties),
    "additionalProperties": ((dict,), _no_others),
    "required": ((dict,), lambda a, v, s, r: set(a) <= set(v)),
    "minProperties": ((dict,), lambda a, v, s, r: len(v) >= a),
    "minimum": (_NUMBER, lambda a, v, s, r: v >= a),
    "maximum": (_NUMBER, lambda a, v, s, r: v <= a),
    "pattern": ((str,), lambda a, v, s, r: re.search(a, v) is not None),
    "items": ((list,), lambda a, v, s, r: all(accepts(a, x, r) for x in v)),
    "minItems": ((list,), lambda a, v, s, r: len(v) >= a),
    "maxItems": ((list,), lambda a, v, s, r: len(v) <= a),
}
