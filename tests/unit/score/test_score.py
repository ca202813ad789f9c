"""The score: what it plays, how it reports, and a small fixed part of it that must not get worse."""

import hashlib
import json
import math
from collections.abc import Iterable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source
from sim_ecu.design.cases import SEEDS_PER_PLAN, Plan, draw
from sim_ecu.design.search import FIRST_SEARCH_SEED, HELD_SEED, SEARCH_SEEDS
from sim_ecu.physics.track import OMEGA_C, SPECTRA, Track, deviation
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import databases
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import Scenario
from sim_ecu.reporting.table import markdown
from sim_ecu.reporting.values import plain
from sim_ecu.score import ON_REQUEST, SUITES, WORLDS, run_score, suites
from sim_ecu.score.metrics import accuracy, change_metrics, honesty
from sim_ecu.score.metrics.accuracy import OURS, gather
from sim_ecu.score.report import judge
from sim_ecu.score.score_play import MessageFrames, Trace, newest, play
from sim_ecu.score.sections import sections
from sim_ecu.score.suites.broken import BOTH_DEAD, SWAPPED, dead, foreign
from sim_ecu.score.suites.change_suites import drops
from sim_ecu.score.suites.nominal import HARSH, ROBUST, condition, grid
from sim_ecu.score.suites.run import FIRST_TEST_SEED, TRAINING_LOTS, Run
from sim_ecu.score.suites.sound import PACKAGED
from tests.support.can_ids import LAT_ACCEL, YAW_RATE, YAW_RATE_A2
from tests.support.lone_wheelset import LONE, LONE_DESIGN, lone_config
from wrcd.config.config import load_packaged
from wrcd.core.vocabulary import words_of
from wrcd.logs.decoder import MessageDecoder, decoders

W, SOURCE = Wheelset(), load_source(LONE_DESIGN)
SCORED = Path(__file__).parents[2] / "data/scored_runs.json"


@pytest.fixture(scope="module")
def every() -> dict[str, list[Run]]:
    """All suites, with a fifth of their runs."""
    out: dict[str, list[Run]] = {}
    for run in suites.runs(SOURCE, None, 0.2):
        out.setdefault(run.suite, []).append(run)
    return out


def test_scored_runs_are_not_those_of_training(every: dict[str, list[Run]]) -> None:
    trained = {c.seed for group in draw(Plan(), W) for c in group.conditions}
    assert max(trained) < SEEDS_PER_PLAN * 1_001 < FIRST_TEST_SEED  # the largest plan seed that is taken is 1000
    assert set(every) | set(ON_REQUEST) == set(SUITES)
    own = ("paper", "peak", "transitions", "drops", "cycles", "dry-hours")  # suites of other conditions than the grid's
    seeds: dict[int, tuple[str, int, int]] = {}
    for suite, runs in every.items():
        for run in runs:
            if run.group in PACKAGED:
                assert trained.isdisjoint(a.seed for a in run.scenario.axles)
                continue
            for place, a in enumerate(run.scenario.axles):
                assert a.seed >= FIRST_TEST_SEED
                # the same again only for the same conditions in another world
                condition_of = suite if suite in own else "grid", run.number, place
                assert seeds.setdefault(a.seed, condition_of) == condition_of


def digest(value: Any) -> str:
    """Of a run with all that it says; numbers to seven digits, for the last ones are a processor's."""

    def told(x: Any) -> Any:
        if is_dataclass(x):
            return [type(x).__name__, *((f.name, told(getattr(x, f.name))) for f in fields(x))]
        if isinstance(x, np.ndarray | list | tuple):
            return [told(v) for v in x]
        return f"{x:.7g}" if isinstance(x, float) else str(x)

    return hashlib.sha256(repr(told(value)).encode()).hexdigest()[:16]


def test_suites_play_the_runs_that_were_scored() -> None:
    """Else figures of two versions are not of one thing. To accept others, write what this prints to the file."""
    found = {
        f"{suite}, lot {lot}": digest(list(suites.runs(SOURCE, suite, 0.2, lot)))
        for suite in SUITES if suite != WORLDS for lot in (0, 1)
    }  # fmt: skip
    print(json.dumps(found, indent=1))
    assert found == json.loads(SCORED.read_text())


