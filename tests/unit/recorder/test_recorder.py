"""The flight recorder: what it keeps, when it writes, and that a replay of its dump is what was sent."""

import os
import signal
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1, ADHESION_DETAIL_A1, UNMAPPED, WRCD_STATUS, YAW_RATE_A1
from tests.support.recorded_train import RecordedTrain, exercise_all_state, sent_and_replayed, spoiler
from tests.support.sensor_simulator import SensorSimulator
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, read_log
from wrcd.config import load_config
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config, RecorderConfig
from wrcd.core.core import Core
from wrcd.core.report import NOT_AVAILABLE_REPORT, Validity
from wrcd.errors import InputError
from wrcd.recorder.folder import dump_name
from wrcd.recorder.ring import RECEIVED, SENT, Overwritten, Ring
from wrcd.recorder.state_file import load
from wrcd.recorder.triggers import LOST_SLOTS, Triggers


def test_dump_replays_to_what_was_sent(config: Config, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    train = RecordedTrain(config, tmp_path / "dumps", seconds=9.0)
    exercise_all_state(train)
    log = train.asked(spoiler(2))
    last_us = train.now()
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    assert f"goes on from {log.stem}.state.json" in capsys.readouterr().err
    # a ring of nine seconds that has seen more than thirteen, from its oldest state on; a step of 100 s is among them,
    # and one of -10 s
    assert len([f for f in sent if f.can_id == ADHESION_A1]) > 8.0 * 45
    assert (sent[-1].stamp_us - sent[0].stamp_us) * 1e-6 > 95
    assert last_us - sent[-1].stamp_us < 1_000_000
    # what the late loop left out, because its slot was over, a replay makes; apart from that nothing more, nothing
    # less: what was sent by the clock alone and the state of the link, too
    went = {(f.can_id, f.stamp_us) for f in sent}
    left_out = [f for f in replayed if (f.can_id, f.stamp_us) not in went]
    assert len(left_out) in (0, train.sim.core.health.overruns)  # by how far back the dump reaches
    replayed = [f for f in replayed if f not in left_out]
    assert replayed == sent
    assert sent == [f for f in train.link.sent if f.stamp_us in {s.stamp_us for s in sent}]
    assert {f.can_id for f in sent} >= {ADHESION_A1, ADHESION_DETAIL_A1, WRCD_STATUS}
    assert Counter(f.data[1] >> 4 for f in sent if f.can_id == ADHESION_A1)[1] > 50


def test_dump_without_its_state_replays_to_something_else(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(4500, spoiler(1))
    log = train.asked()
    log.with_suffix(".state.json").unlink()
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    assert replayed[:500] != sent[:500]


def test_replay_differs_from_a_late_loop_by_skipped_slots_only(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path, seconds=6.0)
    train.run(2000)
    for _ in range(10):
        train.link.waiting += train.sim.frames()
        train.sim.t += 45_000  # the loop comes late
        train.daemon.turn()
        train.run(100)
    log = train.asked()
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    skipped = [f for f in replayed if f not in sent]
    assert [f for f in replayed if f not in skipped] == sent
    assert len(skipped) >= 50


def test_late_frames_replay_as_they_were_used(config: Config, tmp_path: Path) -> None:
    """Stamped before the kernel hands them over: the clock has closed their tick."""
    train = RecordedTrain(config, tmp_path, seconds=6.0)
    train.run(2500)
    kept: list[Frame] = []
    for n in range(200):
        kept += train.sim.frames()
        if n % 7 == 6:
            train.link.waiting, kept = kept, []
        train.daemon.turn()
    assert train.sim.core.counts.late > 100
    log = train.asked()
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    assert replayed == sent


def test_ring_overwrites_its_oldest_frames() -> None:
    ring = Ring(100)
    for i in range(250):
        ring.put_frame(SENT if i % 2 else RECEIVED, Frame(10**15 + i, i, bytes([i % 256]) * (i % 9)))
    assert not ring.holds(149)
    assert ring.holds(150)
    assert not ring.holds(150, 1)
    with pytest.raises(Overwritten):
        next(ring.since(149))
    assert [(k, f.can_id, f.stamp_us - 10**15, f.data) for k, f in ring.since(150)] == [
        (i % 2, i, i, bytes([i % 256]) * (i % 9)) for i in range(150, 250)
    ]


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0, UNMAPPED, b""),
        Frame(1, 0x1FFFFFFF, b"12345678", extended=True),
        Frame(2, 0x40, bytes(8), error=True),
        Frame(3, YAW_RATE_A1, b"", remote=True),
        Frame(4, YAW_RATE_A1, b"1234", fd=True),
    ],
)
def test_ring_keeps_every_frame_type(frame: Frame) -> None:
    ring = Ring(2)
    ring.put_frame(RECEIVED, frame)
    assert list(ring.since(0)) == [(RECEIVED, frame)]


