"""What a dump is written for: lost Validity, collapse of adhesion, a signal, the end of the daemon."""

import os
import signal
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1, LAT_ACCEL_A1, YAW_RATE_A1
from tests.support.recorded_train import RecordedTrain, sent_and_replayed
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.messages import NOT_AVAILABLE_REPORT, Report
from wrcd.core.slot import SlotReports
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.recorder.dump_folder import dump_name
from wrcd.recorder.recorder import LOST_SLOTS, Triggers


def test_loss_of_validity_is_dumped_with_its_post_trigger_time(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(3000)
    lost_us = train.now()
    train.sim.silent = {YAW_RATE_A1}
    train.run(1000)
    train.sim.silent = set()
    assert train.said == []
    train.run(1200)
    (log,) = train.dumps()
    assert log.name.endswith("-validity.log")
    assert dump_name("vcan0", lost_us, "validity") <= log.stem <= dump_name("vcan0", lost_us + 1_000_000, "validity")
    frames = [f for f, _ in read_log(log, Damage())]
    assert frames[-1].stamp_us - lost_us == pytest.approx(2_150_000, abs=60_000)  # time-out, five slots, aftermath
    # at most one in half a minute, whatever happens
    train.run(1200)
    train.sim.silent = {YAW_RATE_A1}
    train.run(2500)
    assert len(train.said) == 1
    train.sim.silent = set()
    train.sim.t += 25_000_000
    train.run(1500)
    train.sim.silent = {YAW_RATE_A1}
    train.run(3000)
    assert len(train.dumps(2)) == 2


def test_short_contradiction_is_no_loss_of_validity(config: Config) -> None:
    """An estimate that contradicts itself for a few slots."""
    valid = replace(NOT_AVAILABLE_REPORT, validity=Validity.VALID, mu_available_pct=20.0)
    hiccup = replace(valid, validity=Validity.DEGRADED, cause=Cause.CONTRADICTION)
    triggers = Triggers([config.axles[0].adhesion.cycle_us])
    for _ in range(3):
        assert {triggers.look([r], False, [0]) for r in [valid] * 50 + [hiccup] * (LOST_SLOTS - 1)} == {""}
    assert [triggers.look([r], False, [0]) for r in [valid] + [hiccup] * LOST_SLOTS][-2:] == ["", "validity"]


def test_lost_frames_are_a_loss_of_validity_and_too_little_track_is_none(config: Config, tmp_path: Path) -> None:
    """Two frames of four of both sensors are lost, never for as long as their time-out."""
    train = RecordedTrain(config, tmp_path)
    train.run(2500)
    for k in range(600):
        train.sim.silent = {YAW_RATE_A1, LAT_ACCEL_A1} if k % 4 < 2 else set()
        train.run(5)
    assert {c.cause for c in train.sim.core.events.since(0) if c.after is Validity.DEGRADED} == {Cause.TOO_LITTLE_DATA}
    assert "-validity.log" in train.dumps(1)[0].name

    short = replace(NOT_AVAILABLE_REPORT, cause=Cause.TOO_LITTLE_DATA, short=True)
    valid = replace(NOT_AVAILABLE_REPORT, validity=Validity.VALID, mu_available_pct=20.0)
    triggers = Triggers([config.axles[0].adhesion.cycle_us])
    assert {triggers.look([r], False, [0]) for r in [valid] * 50 + [short] * 3 * LOST_SLOTS} == {""}


def test_stopping_train_triggers_no_dump(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(2000)
    assert train.sim.core.reports[0].validity == "Valid"
    while train.sim.speed > 1.0:
        train.sim.speed -= 0.2
        train.run(20)
    train.run(3000)
    assert train.sim.core.reports[0].validity == "NotAvailable"
    assert train.recorder.pending_trigger is None
    assert not train.recorder.is_writing
    assert train.said == []
    assert list(tmp_path.iterdir()) == []


def test_each_slot_of_a_turn_is_looked_at(config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(2000)
    looked: list[Sequence[Report]] = []

    def look(reports: Sequence[Report], below_min_speed: bool, axles: Sequence[int]) -> str:
        assert (below_min_speed, tuple(axles)) == (False, tuple(range(len(config.axles))))
        looked.append(reports)
        return "collapse" if len(looked) == 1 else ""

    monkeypatch.setattr(train.recorder._triggers, "look", look)
    for _ in range(20):
        train.link.waiting += train.sim.frames()
    train.daemon.turn()  # a late one: 100 ms
    assert len(looked) >= 4
    assert looked[-1] is train.sim.core.reports
    assert train.recorder.pending_trigger == "collapse"
    train.daemon.turn()
    assert len({id(reports) for reports in looked}) == len(looked)


def test_collapse_of_adhesion_is_dumped(config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(2000)
    core = train.sim.core
    report = core.reports[0]
    assert report.validity == "Valid"

    def says(mu: float, ms: int) -> None:
        for _ in range(ms // 20):
            train.run(20)
            reports = [replace(report, mu_available_pct=mu), *core.reports[1:]]
            with monkeypatch.context() as m:
                m.setattr(core, "take_reports", partial(list, [SlotReports(reports, (0,), False)]))
                train.recorder.turn(train.now())

    says(30.0, 1200)
    says(16.0, 200)  # a good half
    assert train.recorder.pending_trigger is None
    says(14.0, 20)
    assert train.recorder.pending_trigger is not None
    train.run(2200)
    (log,) = train.dumps()
    assert log.name.endswith("-collapse.log")


def test_slow_fall_of_adhesion_is_no_collapse(config: Config) -> None:
    valid = replace(NOT_AVAILABLE_REPORT, validity=Validity.VALID)
    triggers = Triggers([config.axles[0].adhesion.cycle_us])
    mu = 40.0
    while mu > 3.0:
        assert triggers.look([replace(valid, mu_available_pct=mu)], False, [0]) == ""
        mu *= 0.987  # a half in 1.06 s
    assert triggers.look([replace(valid, mu_available_pct=mu / 2)], False, [0]) == "collapse"


def test_sigusr1_dumps_at_once_each_time(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    before = signal.signal(signal.SIGUSR1, train.daemon.on_signal)
    try:
        train.run(1500)
        os.kill(os.getpid(), signal.SIGUSR1)
        train.run(2500)
        (log,) = train.dumps()
        os.kill(os.getpid(), signal.SIGUSR1)  # a person need not wait half a minute
        train.run(2500)
        assert len(train.dumps(2)) == 2
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert log.name.endswith("-asked.log")


@pytest.mark.parametrize("breaks", [False, True], ids=["SIGTERM", "an exception"])
def test_end_of_the_loop_dumps_up_to_the_shutdown_frames(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, breaks: bool
) -> None:
    train = RecordedTrain(config, tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    turns = iter(range(300))

    def poll() -> None:
        train.run(5)
        if next(turns) == 299:
            if breaks:
                raise ZeroDivisionError
            train.daemon.on_signal(signal.SIGTERM, None)

    monkeypatch.setattr(train.daemon, "poll", poll)
    with pytest.raises(ZeroDivisionError) if breaks else nullcontext():
        train.daemon.run()
    (log,) = train.dumps()
    assert log.name.endswith("-exit.log")
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    assert replayed == sent[:-5]
    assert [f.data[1] >> 4 for f in sent if f.can_id == ADHESION_A1][-2:] == [1, 0]
    # the last frame of the daemon is in it, too: beside its State stands the Engine
    assert [f.data[1] >> 4 & 3 for f in sent[-5:]] == [0, 0, 0, 0, 3]
