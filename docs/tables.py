"""Tables for the site: what `{keys} FILE TABLE` in a page becomes, from the declarations that the program reads its
files by, and `{signals} MESSAGE`, from the DBCs."""

import functools
import re
from collections.abc import Iterator, Sequence

from sim_ecu.loop import drive_scenario
from sim_ecu.play import scenario_keys
from sim_ecu.resources import TRUTH_DBC
from wrcd.bus.dbc import Message, Signal, load_dbc
from wrcd.config.keys import Choice, Flag, Interval, Key, Number, Whole
from wrcd.resources import DBC

_PLAYED = {**scenario_keys.TABLES, "axle.N": (scenario_keys.POSITION,)}  # the others are as at the top level
# By file and table; of a scenario to drive, what one to play has not.
TABLES: dict[str, list[Key]] = {f"scenario {table}".strip(): [*keys] for table, keys in _PLAYED.items()}
for _table, _driven in drive_scenario.TABLES.items():
    if _table != "axle.N":
        TABLES[f"drive {_table}".strip()] = [key for key in _driven if key not in _PLAYED.get(_table, ())]
MARK = re.compile(r"^```\{(keys|signals)\} ([\w. ]+)\n```$", re.MULTILINE)
OF_EVERY_MESSAGE = ("Crc", "Counter", "Status")
LARGE = 1e9  # an end so far off says nothing


def with_tables(page: str) -> str:
    """Return a page's text with its tables. Raises KeyError for one that there is not."""
    return MARK.sub(lambda mark: "\n".join(_keys(TABLES[mark[2]]) if mark[1] == "keys" else _signals(mark[2])), page)


def takes(key: Key) -> str:
    """Return what a key takes, in words; nothing where its text says it."""
    if isinstance(key, Choice):
        return ", ".join(sorted(key.options) if key is scenario_keys.CURVE else key.options)
    if isinstance(key, (Number, Whole, scenario_keys.Over)):
        from_low = "above 0" if 0.0 < key.low <= 1.0 / LARGE else f"from {key.low:g}"
        ends = from_low if key.high >= LARGE else f"{key.low:g} … {key.high:g}"
        return f"{ends} {getattr(key, 'unit', '')}".strip() + " ⁺" * isinstance(key, scenario_keys.Over)
    return "true, false" if isinstance(key, Flag) else "[low, high]" if isinstance(key, Interval) else ""


def _keys(keys: Sequence[Key]) -> Iterator[str]:
    yield "| key | takes | default | what |"
    yield "|---|---|---|---|"
    for key in keys:
        yield f"| `{key.name}` | {takes(key)} | {key.shown_default} | {key.what} |"


@functools.cache
def _messages() -> dict[str, Message]:
    return {m.name: m for file in (DBC, TRUTH_DBC) for m in load_dbc(file).messages}


def _signals(message: str) -> Iterator[str]:
    found = _messages()[message]
    yield from (f"**{message.removesuffix('_A1')}**", "")
    yield "| signal | step, range | what | values |"
    yield "|---|---|---|---|"
    for s in found.signals:
        if s.name not in OF_EVERY_MESSAGE:
            values = ", ".join(f"{raw} {word}" for raw, word in sorted((s.choices or {}).items()))
            what = str(s.comment or "").replace("|", "\\|")
            yield f"| {s.name} | {_range(s)} | {what} | {values} |"


def _range(s: Signal) -> str:
    """The step with its unit, and the range; nothing where all values have words."""
    low, high = float(s.minimum or 0.0), float(s.maximum or 0.0)
    if s.scale == 1 and len(s.choices or {}) > high - low:
        return ""
    ends = f"± {high:.10g}" if low == -high else f"{low:.10g} … {high:.10g}"
    unit = (s.unit or "").removeprefix("1").replace("*", "·").replace("^2", "²")
    return ends if s.scale == 1 and not unit else f"{float(s.scale):.10g} {unit}".strip() + f", {ends}"