def test_dump_of_a_bus_beyond_the_rings_capacity_replays(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path, seconds=0.6)
    noise = [Frame(0, 0x500 + i, bytes(8)) for i in range(60)]  # 12 000 frames/s
    train.run(1500)
    log = train.asked(lambda frames: frames + [replace(n, stamp_us=frames[-1].stamp_us) for n in noise])
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    assert replayed == sent
    assert 0.15 < (sent[-1].stamp_us - sent[0].stamp_us) * 1e-6 < 0.6


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
    triggers = Triggers(1, config.adhesion_cycle_us)
    for _ in range(3):
        assert {triggers.look([r], False) for r in [valid] * 50 + [hiccup] * (LOST_SLOTS - 1)} == {""}
    assert [triggers.look([r], False) for r in [valid] + [hiccup] * LOST_SLOTS][-2:] == ["", "validity"]


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


def test_collapse_of_adhesion_is_dumped(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(2000)
    core = train.sim.core
    report = core.reports[0]
    assert report.validity == "Valid"

    def says(mu: float, ms: int) -> None:
        for _ in range(ms // 20):
            train.run(20)
            core.reports = [replace(report, mu_available_pct=mu), *core.reports[1:]]
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
    from wrcd.recorder.triggers import Triggers

    core = Core(config)
    sim = SensorSimulator(config)
    sim.run(1500)
    report = next(r for r in sim.core.reports if r.validity == "Valid")
    triggers = Triggers(1, core.config.adhesion_cycle_us)
    mu = 40.0
    while mu > 3.0:
        assert triggers.look([replace(report, mu_available_pct=mu)], False) == ""
        mu *= 0.987  # a half in 1.06 s
    assert triggers.look([replace(report, mu_available_pct=mu / 2)], False) == "collapse"


def test_dump_after_a_reload_begins_with_the_new_limits(config: Config, tmp_path: Path) -> None:
    """After a reload a dump has what was sent under the limits of now, and replays with them alone."""
    train = RecordedTrain(config, tmp_path)
    train.run(2000)
    other = replace(config, min_speed_m_s=5.0)
    train.sim.core.reconfigure(other)
    train.run(500)
    log = train.asked()
    state = log.with_suffix(".state.json")
    with pytest.raises(InputError, match="min_speed_m_s differ"):
        load(state, Core(config))
    load(state, Core(other))
    sent = [f for f, _ in read_log(log, Damage()) if f.can_id == ADHESION_A1]
    assert (sent[-1].stamp_us - sent[0].stamp_us) * 1e-6 == pytest.approx(2.5, abs=0.05)


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


def test_sigterm_dumps_up_to_the_shutdown_frames(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = RecordedTrain(config, tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    turns = iter(range(300))

    def poll() -> None:
        train.run(5)
        if next(turns) == 299:
            train.daemon.on_signal(signal.SIGTERM, None)

    monkeypatch.setattr(train.daemon, "poll", poll)
    train.daemon.run()
    (log,) = train.dumps()
    assert log.name.endswith("-exit.log")
    sent = [f for f, _ in read_log(log, Damage()) if f.can_id == ADHESION_A1]
    assert sent[-2].data[1] >> 4 == 1
    assert sent[-1].data[1] >> 4 == 0  # the shutdown_frames


def test_exception_in_the_loop_dumps_up_to_the_shutdown_frames(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = RecordedTrain(config, tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    turns = iter(range(300))

    def poll() -> None:
        next(turns)
        train.run(5)

    monkeypatch.setattr(train.daemon, "poll", poll)
    with pytest.raises(StopIteration):
        train.daemon.run()
    sent, replayed = sent_and_replayed(train.dumps()[0], tmp_path / "out.log")
    assert replayed == sent[:-5]
    assert [f.data[1] >> 4 for f in sent[-5:]] == [0, 0, 0, 0, 3]  # the shutdown_frames is in it, too


def test_recorder_configuration_sets_folder_seconds_and_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from wrcd.config import DEFAULT
    from wrcd.tools.check import describe

    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    file = tmp_path / "my.toml"

    def given(text: str) -> Config:
        file.write_text(DEFAULT + "[recorder]\n" + text)
        return load_config(file)

    assert not load_config(None).recorder.on
    c = given('folder = "dumps"\nseconds = 30.0\nmax_files = 5\nmax_mb = 10')
    assert c.recorder == RecorderConfig(tmp_path / "dumps", 30.0, 5, 10.0)
    assert f"the last 30 s, dumps in {tmp_path / 'dumps'} (at most 5, 10 MB)" in "\n".join(describe(c))
    assert "recorder       none" in describe(given("seconds = 0"))[-2]
    monkeypatch.setenv("STATE_DIRECTORY", f"{tmp_path}/a:{tmp_path}/b")
    assert given("").recorder == RecorderConfig(tmp_path / "a", 60.0, 20, 200.0)
    assert not given("seconds = 0").recorder.on
    for text, says in (("max_files = 0", "max_files"), ("secondes = 1", "seconds"), ("max_mb = 0.1", "max_mb")):
        with pytest.raises(InputError, match=says):
            given(text)
