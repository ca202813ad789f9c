"""All of lint over one DBC, for a person or as JSON."""

import json
import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.bus.units import Quantity
from wrcd.core.design import Design, load_design
from wrcd.dbc.dbc_lines import read
from wrcd.dbc.lint.codes import CODES, Flaw
from wrcd.dbc.lint.input_checks import check_inputs
from wrcd.dbc.lint.message_checks import check_layout, check_protection, check_times, check_values
from wrcd.dbc.recognition import candidates
from wrcd.errors import InputError

INPUTS = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE, Quantity.SPEED, Quantity.BRAKE_TORQUE)


def findings(path: Path, design: Design | None = None) -> list[Flaw]:
    """Return what there is to find, in the file's order. Raises InputError for a file that cannot be read.

    design: by which resolution, range and cycle are judged; without it the default one.
    """
    dbc = read(path)
    refused: list[Flaw] = []
    try:
        load_dbc(path)
    except InputError as e:
        if not dbc.messages:
            raise
        named = re.search(r"\bline (\d+)", e.reason)  # in cantools' own words
        refused = [Flaw(e.line or (int(named[1]) if named else 1), "not-loadable", path.name, e.reason)]
    design = design or load_design(resources.DESIGN)
    likely = [c for c in candidates(dbc) if c.quantity in INPUTS]
    found = [
        *refused,
        *check_layout(dbc),
        *check_values(dbc),
        *check_times(dbc, likely),
        *check_protection(dbc, likely),
        *check_inputs(dbc, likely, design),
    ]
    return sorted(found, key=lambda f: (f.line, list(CODES).index(f.code), f.subject))


def lint(path: Path, as_json: bool = False) -> int:
    """Print the findings; 1 if there are any, else 0."""
    found = findings(path)
    print(
        json.dumps(as_records(path, found), indent=2, ensure_ascii=False) if as_json else "\n".join(lines(path, found))
    )
    return 1 if found else 0


def lines(path: Path, found: Sequence[Flaw]) -> list[str]:
    """Findings for a person: each with its reason and remedy where its code comes first, and the count."""
    out: list[str] = []
    explained: set[str] = set()
    for f in found:
        out.append(f"{path}:{f.line}: {f.code}: {f.subject}: {f.what}")
        if f.code not in explained:
            out += [f"    {CODES[f.code].why}", f"    {CODES[f.code].mend}"]
        explained.add(f.code)
    kinds = f" of {len(explained)} kinds" if len(explained) > 1 else ""
    return [
        *out,
        f"{path}: {len(found)} finding{'s' * (len(found) != 1)}{kinds}" if found else f"{path}: nothing found",
    ]


def as_records(path: Path, found: Sequence[Flaw]) -> dict[str, object]:
    """The same for a program."""
    return {
        "file": str(path),
        "findings": [{**asdict(f), "why": CODES[f.code].why, "mend": CODES[f.code].mend} for f in found],
    }
