"""The training's simulations as jobs: what is kept when they are broken off, and what is taken up again."""

import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.cli.main import main
from sim_ecu.design import training_jobs
from sim_ecu.design.cases import QUICK_PER_SPEED, Plan, draw, quietly
from sim_ecu.design.pairs import EACH, FIRST_SPAN, SOUND_EACH, Watched
from sim_ecu.design.recordings import Recording, record
from sim_ecu.design.training_jobs import PART, GroupJob, pairs, recorded, remove_parts
from sim_ecu.jobs import digests
from sim_ecu.jobs.pool import Stopped, Workers
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.vehicles import load_vehicle
from tests.support.lone_wheelset import LONE
from wrcd.core.design import load_design
from wrcd.core.terms import PAIR_FEATURES, PairState
from wrcd.errors import InputError, Status
from wrcd.resources import DEFAULT_DESIGN, DESIGNS

PLAN = Plan(seed=5, speeds=2, per_speed=3, settle_s=0.5, seconds=0.7)
TICK_S = 0.005
GROUPS = 4
pytestmark = pytest.mark.usefixtures("jobs_here")


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The places that are simulated."""
    return watched(monkeypatch, lambda _place: None)


SIMULATE = training_jobs.simulate
BEFORE: list[Callable[[int], None]] = []
PLACES: list[int] = []


def watching(job: GroupJob) -> Recording:
    """A worker would find it by its module and name."""
    BEFORE[-1](job.place)
    PLACES.append(job.place)
    return SIMULATE(job)


def watched(monkeypatch: pytest.MonkeyPatch, before: Callable[[int], None]) -> list[int]:
    BEFORE.append(before)
    PLACES.clear()
    monkeypatch.setattr(training_jobs, "simulate", watching)
    return PLACES


def of(folder: Path, plan: Plan = PLAN) -> list[Recording]:
    return recorded(Wheelset(), plan, TICK_S, folder, Workers(None), quietly)


def content(recordings: list[Recording]) -> list[tuple[object, ...]]:
    def plain(value: object) -> object:
        return (value.dtype, value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value

    return [tuple(plain(getattr(r, f.name)) for f in fields(r)) for r in recordings]


def unbroken() -> list[tuple[object, ...]]:
    return content(record(Wheelset(), PLAN, TICK_S, quietly))


def test_interrupted_run_goes_on_with_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(place: int) -> None:
        if place == 2:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        watched(patch, interrupted)
        with pytest.raises(KeyboardInterrupt):
            of(tmp_path)
    assert "were there" not in capsys.readouterr().out
    with pytest.MonkeyPatch.context() as patch:
        simulated = watched(patch, lambda _place: None)
        assert content(of(tmp_path)) == unbroken()
    assert simulated == [2, 3]
    assert f"{tmp_path}: 2 of 4 groups were there" in capsys.readouterr().out


@pytest.mark.parametrize(
    "damage", [lambda b: b"", lambda b: b[:-1], lambda b: b[:999] + bytes([b[999] ^ 1]) + b[1000:]],
    ids=["empty", "cut off", "a bit"],
)  # fmt: skip
def test_damaged_part_is_made_again(tmp_path: Path, simulated: list[int], damage: Callable[[bytes], bytes]) -> None:
    of(tmp_path)
    part = tmp_path / f"{GroupJob(Wheelset(), PLAN, TICK_S, 1, draw(PLAN, Wheelset())[1]).key}{PART}"
    whole = part.read_bytes()
    part.write_bytes(damage(whole))
    simulated.clear()
    assert content(of(tmp_path)) == unbroken()
    assert simulated == [1]
    simulated.clear()
    of(tmp_path)
    assert not simulated


def test_another_plan_uses_nothing_old(tmp_path: Path, simulated: list[int]) -> None:
    of(tmp_path)
    simulated.clear()
    of(tmp_path, replace(PLAN, seed=6))
    assert simulated == list(range(GROUPS))


def test_key_is_of_all_inputs_and_of_the_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    job = GroupJob(Wheelset(), PLAN, TICK_S, 0, draw(PLAN, Wheelset())[0])
    others = [
        replace(job, wheelset=replace(job.wheelset, m_w=1600.0)), replace(job, plan=replace(PLAN, seconds=0.5)),
        replace(job, tick_s=0.004), replace(job, place=1),
    ]  # fmt: skip
    keys = {j.key for j in (job, *others)}
    assert replace(job).key in keys
    monkeypatch.setattr(digests, "code", lambda: "of other sources")
    assert len(keys | {job.key}) == len(others) + 2


def test_group_that_fails_twice_is_named_and_the_others_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[int] = []

    def fails(place: int) -> None:
        tries.append(place)
        if place == 1:
            raise ValueError("no rail")

    watched(monkeypatch, fails)
    with pytest.raises(Stopped, match=r"1 of 4 jobs failed twice:\n  group 2 of 4, 3\.2 m/s: ValueError: no rail"):
        of(tmp_path)
    assert tries.count(1) == 2
    assert len(list(tmp_path.glob(f"*{PART}"))) == GROUPS - 1


def test_only_what_was_kept_is_removed(tmp_path: Path) -> None:
    for folder in (tmp_path / "own", tmp_path / "shared"):
        folder.mkdir()
        (folder / f"a{PART}").write_text("")
        (folder / "b.new").write_text("")  # what a kill leaves
    (tmp_path / "shared/notes.txt").write_text("")
    remove_parts(tmp_path / "own")
    remove_parts(tmp_path / "shared")
    assert [f.relative_to(tmp_path).as_posix() for f in sorted(tmp_path.rglob("*"))] == ["shared", "shared/notes.txt"]


def test_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "parts").write_text("")
    with pytest.raises(InputError, match="parts: cannot be made: File exists"):
        of(tmp_path / "parts")


RIG = """
vehicle = "lone-wheelset"
[design]
form = "paper"
grid = 6
max_rules = 2
[plan]
speeds = 4
per_speed = 2
"""


def test_design_that_was_broken_off_after_its_simulations_simulates_nothing(
    tmp_path: Path, simulated: list[int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rig.toml").write_text(RIG)
    out = tmp_path / "made.json"
    command = ["design", "--config", str(tmp_path / "rig.toml"), "-o", str(out), "--jobs", "1"]

    def interrupted(*_: object, **_named: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("sim_ecu.design.make.features", interrupted)
        assert main(command) == Status.INTERRUPTED
    assert not out.exists()
    assert sorted(simulated) == list(range(GROUPS))
    assert main(command) == Status.DONE
    assert len(simulated) == GROUPS
    assert f"{out}.parts: 4 of 4 groups were there" in capsys.readouterr().out
    assert sorted(f.name for f in tmp_path.iterdir()) == ["made.json", "rig.toml"]


BOGIE = """
[design]
grid = 6
max_rules = 4
[plan]
speeds = 2
per_speed = 60
"""


@pytest.mark.night
def test_quick_design_judges_sensors_and_is_played_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sim_ecu.score.run_score.SHORT", 1)
    (tmp_path / "rig.toml").write_text(BOGIE)
    out = tmp_path / "made.json"
    command = ["design", "--quick", "--config", str(tmp_path / "rig.toml"), "-o", str(out), "--jobs", "1"]
    assert main(command) == Status.DONE
    said = capsys.readouterr()
    assert "on 4 axles of its own kind of vehicle: mean error" in said.out
    assert "Valid and wrong" in said.out
    assert json.loads(out.read_text())["inputs"]["plan"]["per_speed"] == QUICK_PER_SPEED
    design = load_design(out)
    assert design.interval is not None
    assert design.health is not None
    for doing in ("gains", "simulating conditions", "residuals", "rule base", "looking at sensors",
                  "learning to judge", "worlds: run 1 of 1"):  # fmt: skip
        assert f"{doing}: 100 %" in said.err


@pytest.mark.parametrize("vehicle", [LONE, DEFAULT_DESIGN])
def test_pairs_are_kept_and_are_of_both_wheelsets_of_a_bogie(tmp_path: Path, vehicle: str) -> None:
    """A lone wheelset's group runs once more, half of it in canted curves."""
    w, design = load_vehicle(vehicle), load_design(DESIGNS / f"{vehicle}.design.json")
    plan = replace(PLAN, seconds=3.0, speeds=1, per_speed=4)
    first = pairs(w, plan, design, tmp_path, Workers(None), quietly)
    again = pairs(w, plan, design, tmp_path, Workers(None), quietly)
    assert len(first) == len(draw(plan, w))
    for a, b, group in zip(first, again, draw(plan, w), strict=True):
        for f in fields(Watched):
            np.testing.assert_array_equal(getattr(a, f.name), getattr(b, f.name))
        each = (SOUND_EACH + EACH) * len(group.conditions) * (2 if w.bogie is None else 1)
        assert each <= a.features.shape[1] == len(a.partner) == len(a.held) <= 1.25 * each
        assert a.features.shape[2] == PAIR_FEATURES
        assert np.isfinite(a.features.astype(float)).all()
        assert {PairState.SOUND} < set(a.state[FIRST_SPAN:].ravel().tolist())
        assert len(a.off) == len(a.regime) == len(a.speed_m_s) > 0