def test_lots_have_seeds_of_their_own_and_the_training_those_below_all_of_them() -> None:

    def seeds(runs: Iterable[Run]) -> set[int]:
        return {a.seed for r in runs for a in r.scenario.axles}

    lots = [seeds(suites.runs(SOURCE, "drops", 0.2, lot)) for lot in range(3)]
    tuned = [seeds(suites.runs(SOURCE, "drops", 0.2, lot)) for lot in (-1, -2, -TRAINING_LOTS)]
    every = [*lots, *tuned]
    assert sum(map(len, every)) == len(set().union(*every))
    assert [min(s) // 1_000_000_000 for s in lots] == [2, 3, 4]
    plans = (FIRST_SEARCH_SEED + SEARCH_SEEDS) * SEEDS_PER_PLAN  # of what candidates are judged by
    assert all(plans < min(s) <= max(s) < HELD_SEED for s in tuned)
    same = next(iter(suites.runs(SOURCE, "drops", 0.2))).scenario
    assert same.axles[0].seed == next(drops(W, 0.2)).scenario.axles[0].seed


def test_a_paired_suite_alone_brings_its_twins_along() -> None:
    runs = list(suites.runs(SOURCE, "harsh", 0.1))
    numbers = {r.number for r in runs if r.suite == "harsh"}
    assert {r.number for r in runs if r.suite == "grid"} == numbers
    assert {r.group for r in runs if r.suite == "harsh"} == {v.name for v in HARSH}
    assert {r.suite for r in suites.runs(SOURCE, "drops", 0.1)} == {"drops"}


def test_sensors_that_die_leave_their_own_noise() -> None:
    runs = {r.group: r for r in dead(W, 0.1)}
    sent = decoded(runs["both die"].scenario)
    dies = round(5.0 / 0.005)
    for signal, can_id, rms in (("YawRate", YAW_RATE_A2, 3e-4), ("LatAccel", LAT_ACCEL[2], 0.01)):
        values = [v[signal] for v in sent[can_id]]
        assert np.std(values[dies:]) == pytest.approx(rms, rel=0.1)
        assert np.std(values[200:dies]) > 1.2 * rms
    one = decoded(runs["the gyro dies"].scenario)
    assert np.std([v["YawRate"] for v in one[YAW_RATE_A2]][dies:]) == pytest.approx(3e-4, rel=0.1)
    assert np.std([v["LatAccel"] for v in one[LAT_ACCEL[2]]][dies:]) > 0.012
    start = [s.readings[0] for s in Player(runs[BOTH_DEAD].scenario).measured()]
    assert np.std([r.yaw_rate for r in start]) == pytest.approx(3e-4, rel=0.1)


def test_swapped_wires_are_those_of_a_train_on_one_track() -> None:
    run = next(r for r in foreign(W, 0.1) if r.group == SWAPPED)
    axles = run.scenario.axles
    assert len({a.runs_on for a in axles}) == 1
    assert len({a.position_m for a in axles}) == 4
    right = list(Player(run.scenario).measured())  # before the wires
    frames = decoded(run.scenario)
    for sensed, other in ((0, 1), (1, 0), (2, 3), (3, 2)):
        lat = [v["LatAccel"] for v in frames[LAT_ACCEL[1 + sensed]]]
        assert lat[:50] == pytest.approx([s.readings[other].lat_accel for s in right[:50]], abs=1e-5)
        yaw = [v["YawRate"] for v in frames[YAW_RATE[1 + sensed]]]
        assert yaw[:50] == pytest.approx([s.readings[sensed].yaw_rate for s in right[:50]], abs=1e-6)


def decoded(scenario: Scenario) -> dict[int, list[Any]]:
    """The values of all frames that the rig sends, by id."""
    out: dict[int, list[Any]] = {}
    for _, sent in Player(scenario, truth=False):
        for f in sent:
            out.setdefault(f.can_id, []).append(databases()[0].get_message_by_frame_id(f.can_id).decode(f.data))
    return out


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_the_corner_of_the_spectrum_moves_what_is_short(factor: float) -> None:
    """Slopes come from above the corner, size from far below it (sigma^2 = pi A_a Oc / (2 Or (Or + Oc)))."""
    spectra = [SPECTRA["good"].with_corner(f) for f in (1.0, factor)]
    both = [Track(s, 5) for s in spectra]
    nodes = [t.reach(200_000.0) for t in both]
    slope = [n[:, 1].std() for n in nodes]
    low = 0.0206
    assert slope[1] / slope[0] == pytest.approx(
        math.sqrt(factor**2 * (low + OMEGA_C) / (low + factor * OMEGA_C)), rel=0.03
    )
    assert nodes[1][:, 0].std() == pytest.approx(deviation(spectra[1].alignment, 0.1, 1e5), rel=0.1)


def decoder(kind: str) -> MessageDecoder:
    return next(d for d in decoders(load_packaged(2)) if (d.kind, d.axle) == (kind, 2))


def test_frames_are_decoded_as_cantools_does() -> None:
    rng = np.random.default_rng(4)
    truth = databases()[1].get_message_by_name("SimTruth_A2")
    for of in (decoder("adhesion"), MessageDecoder(truth)):
        heard, message = MessageFrames(of), of.message
        for _ in range(200):
            heard.stamps_us.append(0)
            heard.data.append(rng.integers(0, 256, 8, dtype=np.uint8).tobytes())
        heard.data += [b"\xff" * 8, b"\x00" * 8]
        theirs: list[Any] = [message.decode(d) for d in heard.data]
        for s in (s for s in message.signals if s.name not in ("Crc", "Counter", "Status")):
            if s.choices and s.name not in ("MuAvailable", "MuUsed"):
                words = words_of(of.kind, s.name)
                known = [word if (word := str(v[s.name])) in words else "" for v in theirs]
                assert heard.words(s.name).tolist() == known
            else:
                want = [float(v[s.name]) if isinstance(v[s.name], (int, float)) else math.nan for v in theirs]
                within = [x if (s.minimum or 0.0) <= x <= (s.maximum or math.inf) else math.nan for x in want]
                assert heard.numbers(s.name) == pytest.approx(np.array(within), nan_ok=True)
    assert np.isnan(heard.numbers("None")).all()


def test_last_frame_holds_until_the_next() -> None:
    heard = MessageFrames(decoder("detail"))
    message = heard.decoder.message
    empty = {s.name: 0 for s in message.signals}
    for stamp_us, cause in ((100, "InputStale"), (200, "GyroDead")):
        heard.stamps_us.append(stamp_us)
        heard.data.append(message.encode(empty | {"Cause": cause}, strict=False))
    found = newest(heard, "Cause", np.array([50, 100, 150, 250]))
    assert found.tolist() == ["", "InputStale", "InputStale", "GyroDead"]


def traces(every: Iterable[Run]) -> list[Trace]:
    config = lone_config()
    return [t for run in every for t in play(run, config, {})]


def briefly(run: Run) -> Run:
    return replace(run, scenario=replace(run.scenario, duration_s=4.0))


def nominal(count: int) -> list[Run]:
    return [r for r in grid(W, 0.08) if r.group == "mems"][:count]


@pytest.fixture(scope="module")
def small() -> list[Trace]:
    """A fixed part of grid and drops, and what is paired with the grid."""
    paired = [condition("robust", W, r.number, ROBUST[-4]) for r in nominal(2)]
    return traces([*map(briefly, [*nominal(2), *paired]), *list(drops(W, 0.1))[:3]])


@pytest.mark.night
def test_accuracy_does_not_get_worse() -> None:
    """Bounds a little above what the packaged design reaches here; `sim-ecu score` has the whole of it."""
    f = gather(traces(nominal(8)))
    found = accuracy.accuracy(f, OURS)
    assert found["mean"].count > 8000
    assert found["mean"].value <= MEAN_PP
    assert found["p95"].value <= P95_PP
    assert honesty.not_valid(f)["share"].value <= 0.02
    assert accuracy.contact_right(f)["right"].value >= 0.95
    assert honesty.coverage(f).value >= 0.85
    own = f.own_half_width[f.valid]
    assert np.mean(np.abs(f.mu[OURS] - f.true)[f.valid] <= own) >= 0.85  # without the bus's rounding up
    # in the design's own world it holds more than it claims, for it is made for others: it may not be wider than this
    assert np.mean(own) <= HALF_WIDTH_PP
    assert (own <= f.half_width[f.valid] + 1e-9).all()  # the bus rounds up


def test_drops_are_followed(small: list[Trace]) -> None:
    found = change_metrics.drops([t for t in small if t.suite == "drops"])
    assert len(found) == 12
    assert np.median([d.lie_s for d in found]) <= LIE_S
    assert np.median([d.settled_s for d in found]) <= SETTLED_S


def test_the_report_has_every_figure(small: list[Trace]) -> None:
    for t in small:
        t.baselines["torque ratio"] = t.true_used_pct
    result = judge(small, SOURCE)
    text = "\n".join(markdown(sections(result)))
    assert "| torque ratio |" in text
    assert "**drops**: 12 drops" in text
    assert f"design {SOURCE.design.name} {SOURCE.design.checksum[:12]}" in text
    ends = [line.split("|")[-2].strip() for line in text.split("**goals**")[1].splitlines()[4:]]
    assert len(result["goals"]) == len(ends) == 7
    assert ends.count("too few to judge") == len(ends)  # two runs are not enough
    document = json.loads(json.dumps(plain(result), allow_nan=False))
    paired = document["suites"]["robust"]["groups"][ROBUST[-4].name]
    grids = gather([t for t in small if t.suite == "grid"])
    over = paired["accuracy"]["mean"]["value"] / accuracy.accuracy(grids, OURS)["mean"].value
    assert paired["ratio"]["value"] == pytest.approx(over)
    assert judge(small, SOURCE, "drops")["suites"].keys() == {"drops"}


@pytest.mark.usefixtures("jobs_here")
def test_score_command_writes_tables_and_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run_score, "runs", lambda *of: map(briefly, suites.runs(*of)))
    arguments = ["score", "--suite", "paper", "--quick", "--jobs", "1", "--json", str(tmp_path / "s.json")]
    arguments += ["--design", LONE, "--beside", f"again={LONE}"]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "paper: worst error over its bound" in out
    assert "QUICK" in out
    document = json.loads((tmp_path / "s.json").read_text())
    assert set(document["suites"]["paper"]["curves"]) == set("ABCDEF")
    compared = document["suites"]["paper"]["compared"]
    assert compared["again"]["mean"]["value"] == pytest.approx(compared["wrcd"]["mean"]["value"], abs=0.02)
    assert "torque ratio" in compared


# measured on the packaged design: see test_accuracy_does_not_get_worse
MEAN_PP, P95_PP = 1.2, 5.0
HALF_WIDTH_PP = 3.0
LIE_S, SETTLED_S = 0.4, 1.0
