"""The flight recorder: when it writes a dump, what is in it, and what a replay makes of it."""

import csv
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1, LAT_ACCEL_A1, VEHICLE_SPEED, WRCD_LINK, WRCD_STATUS, YAW_RATE_A1
from tests.support.recorded_train import RecordedTrain, sent_and_replayed, spoiler
from tests.support.rig_frames import ticks_of
from tests.support.scripted_link import ScriptedLink
from wrcd.bus.candump import parse_line
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.config.config import DEFAULT, load_config, packaged
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config, RecorderConfig
from wrcd.core.core import Core
from wrcd.core.reports import Report
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.recorder.dump_folder import dump_name
from wrcd.recorder.recorder import LOST_SLOTS, PRE_ROLL_S, LossOfValidity, Recorder
from wrcd.service.loop import Daemon

THIRD_PARTY = Path(__file__).parents[2] / "data/dbc/third-party.toml"
SLOT_US = 20_000


def frames_of(log: Path) -> list[Frame]:
    return [f for f, _ in read_log(log, Damage())]


def equal_since_us(log: Path) -> int:
    """From when on a replay is said to make what was sent."""
    first = next(csv.DictReader(log.with_suffix(".events.csv").read_text().splitlines()))
    assert first["axle"] == ""
    return round(float(first["time_s"]) * 1e6)


