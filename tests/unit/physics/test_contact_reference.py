"""The contact law against exact theory, against a locomotive's curves, and what `sim-ecu contact` does with bad cases.

CONTACT gives the force on the upper body, against the creepage; ours points along it. Hence the minus signs.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.physics.contact import (
    KALKER_A_OVER_B,
    KALKER_C11,
    Contact,
    CreepCurve,
    contact,
    kalker_c11,
    traction_ratio,
)
from sim_ecu.physics.wheelset import FloatArray
from sim_ecu.score.contact_table import COLUMNS, RESULTS, creep_force, run
from wrcd.errors import InputError

DATA = Path(__file__).parents[2] / "data"
CASES = DATA / "contact_no_spin.csv"
MEAN, LARGEST = 0.027, 0.11  # vector error over mu N that exact theory leaves to Polach's law

# The locomotive: 10 m/s. k_A and k_S were fitted once, to the smallest largest error from 0.5 % creep on: 0.0125
# (0.0121 with four digits; all 29 points within 0.0131 down to 0.001 %).
SPEED = 10.0
K_A, K_S, FITTED = 0.25, 0.24, 0.013
FALLING = CreepCurve("locomotive", "dry", 0.36, 0.38, 0.70, K_A, K_S)
CONSTANT = CreepCurve("locomotive", "dry", 0.33, 1.00, 0.00, 1.0, 1.0)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as f:
        return list(csv.DictReader(f))


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def locomotive() -> Contact:
    a, b = 6.304e-3, 12.61e-3
    return contact(106_700.0, a, b, 82e9, kalker_c11(a, b))


def ours(curve: CreepCurve, creep: FloatArray) -> FloatArray:
    return np.array([traction_ratio(float(s), SPEED, locomotive(), *curve.row()) for s in creep])


def series(name: str) -> tuple[FloatArray, FloatArray]:
    found = [r for r in rows(DATA / "eurosprinter_curves.csv") if r["series"] == name]
    assert len(found) == 30
    return np.array([float(r["creep_x"]) for r in found]), np.array([float(r["Fx_over_N"]) for r in found])


def test_the_command_stays_within_the_bands_of_exact_theory(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(CASES) == 0
    found, exact = table(capsys.readouterr().out), rows(CASES)
    assert list(found[0]) == [*COLUMNS, *RESULTS] == list(exact[0])
    assert len(found) == len(exact) == 385
    assert all(f[name] == e[name] for f, e in zip(found, exact, strict=True) for name in COLUMNS)
    force, theirs = (np.array([[float(r[name]) for name in RESULTS] for r in which]) for which in (found, exact))
    error = np.hypot(*(force + theirs).T)
    print(f"vector error over mu N: mean {error.mean():.4f}, max {error.max():.4f}")
    assert error.mean() <= MEAN
    assert error.max() <= LARGEST
    creep = np.array([[float(r["creep_x"]), float(r["creep_y"])] for r in found])
    assert ((force * creep).sum(axis=1) > 0).all()
    assert (np.hypot(*force.T) <= 1.0 + 1e-6).all()


def test_the_bands_would_show_a_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    """Kalker's slope off by a third, or a sign, is outside."""
    exact = np.array([[float(r[name]) for name in RESULTS] for r in rows(CASES)])
    run(CASES, k_A=0.67, k_S=0.67)
    force = np.array([[float(r[name]) for name in RESULTS] for r in table(capsys.readouterr().out)])
    assert np.hypot(*(force + exact).T).max() > LARGEST
    assert np.hypot(*(force - exact).T).mean() > 1.0


def test_no_creep_no_force() -> None:
    case = (1.0, 5.0, 5.0, 80_000.0, 82_000.0, 0.28, 0.3)
    assert creep_force(*case, 0.0, 0.0) == (0.0, 0.0)
    x, y = creep_force(*case, 0.002, -0.001)
    assert x > 0 > y
    assert x / y == pytest.approx(-2.0)


def test_contact_law_meets_kalkers_table() -> None:
    given = rows(DATA / "kalker_coefficients.csv")
    assert [float(r["a_over_b"]) for r in given] == pytest.approx(KALKER_A_OVER_B, abs=5e-5)
    assert [float(r["c11"]) for r in given] == KALKER_C11.tolist()
    for r in given:
        assert kalker_c11(float(r["a_over_b"]), 1.0) == pytest.approx(float(r["c11"]), rel=1e-4)


def test_the_locomotives_curve_with_constant_friction() -> None:
    """Textbook Polach, k_A = k_S = 1: within 0.023 of N at every creep (largest near 0.3 %)."""
    creep, exact = series("contact_exact_mu033")
    assert np.abs(ours(CONSTANT, creep) - exact).max() <= 0.023


