"""sim-ecu loop: its suites, its rows, and a small one of it from end to end."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.cli.main import main
from sim_ecu.loop import BARE_AND_WITH, SUITES, run_loop
from sim_ecu.loop.loop_rides import play
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED, RidePlan
from sim_ecu.loop.suites.variants import AS_DESIGNED, AWAY, STOPS, dry_stop
from sim_ecu.physics.contact import CURVES
from sim_ecu.play.faults import KINDS, Stage
from tests.support.processes import gone, wait_for
from tests.support.short_row import RAIL, play_slowly, slowly

ROW = ("--suite", "actuators", "--only", f"{RAIL}: fast", "--seeds", "1")
# the row in a process of its own, that no test waits for
SHORT = """
import sys
from sim_ecu.cli.main import main
from sim_ecu.loop import run_loop
from tests.support import short_row
run_loop.play_one = short_row.play_briefly
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(scope="module", autouse=True)
def short() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(STOPS, RAIL, slowly)
        patch.setattr(run_loop, "play_one", play_slowly)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    folder = tmp_path_factory.mktemp("loop")
    out, page = folder / "one.json", folder / "one.html"
    assert main(["loop", *ROW, "--jobs", "1", "--json", str(out), "--html", str(page)]) == 0
    return json.loads(out.read_text()), page


def test_figures_do_not_depend_on_the_number_of_processes(made: tuple[dict[str, Any], Path], tmp_path: Path) -> None:
    assert main(["loop", *ROW, "--jobs", "2", "--json", str(tmp_path / "two.json")]) == 0
    two, one = json.loads((tmp_path / "two.json").read_text()), dict(made[0])
    assert two.pop("run") | {"jobs": 1, "seconds": 0} == one.pop("run") | {"jobs": 1, "seconds": 0}
    assert two == one


def test_every_controller_of_a_row_stops_the_train(made: tuple[dict[str, Any], Path]) -> None:
    rows = made[0]["runs"]
    assert [r["controller"] for r in rows] == list(BARE_AND_WITH)
    assert {r["seed"] for r in rows} == {FIRST_TEST_SEED}
    assert all(r["stopped"] and 5.0 < r["stop_m"] < 20.0 for r in rows)
    assert [bool(r["said"]) for r in rows] == [False, True, False, True]


def test_goals_of_one_seed_are_not_judged(made: tuple[dict[str, Any], Path]) -> None:
    assert {g["verdict"] for g in made[0]["goals"]} == {"too few to judge"}


def test_page_has_its_tables_pictures_and_nothing_from_outside(made: tuple[dict[str, Any], Path]) -> None:
    text = made[1].read_text()
    assert "What wrcd does to the distance: actuators" in text
    assert '<h2 id="goals">' in text
    assert "http" not in text.replace("http-equiv", "")


def test_every_suite_has_rows_and_every_fault_that_frames_carry_has_one() -> None:
    every = cases()
    assert list(dict.fromkeys(c.suite for c in every)) == list(SUITES)
    assert len({(c.suite, c.name) for c in every}) == len(every)
    kinds = {c.name.partition(",")[0] for c in every if c.suite == "faults" and c.name != AWAY}
    assert {name for name, k in KINDS.items() if k.stage is not Stage.BUS} == kinds - {"no fault"}


def test_row_whose_bare_runs_are_another_ones_brings_that_along() -> None:
    assert [c.name for c in cases("faults", "swap, ")] == ["no fault, two axles", "swap, all signals"]


@pytest.mark.night
def test_run_that_branches_off_is_the_run_with_the_fault_from_the_start() -> None:
    base, case = cases("faults", "freeze, all")
    base, case = (replace(c, plan=briefly, controllers=("thresholds with wrcd",)) for c in (base, case))
    assert case.fault is not None
    case = replace(case, fault=replace(case.fault, at_s=BEGIN_S))
    at_once, whole = play(base, 1, [case]), play(case, 1)
    assert [o.case for o in at_once] == [case.name, base.name]
    assert repr(at_once[0]) == repr(whole[0])  # a figure may be no number
    assert at_once[0].honesty != at_once[1].honesty


BEGIN_S = 2.0


def briefly(_rng: np.random.Generator) -> RidePlan:
    """Braking a little on a wet rail, where the daemon is Valid, until some time after the fault begins."""
    return RidePlan(((0.0, CURVES["C"]),), 25.0, ((0.0, -0.3), (1.0, -0.3)), BEGIN_S + 0.5)


def test_scenario_follows_from_its_number_alone() -> None:
    case = next(iter(cases("braking")))
    one, same, other = case.scenario(0), case.scenario(0), case.scenario(1)
    assert (one.driver, one.train.speed) == (same.driver, same.train.speed)
    assert np.array_equal(one.train.axles[0].rail, same.train.axles[0].rail)
    assert one.train.speed != other.train.speed
    assert one.train.axles[0].seed != other.train.axles[0].seed


def test_worlds_are_driven_like_the_world_as_designed() -> None:
    every = {case.name: case for case in cases("worlds")}
    for case in every.values():
        first = every[case.bare or (case.name if case.plan is dry_stop else AS_DESIGNED)]
        assert case.scenario(3).train.speed == first.scenario(3).train.speed, case.name
        assert case.scenario(3).driver == first.scenario(3).driver, case.name


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--only", "never"), "no row's name holds 'never'"),
        (("--seeds", "0"), "--seeds"),
        (("--quick", "--seeds", "3"), "give one of --quick and --seeds"),
        (("--json", "never/there.json"), "no such folder"),
    ],
)
def test_bad_argument_is_named(arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["loop", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_ctrl_c_ends_it_with_its_status_and_no_file(tmp_path: Path) -> None:
    out = tmp_path / "never.json"
    process = subprocess.Popen(
        [sys.executable, "-c", SHORT, "loop", *ROW[:-2], "--jobs", "1", "--json", str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        assert "run 1 of" in process.stderr.readline()  # it drives
        workers = children(process.pid)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does it
        stdout, stderr = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, stdout) == (130, "")
    assert "Traceback" not in stderr
    assert not out.exists()
    assert workers
    wait_for("that no process is left", 60, lambda: all(map(gone, workers)))


def children(pid: int) -> list[int]:
    """The processes that one has started."""
    return [int(p.parent.name) for p in Path("/proc").glob("[0-9]*/stat") if parent(p) == pid]


def parent(stat: Path) -> int:
    """0 for a process that has just ended."""
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0