def test_replay_of_a_dump_makes_what_was_sent_after_the_pre_roll(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A daemon that has run for longer than its ring, on a spoilt bus."""
    train = RecordedTrain(config, tmp_path / "dumps", seconds=PRE_ROLL_S + 10.0)
    train.run(5_000, spoiler(1))
    train.run(round(PRE_ROLL_S * 1000) + 10_000, spoiler(2))
    log = train.asked(spoiler(3))
    since_us, recorded = equal_since_us(log), frames_of(log)
    assert since_us == recorded[0].stamp_us + round(PRE_ROLL_S * 1e6)
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    own, made = ([f for f in of if f.stamp_us >= since_us and not counts(f)] for of in (sent, replayed))
    assert own == made
    assert len([f for f in own if f.can_id == ADHESION_A1]) > 9.0 * 50
    assert any(f.data[1] >> 4 == 1 for f in own if f.can_id == ADHESION_A1)


def counts(f: Frame) -> bool:
    """Whether it tells what there was since the daemon's start."""
    return f.can_id in (WRCD_STATUS, WRCD_LINK)


@pytest.mark.parametrize("file", [None, THIRD_PARTY], ids=["packaged", "own DBC with CAN FD"])
def test_dump_since_the_start_replays_to_every_frame_that_was_sent(
    config: Config, tmp_path: Path, file: Path | None
) -> None:
    used = load_config(file) if file else config
    core, link, said = Core(used), ScriptedLink(), list[str]()
    now = 0
    kept = Recorder(RecorderConfig(tmp_path, 5.0, 20, 200.0), core, "vcan0", said.append)
    daemon = Daemon(core, link, clock=lambda: now, steady=lambda: now, recorder=kept)
    for tick in ticks_of(used, 3.5):
        link.waiting += tick
        now = tick[0].stamp_us // 5_000 * 5_000 + 6_000
        daemon.turn()
    kept.ask()
    kept.close(now)
    (log,) = tmp_path.glob("*-asked.log")
    recorded = frames_of(log)
    assert equal_since_us(log) == recorded[0].stamp_us
    options = ["--config", str(file)] if file else []
    assert main(["replay", str(log), "-o", str(tmp_path / "out.log"), *options]) == 0
    assert frames_of(tmp_path / "out.log") == link.sent
    assert len(link.sent) > 100
    assert {len(f.data) for f in recorded if f.fd} == ({12} if file else set())


def test_dump_is_a_log_in_order_with_directions(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(1500, spoiler(4))
    log = train.asked()
    own = {f.key for f in train.link.sent}
    lines = [line for line in log.read_bytes().splitlines() if b"#R" not in line]
    read = [(parsed[0], line[-2:]) for line in lines if (parsed := parse_line(line)) is not None]
    assert len(read) == len(lines)
    assert {mark for f, mark in read if f.key in own} == {b" T"}
    assert {mark for f, mark in read if f.key not in own} == {b" R"}
    stamps = [f.stamp_us for f, _ in read]
    assert stamps == sorted(stamps)


def test_ring_is_bounded_in_seconds_and_in_frames(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path, seconds=3.0)
    train.run(6000)
    frames = frames_of(train.asked())
    assert 2.9 < (frames[-1].stamp_us - frames[0].stamp_us) * 1e-6 <= 4.1
    flooded = RecordedTrain(config, tmp_path / "flooded", seconds=3.0)
    numbers = iter(range(1 << 30))

    def flood(own: list[Frame]) -> list[Frame]:  # 12 000 frames/s, three times what there is room for
        stamp_us = own[-1].stamp_us
        return own + [Frame(stamp_us, 0x500, next(numbers).to_bytes(4, "big")) for _ in range(60)]

    flooded.run(3000, flood)
    frames = frames_of(flooded.asked(flood))
    assert 0.8 < (frames[-1].stamp_us - frames[0].stamp_us) * 1e-6 < 1.2
    seen = [int.from_bytes(f.data) for f in frames if f.can_id == 0x500]
    assert seen == list(range(seen[0], seen[-1] + 1))  # the newest, without a gap
    assert seen[-1] > next(numbers) - 12_000


def test_ring_has_room_for_eight_axles(tmp_path: Path) -> None:
    """The packaged DBC's rates: 4600 frames a second."""
    file = tmp_path / "eight.toml"
    file.write_text(packaged(8))
    train = RecordedTrain(load_config(file), tmp_path / "dumps", seconds=3.0)

    def every_axle(frames: list[Frame]) -> list[Frame]:
        """Axle 1's frames for the others too, each under its own data id."""
        others = [replace(f, can_id=f.can_id + k) for f in frames if f.can_id != VEHICLE_SPEED for k in range(1, 8)]
        return frames + [replace(f, data=protect(f.data, f.can_id, f.data[1] & 0x0F)) for f in others]

    train.run(2500, every_axle)
    log = train.asked(every_axle)
    recorded = frames_of(log)
    assert (recorded[-1].stamp_us - recorded[0].stamp_us) * 1e-6 > 2.9
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log", "--config", str(file))
    assert len([f for f in replayed if f.can_id == ADHESION_A1 + 7 and f.data[1] >> 4 == 1]) > 50
    assert {f.key for f in replayed} == {f.key for f in sent}


def test_dump_of_nothing_is_said(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    train.recorder.ask()
    train.recorder.close(train.now())
    assert "not written: no frame in the last 3 s" in train.said[0]
    assert list(tmp_path.iterdir()) == []


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
    assert frames_of(log)[-1].stamp_us - lost_us == pytest.approx(2_150_000, abs=60_000)
    # at most one in half a minute, whatever happens
    train.run(1200)
    train.sim.silent = {YAW_RATE_A1}
    train.run(2500)
    assert (len(train.said), train.recorder._child) == (1, None)
    train.sim.silent = set()
    train.sim.t += 25_000_000
    train.run(1500)
    train.sim.silent = {YAW_RATE_A1}
    train.run(3000)
    assert len(train.dumps(2)) == 2


def test_lost_frames_are_a_loss_of_validity(config: Config, tmp_path: Path) -> None:
    """Two frames of four of both sensors are lost, never for as long as their time-out."""
    train = RecordedTrain(config, tmp_path)
    train.run(2500)
    for k in range(600):
        train.sim.silent = {YAW_RATE_A1, LAT_ACCEL_A1} if k % 4 < 2 else set()
        train.run(5)
    assert {c.cause for c in train.sim.core.events.since(0) if c.after is Validity.DEGRADED} == {Cause.TOO_LITTLE_DATA}
    assert "-validity.log" in train.dumps(1)[0].name


def test_hiccup_short_window_and_standstill_are_no_loss_of_validity(config: Config) -> None:
    nothing = Report(Validity.NOT_AVAILABLE, None, None, 255, "Unknown", "Unknown", "None", Cause.NONE)
    valid = replace(nothing, validity=Validity.VALID, mu_available_pct=20.0)
    hiccup = replace(valid, validity=Validity.DEGRADED, cause=Cause.CONTRADICTION)
    short = replace(nothing, cause=Cause.TOO_LITTLE_DATA, short=True)
    loss = LossOfValidity([SLOT_US])
    looks = [*[(valid, False)] * 50, *[(hiccup, False)] * LOST_SLOTS, (valid, False), *[(short, False)] * 50]
    looks += [(valid, False), *[(hiccup, True)] * 50, *[(hiccup, False)] * 50]  # it stands, and goes on
    looks += [*[(valid, False)] * 50, *[(hiccup, False)] * 50]
    found = [k for k, (report, stands) in enumerate(looks) if loss.look([report], stands, k * SLOT_US)]
    assert found == [len(looks) - 50 + LOST_SLOTS]


def test_stopping_train_triggers_no_dump(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    train.run(2000)
    assert train.sim.core.reports[0].validity == "Valid"
    while train.sim.speed > 1.0:
        train.sim.speed -= 0.2
        train.run(20)
    train.run(3000)
    assert train.sim.core.reports[0].validity == "NotAvailable"
    assert train.said == []
    assert list(tmp_path.iterdir()) == []


def test_sigusr1_dumps_each_time_but_one_at_a_time(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    before = signal.signal(signal.SIGUSR1, train.daemon.on_signal)
    try:
        train.run(1500)
        os.kill(os.getpid(), signal.SIGUSR1)
        train.run(1000)
        os.kill(os.getpid(), signal.SIGUSR1)  # while the first one waits for what comes after it
        train.run(1500)
        assert len(train.dumps(2)) == 2  # a person need not wait half a minute
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert {log.stem.rpartition("-")[2] for log in train.dumps(2)} == {"asked"}


@pytest.mark.parametrize("asked", [False, True])
def test_end_of_the_daemon_writes_what_is_pending_and_nothing_else(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: bool
) -> None:
    train = RecordedTrain(config, tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    turns = iter(range(300))

    def poll() -> None:
        train.run(5)
        if (turn := next(turns)) == 290 and asked:
            train.daemon.on_signal(signal.SIGUSR1, None)
        if turn == 299:
            train.daemon.on_signal(signal.SIGTERM, None)

    monkeypatch.setattr(train.daemon, "poll", poll)
    train.daemon.run()
    logs = list(tmp_path.glob("*.log"))
    assert len(logs) == asked
    for log in logs:
        sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
        assert replayed == sent[:-5]
        # the last frames are in it, too: NotAvailable of every axle, and Stopping
        assert [f.data[1] >> 4 & 3 for f in sent[-5:]] == [0, 0, 0, 0, 3]


def test_recorder_configuration_sets_folder_seconds_and_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from wrcd.config.describe import describe

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
    usual = given("").recorder
    assert usual.folder == tmp_path / "a"
    assert usual.seconds > PRE_ROLL_S
    assert not given("seconds = 0").recorder.on
    for text, says in (("max_files = 0", "max_files"), ("secondes = 1", "seconds"), ("max_mb = 0.1", "max_mb")):
        with pytest.raises(InputError, match=says):
            given(text)
