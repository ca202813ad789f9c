"""Fusion along the vehicle on a real patch: told before the axles behind are on it, and the estimate as it was."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.cli.main import main
from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.fusion.patches import (
    HELD_PER_SPEED,
    JOINTS,
    KINDS,
    PER_SPEED,
    PLACES_M,
    RISE,
    SPEEDS_M_S,
    STEADY,
    PatchRide,
    _rail,
    patches,
    rails,
)
from sim_ecu.loop.fusion.run_fusion import judge, play_all, sections
from sim_ecu.loop.fusion.warnings_ahead import (
    BEHIND,
    FRAME_S,
    AheadFrames,
    Entry,
    PatchRecord,
    enters_s,
    entry,
    false_lows,
    false_warnings,
    play,
)
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.play.play import LOG_START_US
from sim_ecu.reporting.page import markdown
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.config.config import load_packaged
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing
from wrcd.recorder.state import capture, encode, restore
from wrcd.resources import LONE

TRAINING_SEED = 500
JOINTED_NUMBER, JOINTED_SEED = 14, 314
AHEAD, DETAIL = range(0xC1, 0xC5), range(0xA1, 0xA5)
ADVICE = 0xB3
ADVISING = load_packaged(4, PLACES_M, LONE, advice=True)
FUSING, PLAIN = (load_packaged(4, places, LONE) for places in (PLACES_M, None))


def shortened(drive: PatchRide, seconds: float) -> PatchRide:
    scenario = drive.scenario
    return replace(drive, scenario=replace(scenario, train=replace(scenario.train, duration_s=seconds)))


@pytest.fixture(scope="module")
def drive() -> PatchRide:
    """Onto a patch at 25 m/s, slipping."""
    at_25 = (d for d in patches(1.0, TRAINING_SEED) if d.speed_m_s == 25.0 and d.slides)
    return shortened(next(at_25), 5.3)


@pytest.fixture(scope="module")
def played(drive: PatchRide) -> PatchRecord:
    return play(drive, FUSING, PLAIN)


@pytest.fixture(scope="module")
def frames(drive: PatchRide) -> list[Frame]:
    """What the daemon hears in it."""
    out: list[Frame] = []
    controller = make_controller(drive.law, Facts.of(drive.scenario), None)
    run = Lockstep(
        drive.scenario, controller, None, lambda t, i, d: out.append(Frame(LOG_START_US + t, i, d)), sensors=True
    )
    list(run)
    return out


def entries(p: PatchRecord) -> list[Entry]:
    return [e for axle in BEHIND if (e := entry(p, axle)) is not None]


def test_axles_behind_are_warned_before_they_are_on_the_patch(played: PatchRecord) -> None:
    found = entries(played)
    assert [e.axle for e in found] == [2, 3, 4]
    assert all(e.lead_s > 0.0 for e in found)
    assert [e.confirmed for e in found[1:]] == [True, True]
    assert all(np.abs(e.errors_m).max() < 3.0 for e in found)
    assert false_warnings(played) == (0, 0.0)


def test_estimate_is_the_same_with_fusion_and_without(played: PatchRecord) -> None:
    assert played.same


def test_rail_that_does_not_change_is_not_told() -> None:
    still = next(d for d in rails(1.0, TRAINING_SEED) if d.kind == STEADY and d.number == 5)
    found = play(shortened(still, 6.0), FUSING, PLAIN)
    assert not any(s.warns.any() for s in found.seen)
    assert entries(found) == []


def test_small_joints_are_not_told() -> None:
    """Of 0.3 m/s²: too small to be flagged as pulses."""
    seconds = 6.0
    jointed = shortened(_rail(JOINTED_NUMBER, JOINTED_SEED, JOINTS), seconds)
    assert jointed.scenario.train.axles[0].axlebox.joint_m_s2 == 0.3
    p = play(jointed, FUSING, None)
    assert len(p.seen[0].time_s) > 0.9 * seconds / FRAME_S
    assert false_warnings(p) == (0, 0.0)


def test_detail_of_a_valid_axle_says_drop_ahead(frames: list[Frame]) -> None:
    core = Core(FUSING)
    causes: dict[str, set[str]] = {}
    for out in (o for f in frames for o in core.feed(f)):
        if out.frame.can_id == DETAIL[2]:
            causes.setdefault(word(out, "AdhesionDetail_A3", "Cause"), set()).add(core.reports[2].validity.value)
    assert causes["DropAhead"] == {"Valid"}
    assert "None" in causes


def word(out: Outgoing, message: str, signal: str) -> str:
    said: Any = find_message(FUSING.database, message).decode(out.frame.data)
    return str(said[signal])


def sent(core: Core, frames: list[Frame]) -> list[Frame]:
    return [o.frame for f in frames for o in core.feed(f) if o.frame.can_id in (*AHEAD, *DETAIL)]


def test_restored_state_goes_on_with_the_same_frames(frames: list[Frame]) -> None:
    warned_us = LOG_START_US + 4_300_000
    before = [f for f in frames if f.stamp_us < warned_us]
    core, again = Core(FUSING), Core(FUSING)
    for f in before:
        core.feed(f)
    restore(again, json.loads(json.dumps(encode(capture(core)))))
    rest = frames[len(before) :]
    expected = sent(core, rest)
    assert sent(again, rest) == expected
    assert len({f.data[2:] for f in expected if f.can_id in AHEAD}) > 10


def test_confirmed_drop_ahead_takes_the_trains_advice_down(frames: list[Frame]) -> None:
    message = find_message(ADVISING.database, "AdhesionAdvice")

    def advised(config: Config) -> list[Any]:
        out = [o.frame for core in (Core(config),) for f in frames for o in core.feed(f)]
        return [message.decode(f.data) for f in out if f.can_id == ADVICE]

    fused, alone = advised(ADVISING), advised(load_packaged(4, None, LONE, advice=True))
    words = [str(said["Ahead"]) for said in fused]
    assert "Confirmed" in words
    assert {str(said["Ahead"]) for said in alone} == {"None"}
    for said, word, without in zip(fused, words, alone, strict=True):
        if word != "Confirmed":
            assert {**said, "Ahead": 0, "Crc": 0} == {**without, "Ahead": 0, "Crc": 0}
        elif str(said["Validity"]) == "Valid":
            assert said["Deceleration"] <= without["Deceleration"]
            assert said["DecelerationLow"] <= min(without["DecelerationLow"], 0.5 * said["Deceleration"] + 0.01)


def test_silence_of_the_speed_forgets_the_drop(frames: list[Frame]) -> None:
    core = Core(FUSING)
    begin_us, end_us = LOG_START_US + 4_300_000, LOG_START_US + 4_500_000
    heard = [f for f in frames if not (f.can_id == 0x130 and begin_us <= f.stamp_us < end_us)]
    states = {}
    for out in (o for f in heard for o in core.feed(f)):
        if out.frame.can_id == AHEAD[2]:
            states[out.frame.stamp_us - LOG_START_US] = word(out, "AdhesionAhead_A3", "State")
    assert states[4_300_000] in ("Ahead", "Entering")
    assert states[4_480_000] == states[4_600_000] == "NotAvailable"


def test_suite_has_every_speed_with_and_without_cleaning() -> None:
    every = list(patches())
    assert len(every) == (PER_SPEED + HELD_PER_SPEED) * len(SPEEDS_M_S)
    assert {(d.speed_m_s, d.cleaned, d.held) for d in every} == {
        (v, cleaned, held) for v in SPEEDS_M_S for cleaned in (False, True) for held in (False, True)
    }
    assert not any(d.slides for d in every if d.held)


def test_suite_has_rails_on_which_nobody_is_to_be_warned() -> None:
    every = [*patches(), *rails()]
    assert {d.kind for d in every} == set(KINDS)
    assert len({d.scenario.train.axles[0].seed for d in every}) == len(every)
    boxes = {d.kind: d.scenario.train.axles[3].axlebox for d in every}
    assert {kind for kind, box in boxes.items() if box.joint_m_s2 > 0.0} == {JOINTS}


def run_of(drive: PatchRide, warns: Any, distance_m: Any, mu_pct: float = 5.0) -> PatchRecord:
    """10 m/s for 9 s, 4 % on the drive's patch and 20 % elsewhere. warns is of the time and of the way left to the
    patch, distance_m of the latter."""
    time_s = 0.005 * np.arange(1, 1801, dtype=np.float64)
    at_m = 10.0 * time_s[:, None] + np.array(PLACES_M)
    start_m, end_m = drive.start_m, drive.end_m
    on = np.zeros(at_m.shape, bool) if start_m is None else (at_m >= start_m) & (at_m < end_m)
    frames_s = FRAME_S * np.arange(1, 450, dtype=np.float64)
    seen = []
    for k, place in enumerate(PLACES_M):
        left_m = (start_m or 0.0) - (10.0 * frames_s + place)
        told = np.asarray(warns(frames_s, left_m), bool) & (k > 0)
        number = np.where(told, distance_m(left_m), np.nan)
        seen.append(AheadFrames(frames_s, told, told, np.where(told, mu_pct, np.nan), number))
    return PatchRecord(drive, tuple(seen), 10.0 * time_s, np.where(on, 4.0, 20.0), 0, True)


@pytest.fixture(scope="module")
def patch() -> PatchRide:
    """From 40 to 60 m: axle 1 is on it after 4 s, axle 4 after 6.15 s."""
    return replace(next(patches()), start_m=40.0, end_m=60.0)


def ahead(left_m: Any) -> Any:
    return np.maximum(left_m, 0.0)


def elsewhere(left_m: Any) -> Any:
    return ahead(left_m) + 3.5


@pytest.mark.parametrize(
    ("warns", "place", "leads_s", "error_m"),
    [
        (lambda t, left: (t > 4.1) & (left > -5.0), ahead, [0.13, 1.78, 2.03], 0.0),
        (lambda t, left: left <= 1e-6, ahead, [math.nan] * 3, 0.0),  # at the entry: too late
        (lambda t, left: (t > 4.1) & (left > 0.5), ahead, [math.nan] * 3, 0.0),  # withdrawn
        (lambda t, left: t > 4.1, elsewhere, [math.nan] * 3, 3.5),  # of another place
    ],
)
def test_lead_is_counted_from_the_frame_that_warned_of_this_place_until_the_axle_is_there(
    patch: PatchRide, warns: Any, place: Any, leads_s: list[float], error_m: float
) -> None:
    found = entries(run_of(patch, warns, place))
    assert [e.lead_s for e in found] == pytest.approx(leads_s, abs=1e-6, nan_ok=True)
    assert all(np.allclose(e.errors_m, error_m) for e in found)
    assert all(math.isnan(e.reported_pct) or e.reported_pct - e.true_pct == 1.0 for e in found)


@pytest.mark.parametrize("told_m", [0.0, 2.0, 15.0])
def test_daemon_that_always_warns_warns_nobody(patch: PatchRide, told_m: float) -> None:
    always = run_of(patch, lambda t, left: np.ones(len(t), bool), lambda left: np.full(len(left), told_m))
    assert [math.isnan(e.lead_s) for e in entries(always)] == [True] * 3
    count, seconds = false_warnings(always)
    assert count >= 1
    assert seconds > 2.0


def test_warning_after_the_patch_is_false(patch: PatchRide) -> None:
    late = run_of(patch, lambda t, left: (t >= 6.59) & (t < 6.69), lambda left: np.full(len(left), 20.0))
    count, seconds = false_warnings(late)
    assert count == 1
    assert seconds == pytest.approx(0.1)


def test_low_adhesion_told_of_a_good_rail_is_counted(patch: PatchRide) -> None:
    told, false = false_lows(run_of(patch, lambda t, left: (t > 4.1) & (left > -5.0), ahead))
    assert (told > 100, false) == (True, 0)
    rise = replace(next(d for d in rails() if d.kind == RISE), speed_m_s=10.0)
    told, false = false_lows(run_of(rise, lambda t, left: (t > 1.0) & (t < 2.0), lambda left: np.full(len(left), 30.0)))
    assert told == false > 100
    assert false_lows(run_of(rise, lambda t, left: t > 1.0, lambda left: np.full(len(left), 30.0), 9.0)) == (0, 0)


def test_axle_that_never_comes_is_counted_apart(patch: PatchRide) -> None:
    short = run_of(patch, lambda t, left: t > 4.1, ahead)
    short = replace(short, way_m=short.way_m[:1000], mu_pct=short.mu_pct[:1000])  # 50 m
    assert math.isnan(enters_s(short, 3))
    result = judge([short])
    assert [f["never_there"] for f in result["axles"].values()] == [0, 1, 1]
    assert result["false_warnings"]["all"]["hours"] == pytest.approx(5.0 / 3600)
    assert "never came to: 0, 1, 1." in sections(result)[0].about


def test_report_counts_what_was_told(played: PatchRecord) -> None:
    nothing = replace(played.seen[1], warns=np.zeros_like(played.seen[1].warns))
    missed = replace(played, drive=replace(played.drive, number=1), seen=(played.seen[0], nothing, *played.seen[2:]))
    result = judge([played, missed])
    assert [result["axles"][a]["all"]["warned"].value for a in ("2", "3")] == [0.5, 1.0]
    assert math.isnan(result["axles"]["2"]["speeds"]["5"]["warned"].value)
    assert [g["verdict"] for g in result["goals"][:6]] == ["too few to judge"] * 6
    assert result["false_warnings"]["all"]["per_hour"].high > 100.0  # none in two runs of 5 s shows little
    assert any(line.startswith("| 2 | 50.0") for line in markdown(sections(result)))


@pytest.mark.usefixtures("jobs_here")
def test_run_that_fails_is_missing_by_name(tmp_path: Path) -> None:
    played, missing = play_all([next(rails())], 1, tmp_path / "none.json")
    assert played == []
    assert [(m.piece.suite, m.piece.name) for m in missing] == [("fusion", "unchanging, run 0")]
    assert "none.json" in missing[0].why


@pytest.mark.parametrize("option", [["--html", "x.html"], ["--beside", "a=b"]])
def test_suite_compares_no_estimates(option: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", "--suite", "fusion", *option]) == 2
    assert f"{option[0]}: is not of the suite fusion" in capsys.readouterr().err
