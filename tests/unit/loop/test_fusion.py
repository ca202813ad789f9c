"""Fusion along the vehicle on a real patch: told before the axles behind are on it, and the estimate as it was."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_ecu.cli import main
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.make import make_controller
from sim_ecu.loop.fusion.patches import HELD_PER_SPEED, PER_SPEED, PLACES_M, SPEEDS_M_S, Drive, patches, steady
from sim_ecu.loop.fusion.play import Played, play
from sim_ecu.loop.fusion.report import entries, judge, tables
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.play.play import LOG_START_US
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.config import load_packaged
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing
from wrcd.recorder.state import capture, encode, restore

TRAINING_SEED = 500
AHEAD, DETAIL = range(0xC1, 0xC5), range(0xA1, 0xA5)
FUSING, PLAIN = load_packaged(4, PLACES_M), load_packaged(4)


def shortened(drive: Drive, seconds: float) -> Drive:
    scenario = drive.scenario
    return replace(drive, scenario=replace(scenario, train=replace(scenario.train, duration_s=seconds)))


@pytest.fixture(scope="module")
def drive() -> Drive:
    """Onto a patch at 25 m/s, slipping."""
    at_25 = (d for d in patches(1.0, TRAINING_SEED) if d.speed_m_s == 25.0 and d.slides)
    return shortened(next(at_25), 5.3)


@pytest.fixture(scope="module")
def played(drive: Drive) -> Played:
    return play(drive, FUSING, PLAIN)


@pytest.fixture(scope="module")
def frames(drive: Drive) -> list[Frame]:
    """What the daemon hears in it."""
    out: list[Frame] = []
    controller = make_controller(drive.law, Facts.of(drive.scenario), None)
    run = Lockstep(
        drive.scenario, controller, None, lambda t, i, d: out.append(Frame(LOG_START_US + t, i, d)), sensors=True
    )
    while not run.over:
        run.step()
    return out


def test_axles_behind_are_warned_before_they_are_on_the_patch(played: Played) -> None:
    found = entries([played])
    assert [e.axle for e in found] == [2, 3, 4]
    assert all(e.lead_s > 0.0 for e in found)
    assert [e.confirmed for e in found[1:]] == [True, True]
    assert all(abs(e.distance_m) < 3.0 for e in found)


def test_estimate_is_the_same_with_fusion_and_without(played: Played) -> None:
    assert played.same


def test_rail_that_does_not_change_is_not_told() -> None:
    still = play(shortened(next(steady(1.0, TRAINING_SEED - 100_000 + 5)), 6.0), FUSING, PLAIN)
    assert not any(s.warns.any() for s in still.seen)
    assert np.isnan(still.enters_s).all()


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
    return told([o for f in frames for o in core.feed(f)])


def told(out: list[Outgoing]) -> list[Frame]:
    return [o.frame for o in out if o.frame.can_id in (*AHEAD, *DETAIL)]


def test_frames_held_back_are_the_frames_made_at_once(frames: list[Frame]) -> None:
    core = Core(FUSING)
    core.hold()
    held = [o for f in frames for o in core.feed(f)] + core.release()
    assert told(held) == sent(Core(FUSING), frames)


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
    assert len({d.scenario.train.axles[0].seed for d in (*every, *steady())}) == len(every) + len(list(steady()))
    assert not any(d.slides for d in every if d.held)


def test_report_counts_what_was_told(played: Played) -> None:
    nothing = replace(played.seen[1], warns=np.zeros_like(played.seen[1].warns))
    missed = replace(played, drive=replace(played.drive, number=1), seen=(played.seen[0], nothing, *played.seen[2:]))
    result = judge([played, missed], [])
    assert (result["axles"]["2"]["warned"].value, result["axles"]["3"]["warned"].value) == (0.5, 1.0)
    assert math.isnan(result["axles"]["2"]["speeds"]["5"]["warned"].value)
    assert [g["verdict"] for g in result["goals"][:3]] == ["too few to judge"] * 3
    lines = tables(result)
    assert any(line.startswith("| 2 | 50.0") for line in lines)


@pytest.mark.parametrize("option", [["--html", "x.html"], ["--beside", "a=b"], ["--baselines", "c"]])
def test_suite_compares_no_estimates(option: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", "--suite", "fusion", *option]) == 2
    assert f"{option[0]}: is not of the suite fusion" in capsys.readouterr().err
