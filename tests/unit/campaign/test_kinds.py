"""The kinds of job: what they declare is what they give, the same anywhere, and nonsense is refused before it runs."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.campaign.definition import KINDS
from sim_ecu.campaign.kind import Kind
from sim_ecu.campaign.kinds.drive import THRESHOLDS
from sim_ecu.campaign.kinds.given import fault_of, scenario_of
from sim_ecu.campaign.kinds.score import suite_of
from sim_ecu.design.brief import load_source
from sim_ecu.jobs.pool import local, run
from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.drive_scenario import load_drive_scenario
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.ride_figures import judge
from sim_ecu.play.scenario import path_of
from sim_ecu.score.metrics.run_metrics import suite_figures
from sim_ecu.score.report import judge as report
from sim_ecu.score.score_play import play
from sim_ecu.score.suites import runs
from sim_ecu.score.suites.run import NOMINAL_FROM_S
from wrcd import resources
from wrcd.config.config import load_config
from wrcd.config.section import Section
from wrcd.errors import InputError

ROOT = Path(__file__).parents[3]
SHORT = {"scenario.duration_s": 2.6}
DRIVE = {"scenario": "brake-greasy", "controller": "thresholds", "with_adhesion": True, "seed": 7,
         "scenario.driver.demand": -1.0, **SHORT}  # fmt: skip
PLAY = {"scenario": "low", "seed": 7, "judged_from_s": 1.5, **SHORT}
SCORE = {"suite": "drops", "group": "down", "run": 0, "lot": 0}
EXAMPLES = {"drive": DRIVE, "play": PLAY, "score": SCORE}
# what a row of results has beside a kind's figures
TAKEN = {"key", "ending", "error", "seed"}


def kind_of(name: str) -> Kind:
    return next(k for k in KINDS if k.name == name)


def figures(kind: str, inputs: Mapping[str, Any]) -> dict[str, Any]:
    return dict(kind_of(kind).function(inputs))


@pytest.fixture(scope="module")
def found() -> dict[str, dict[str, Any]]:
    """The figures of the examples."""
    return {kind: figures(kind, inputs) for kind, inputs in EXAMPLES.items()}


@pytest.mark.parametrize("kind", EXAMPLES)
def test_figures_are_those_that_are_declared(kind: str, found: dict[str, dict[str, Any]]) -> None:
    assert {name: type(value) for name, value in found[kind].items()} == kind_of(kind).figures


def test_job_gives_the_same_in_another_process_and_again(found: dict[str, dict[str, Any]]) -> None:
    with local(1) as workers:
        for kind in ("drive", "play"):
            there = [o.value for o in run(kind_of(kind).function, [EXAMPLES[kind]] * 2, workers)]
            assert [repr(t) for t in there] == [repr(found[kind])] * 2


def test_another_seed_gives_other_figures(found: dict[str, dict[str, Any]]) -> None:
    assert figures("play", PLAY | {"seed": 8})["mean_error_pp"] != found["play"]["mean_error_pp"]


def test_drive_is_a_ride_in_lockstep(found: dict[str, dict[str, Any]]) -> None:
    file = {"scenario": "brake-greasy", "controller": "thresholds", "seed": 1, **SHORT}
    scenario = load_drive_scenario("brake-greasy")  # its seed is 1
    controller = make_controller("thresholds", Facts.of(scenario))
    steps = [s for s in Lockstep(scenario, controller, None) if s.due_us <= SHORT["scenario.duration_s"] * 1e6]
    ours, ridden = figures("drive", file), judge(steps, scenario)
    assert (ours["slip_energy_kJ"], ours["time_s"]) == (ridden.slip_energy_kJ, ridden.seconds)
    assert (ours["distance_m"], ours["stopped"]) == (ridden.stop_m, False)
    assert math.isnan(ours["stop_m"])  # it did not stop
    assert math.isnan(ours["valid"])  # without a daemon nothing is said
    assert 0.5 < found["drive"]["valid"] < 1.0  # after it is warm, which is part of the ride


def test_score_has_the_figures_of_the_score(found: dict[str, dict[str, Any]]) -> None:
    source = load_source(resources.DESIGN)
    first = next(iter(runs(source, "drops", 1.0)))
    traces = play(first, load_config(None), {})
    assert repr(suite_figures(traces)) == repr(found["score"])
    said, ours = report(traces, source, "drops")["suites"]["drops"], found["score"]
    assert ours["max_over_pp"] == said["over"]["most"].value
    assert ours["far_s"] == said["far"]["most"].value
    assert 1.0 - ours["valid"] == pytest.approx(said["not_valid"]["share"].value)
    assert ours["cause"] == next(iter(said["not_valid"]["causes"]), "")


def test_inputs_that_leave_out_group_and_run_stand_for_all_of_a_suite() -> None:
    score = kind_of("score")
    every = list(score.points({"suite": "dead"}))
    numbers = {g: [p["run"] for p in every if p["group"] == g] for g in {p["group"] for p in every}}
    assert len(numbers) == 4
    assert all(found == list(range(len(found))) for found in numbers.values())
    assert len(list(score.points({"suite": "dead", "group": "both die", "run": 3}))) == 1
    assert list(kind_of("play").points(PLAY)) == [PLAY]


def test_every_lot_has_tracks_of_its_own() -> None:
    seeds = [{a.seed for r in suite_of({"suite": "paper", "lot": lot})["held at the peak"] for a in r.scenario.axles}
             for lot in (0, 1, -1)]  # fmt: skip
    assert not seeds[0] & seeds[1]
    assert not (seeds[0] | seeds[1]) & seeds[2]


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.name)
def test_declaration_is_sound(kind: Kind) -> None:
    factors = [f.name for f in kind.factors]
    assert len({*factors, *kind.figures}) == len(factors) + len(kind.figures)
    assert not TAKEN & {*factors, *kind.figures}
    assert kind.suite in factors


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.name)
def test_page_says_what_every_factor_and_figure_is(kind: Kind) -> None:
    page = (ROOT / "docs/reference/campaign.md").read_text()
    told = {
        name for cell in re.findall(r"^\| (`[^|]*`) \|", page, re.MULTILINE) for name in re.findall("`(.+?)`", cell)
    }
    families = {name.partition("_")[0] for name in told if name.partition("_")[2].isupper()}
    assert families == {"km", "hours", "cause"}
    assert {f.name for f in kind.factors} <= told
    assert {f for f in kind.figures if "_" not in f or f.partition("_")[0] not in families} <= told


def test_page_has_the_defaults() -> None:
    page = (ROOT / "docs/reference/campaign.md").read_text()
    rows = [row.split(" | ") for row in re.findall(r"^\| (`.*) \|$", page, re.MULTILINE) if row.count(" | ") == 3]
    told = {
        name: value for row in rows
        for name, value in zip(re.findall("`(.+?)`", row[0]), row[2].split(", "), strict=False)
    }  # fmt: skip
    own = {"fault": "bias", "fault_axle": 1}
    named = {name: float(told[name]) for name in ("fault_at_s", "fault_for_s")} | {"fault_of": told["fault_of"]}
    assert fault_of(own | named, [1], 9.0) == fault_of(own, [1], 9.0) != ()
    assert float(told["judged_from_s"]) == NOMINAL_FROM_S
    assert suite_of({"suite": "dead", "lot": int(told["lot"])}) is suite_of({"suite": "dead"})
    assert (told["controller"], told["with_adhesion"], told["daemon"]) == (THRESHOLDS, "false", "false")


@pytest.mark.parametrize("kind", EXAMPLES)
def test_longer_run_costs_more(kind: str) -> None:
    longer: dict[str, dict[str, Any]] = {
        "drive": {"scenario.duration_s": 9.0},
        "play": {"scenario.duration_s": 9.0},
        "score": {"suite": "dry-hours", "group": "dry, poor track"},
    }
    cost = kind_of(kind).check
    assert 0.0 < cost(EXAMPLES[kind]) < cost({**EXAMPLES[kind], **longer[kind]})


WRONG = [
    ("drive", {"scenario": "brake-gresy"}, "brake-gresy"),
    ("drive", {"scenario": "never.toml"}, "never.toml: "),
    ("drive", {"controller": "none"}, "with_adhesion: "),
    ("drive", {"with_adhesion": False, "fault": "bias", "fault_at_s": 1.0}, "fault: "),
    ("drive", {"with_adhesion": False, "design": "d.json"}, "design: "),
    ("drive", {"phase_us": 3}, "phase_us: "),
    ("drive", {"fault": "bias"}, "fault_at_s: "),
    ("drive", {"fault": "swap", "fault_at_s": 1.0}, "fault: "),
    ("play", {"scenario": "brake-greasy"}, "brake-greasy"),
    ("play", {"scenario.durration_s": 3.0}, "scenario.durration_s: "),
    ("play", {"scenario.rail.2.curve": "A"}, "scenario.rail.2.curve: "),
    ("play", {"scenario.title.x": 1}, "scenario.title.x: "),
    ("play", {"fault": "crc", "fault_at_s": 1.0, "fault_amount": 2.0}, "fault_amount: "),
    ("play", {"fault": "loss", "fault_at_s": 1.0, "fault_amount": 2.0}, "fault_amount: "),
    ("play", {"fault": "bias", "fault_at_s": 1.0, "fault_axle": 3}, "fault_axle: "),
    ("play", {"judged_from_s": 3.0}, "judged_from_s: "),
    ("play", {"design": "never.json"}, "never.json"),
    ("score", {"group": "up"}, "group: "),
    ("score", {"run": 45}, "run: "),
    ("score", {"lot": -41}, "lot: "),
    ("score", {"lot": 40}, "lot: "),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "inputs", "words"), WRONG)
def test_nonsense_is_refused_before_anything_runs(kind: str, inputs: dict[str, Any], words: str) -> None:
    kind_of(kind).check(EXAMPLES[kind])
    with pytest.raises(InputError) as caught:
        kind_of(kind).check({**EXAMPLES[kind], **inputs})
    assert words in str(caught.value)


def test_mistake_of_a_scenario_that_is_of_no_key_names_none() -> None:
    def read(top: Section, _name: str) -> None:
        if top.get("seed", int, 0) == 7:
            raise InputError("goes with no track")

    with pytest.raises(InputError) as caught:
        scenario_of({"scenario": "greasy", "seed": 7}, path_of("greasy"), read)
    assert str(caught.value) == "goes with no track"


def test_value_within_a_list_of_tables_is_reached_by_its_place(found: dict[str, dict[str, Any]]) -> None:
    other = figures("play", PLAY | {"scenario.rail.1.curve": "A"})
    assert other["mean_error_pp"] != found["play"]["mean_error_pp"]


def test_configuration_of_its_own_is_heard_and_what_it_names_are_its_files() -> None:
    own = {**PLAY, "configuration": str(ROOT / "examples/own-dbc/train.toml")}
    kind_of("play").check(own)
    assert figures("play", own)["valid"] > 0.5
    named = kind_of("play").named(own)
    assert {name: path.name for name, path in named.items()} == {"configuration's DBC": "train.dbc"}
    with pytest.raises(InputError, match="maps no axle 2"):
        kind_of("play").check({**own, "scenario": "half-wet"})


def test_fault_acts_on_what_the_daemon_hears(found: dict[str, dict[str, Any]]) -> None:
    silent = figures("play", PLAY | {"fault": "burst", "fault_at_s": 1.6, "fault_for_s": 0.9, "fault_of": "all"})
    assert silent["valid"] < found["play"]["valid"]
    assert silent["cause"] != ""


def test_impulse_is_of_starts_and_no_stop_is_worse_for_less(
    found: dict[str, dict[str, Any]],
) -> None:
    start = figures("drive", DRIVE | {"scenario.driver.demand": 1.0, "scenario.speed_m_s": 8.0})
    assert math.isnan(found["drive"]["impulse_kNs"])
    assert start["impulse_kNs"] > 0.0