def test_the_locomotives_curve_with_falling_friction() -> None:
    creep, exact = series("contact_extended_falling_friction")
    error = np.abs(ours(FALLING, creep) - exact)
    print(f"k_A {K_A}, k_S {K_S}: largest error {error[creep >= 0.005].max():.4f} of N from 0.5 % creep on")
    assert error[creep >= 0.005].max() <= FITTED < 0.02
    # no lucky end: it holds for smaller creep too, and the peak is where CONTACT has it
    assert error.max() <= 0.0135
    fine = np.linspace(0.005, 0.05, 451)
    assert ours(FALLING, fine).max() == pytest.approx(exact.max(), abs=0.01)
    assert fine[ours(FALLING, fine).argmax()] == pytest.approx(creep[exact.argmax()], abs=0.005)


def test_the_locomotives_measured_adhesion() -> None:
    """The curve's mean over a bin lies between p5 and p95 in 8 of 9 bins, and so do 89 % of its points, bin by bin.

    Between 0.3 and 0.6 % creep its mean is 0.202, p5 0.21.
    """
    inside, points = [], []
    for r in rows(DATA / "eurosprinter_measured.csv"):
        low, high = float(r["F_over_N_p5"]), float(r["F_over_N_p95"])
        mu = ours(FALLING, np.linspace(float(r["creep_percent_from"]), float(r["creep_percent_to"]), 51) / 100)
        inside.append(bool(low <= mu.mean() <= high))
        points.append(((low <= mu) & (mu <= high)).mean())
        if not inside[-1]:
            assert mu.mean() == pytest.approx(low, abs=0.01)
    print(f"{sum(inside)} of {len(inside)} bins, {100 * float(np.mean(points)):.0f} % of the curve's points in them")
    assert inside == [False] + [True] * 8
    assert np.mean(points) >= 0.88


GOOD = {
    "a_over_b": "0.5", "semi_axis_a_mm": "6", "semi_axis_b_mm": "12", "normal_load_N": "82000",
    "shear_modulus_MPa": "82000", "poisson": "0.28", "friction": "0.3", "creep_x": "1e-3", "creep_y": "0",
}  # fmt: skip


def text(*cases: dict[str, str], without: str = "", extra: str = "") -> str:
    names = [n for n in GOOD if n != without] + ([extra] if extra else [])
    return "\n".join([",".join(names), *(",".join(c.get(n, "extra") for n in names) for c in cases)]) + "\n"


def test_result_table_leaves_out_columns_that_are_not_needed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cases.csv"
    path.write_text(text(GOOD, GOOD, extra="remark") + "\n")
    assert run(path) == 0
    found = table(capsys.readouterr().out)
    assert len(found) == 2
    assert list(found[0]) == [*COLUMNS, *RESULTS]
    assert found[0]["creep_x"] == "1e-3"
    assert 0.5 < float(found[0]["Fx_over_muN"]) < 1.0
    assert found[0]["Fy_over_muN"] == "0.000000"


BAD = {
    "a column is missing": (text(GOOD, without="creep_y"), ":1: creep_y: this column is missing"),
    "a column has another name": (text(GOOD, without="friction", extra="frictoin"), "is it the column 'frictoin'?"),
    "no number": (text(GOOD, GOOD | {"creep_x": "1;0"}), ":3: creep_x: '1;0' is not a number"),
    "nothing": (text(GOOD | {"friction": ""}), ":2: friction: '' is not a number"),
    "not finite": (text(GOOD | {"normal_load_N": "nan"}), ":2: normal_load_N: takes a number from 1 to 1e+08, not nan"),
    "a negative axis": (text(GOOD, GOOD, GOOD | {"semi_axis_a_mm": "-6"}), ":4: semi_axis_a_mm: takes a number from"),
    "an axis of zero": (text(GOOD | {"semi_axis_b_mm": "0"}), ":2: semi_axis_b_mm: takes a number from 0.001"),
    "other axes": (text(GOOD | {"a_over_b": "2"}), ":2: a_over_b: is 2, but the semi-axes make it 0.5 — correct"),
    "beyond Kalker's table": (text(GOOD | {"a_over_b": "12"}), ":2: a_over_b: takes a number from 0.1 to 10, not 12"),
    "a short row": (text(GOOD) + "0.5,6\n", ":3: semi_axis_b_mm: 2 cells under a header of 9"),
    "no case": (text(), "has no case"),
    "an empty file": ("", ":1: a_over_b: this column is missing"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_cases_are_named(tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cases.csv"
    content, message = BAD[case]
    path.write_text(content)
    with pytest.raises(InputError) as caught:
        run(path)
    assert str(caught.value).startswith(f"{path}:")
    assert message in str(caught.value)
    assert " — " in str(caught.value)
    assert capsys.readouterr().out == ""


def test_missing_or_damaged_reference_csv_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        run(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="cannot be read"):
        run(tmp_path / "binary.csv")
    with pytest.raises(InputError, match="k_A: takes a number above 0"):
        run(CASES, k_A=0.0)
