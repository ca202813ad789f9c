"""`sim-ecu contact CASES.csv`: creep forces of single contacts, to be laid beside another program's.

Polach's law with constant friction and no spin. It stands outside sim_ecu/physics because it is for a person to read.
"""

import csv
import math
import sys
from pathlib import Path

from sim_ecu.physics.contact import KALKER_A_OVER_B, contact, kalker_c11, traction_ratio
from wrcd.config.settings import suggest
from wrcd.errors import InputError

# What a case is made of, and the least and the most that is taken. poisson does not count: c11 is Kalker's for 0.25.
COLUMNS = {
    "a_over_b": (float(KALKER_A_OVER_B[0]), float(KALKER_A_OVER_B[-1])),
    "semi_axis_a_mm": (1e-3, 1e3),
    "semi_axis_b_mm": (1e-3, 1e3),
    "normal_load_N": (1.0, 1e8),
    "shear_modulus_MPa": (1.0, 1e7),
    "poisson": (0.0, 0.5),
    "friction": (1e-3, 10.0),
    "creep_x": (-10.0, 10.0),
    "creep_y": (-10.0, 10.0),
}
RESULTS = ("Fx_over_muN", "Fy_over_muN")
RATIO_TOLERANCE = 0.02  # a_over_b may be rounded, but not belong to other axes


def run(cases: Path, k_A: float = 1.0, k_S: float = 1.0) -> int:
    """Print the cases with their creep forces (share of mu N, in the direction of the creepage). Raises InputError.

    Columns that are not needed are left out of the output; nothing is printed unless every case is sound.
    """
    for name, value in (("k_A", k_A), ("k_S", k_S)):
        if not 0.0 < value <= 100.0:
            raise InputError(f"takes a number above 0 and up to 100, not {value:g}", key=name)
    rows = []
    for cells in read_cases(cases):
        force = creep_force(*(float(c) for c in cells), k_A=k_A, k_S=k_S)
        rows.append((*cells, *(f"{f:.6f}" for f in force)))
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow((*COLUMNS, *RESULTS))
    writer.writerows(rows)
    return 0


def creep_force(
    _a_over_b: float, a_mm: float, b_mm: float, normal_N: float, shear_MPa: float, _poisson: float, friction: float,
    creep_x: float, creep_y: float, *, k_A: float = 1.0, k_S: float = 1.0,
) -> tuple[float, float]:  # fmt: skip
    """(Fx, Fy) over mu N of one case, of the same signs as the creepages (CONTACT's have the opposite ones)."""
    a, b = a_mm * 1e-3, b_mm * 1e-3
    c = contact(normal_N, a, b, shear_MPa * 1e6, kalker_c11(a, b))
    creep = math.hypot(creep_x, creep_y)
    if creep == 0.0:
        return 0.0, 0.0
    # A = 1 and B = 0: friction does not fall, so that the speed (1 m/s) does not matter
    size = traction_ratio(creep, 1.0, c, friction, 1.0, 0.0, k_A, k_S) / friction
    return size * creep_x / creep + 0.0, size * creep_y / creep + 0.0


def read_cases(path: Path) -> list[list[str]]:
    """The cells of COLUMNS, row by row, as they are written; every one is a number within its range."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, row) for row in reader]
    except FileNotFoundError:
        raise InputError("no such file", file=path, hint="check the path") from None
    except (OSError, UnicodeDecodeError, csv.Error) as e:
        raise InputError(f"cannot be read: {e}", file=path, hint="give a CSV file in UTF-8") from None
    header = [name.strip() for name in lines[0][1]] if lines else []
    for name in COLUMNS:
        if name not in header:
            like = suggest(name, header).replace("did you mean", "is it the column")
            hint = like or f"needed: {', '.join(COLUMNS)}"
            raise InputError("this column is missing", file=path, line=1, key=name, hint=hint)
    out = []
    for line, row in lines[1:]:
        if any(cell.strip() for cell in row):
            try:
                out.append(_cells(header, row))
            except InputError as e:
                raise InputError(e.reason, file=path, line=line, key=e.key, hint=e.hint) from None
    if not out:
        raise InputError("has no case", file=path, hint="write one row for each case below the header")
    return out


def _cells(header: list[str], row: list[str]) -> list[str]:
    """The cells of COLUMNS of a row. Raises InputError without its place."""
    if len(row) != len(header):
        key = header[min(len(row), len(header) - 1)]
        reason = f"{len(row)} cells under a header of {len(header)}"
        raise InputError(reason, key=key, hint="give every row a cell for each column")
    cells = {name: row[header.index(name)].strip() for name in COLUMNS}
    values = {}
    for name, (low, high) in COLUMNS.items():
        try:
            values[name] = float(cells[name])
        except ValueError:
            raise InputError(f"{cells[name]!r} is not a number", key=name, hint="write it like 0.5 or 1.2e-3") from None
        if not low <= values[name] <= high:
            hint = "mind the unit, which is in the column's name; creepages are shares, not percent"
            raise InputError(f"takes a number from {low:g} to {high:g}, not {values[name]:g}", key=name, hint=hint)
    ratio = values["semi_axis_a_mm"] / values["semi_axis_b_mm"]
    if abs(values["a_over_b"] / ratio - 1.0) > RATIO_TOLERANCE:
        reason = f"is {values['a_over_b']:g}, but the semi-axes make it {ratio:.4g}"
        raise InputError(reason, key="a_over_b", hint="correct the ratio or the axes; the forces follow from the axes")
    return list(cells.values())
