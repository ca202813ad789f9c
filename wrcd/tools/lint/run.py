"""All of lint over one DBC, for a person or as JSON."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.bus.units import Quantity
from wrcd.errors import InputError
from wrcd.estimator.design import Design, load_design
from wrcd.tools.dbc.candidates import candidates
from wrcd.tools.dbc.text import read
from wrcd.tools.lint import inputs, layout, protection, times, values
from wrcd.tools.lint.codes import CODES, Finding

INPUTS = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE, Quantity.SPEED, Quantity.BRAKE_TORQUE)


def findings(path: Path, design: Design | None = None) -> list[Finding]:
    """Return what there is to find, in the file's order. Raises InputError for a file that cannot be read.

    design: by which resolution, range and cycle are judged; default the packaged one.
    """
    dbc = read(path)
    refused: list[Finding] = []
    try:
        load_dbc(path)
    except InputError as e:
        if not dbc.messages:
            raise
        refused = [Finding(e.line or _line(e.reason), "not-loadable", path.name, e.reason)]
    design = design or load_design(resources.DESIGN)
    likely = [c for c in candidates(dbc) if c.quantity in INPUTS]
    found = [
        *refused,
        *layout.check(dbc),
        *values.check(dbc),
        *values.check_statuses(likely),
        *times.check(dbc, likely, design.tick_s),
        *protection.check(dbc, likely),
        *inputs.check(dbc, likely, design),
    ]
    return sorted(found, key=lambda f: (f.line, list(CODES).index(f.code), f.subject))


def _line(reason: str) -> int:
    """The line that cantools names in its own words."""
    named = re.search(r"\bline (\d+)", reason)
    return int(named[1]) if named else 1


def lint(path: Path, as_json: bool = False) -> int:
    """Print the findings; 1 if there are any, else 0."""
    found = findings(path)
    print(
        json.dumps(as_records(path, found), indent=2, ensure_ascii=False) if as_json else "\n".join(lines(path, found))
    )
    return 1 if found else 0


def lines(path: Path, found: Sequence[Finding]) -> list[str]:
    """Findings for a person: each with its reason and remedy where its code comes first, and the count."""
    out: list[str] = []
    told: set[str] = set()
    for f in found:
        out.append(f"{path}:{f.line}: {f.code}: {f.subject}: {f.what}")
        if f.code not in told:
            out += [f"    {CODES[f.code].why}", f"    {CODES[f.code].mend}"]
        told.add(f.code)
    kinds = f" of {len(told)} kinds" if len(told) > 1 else ""
    return [
        *out,
        f"{path}: {len(found)} finding{'s' * (len(found) != 1)}{kinds}" if found else f"{path}: nothing found",
    ]


def as_records(path: Path, found: Sequence[Finding]) -> dict[str, object]:
    """The same for a program."""
    return {
        "file": str(path),
        "findings": [
            {
                "line": f.line, "code": f.code, "subject": f.subject, "what": f.what,
                "why": CODES[f.code].why, "mend": CODES[f.code].mend,
            }
            for f in found
        ],
    }  # fmt: skip
