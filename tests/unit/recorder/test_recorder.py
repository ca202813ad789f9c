"""The flight recorder: a replay of its dump is what was sent."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1, ADHESION_DETAIL_A1, VEHICLE_SPEED, WRCD_STATUS, id_of
from tests.support.recorded_train import RecordedTrain, exercise_all_state, sent_and_replayed, spoiler
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config, packaged
from wrcd.core.configuration import Config, RecorderConfig
from wrcd.errors import InputError


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


def test_dump_of_eight_axles_replays_to_what_was_sent(tmp_path: Path) -> None:
    """The ring has room for 4 600 frames a second."""
    config = tmp_path / "eight.toml"
    config.write_text(packaged(8))
    train = RecordedTrain(load_config(config), tmp_path / "dumps", seconds=3.0)

    def every_axle(frames: list[Frame]) -> list[Frame]:
        """Axle 1's frames for the others too, each under its own data id."""
        others = [replace(f, can_id=f.can_id + k) for f in frames if f.can_id != VEHICLE_SPEED for k in range(1, 8)]
        return frames + [replace(f, data=protect(f.data, f.can_id, f.data[1] & 0x0F)) for f in others]

    train.run(2500, every_axle)
    log = train.asked(every_axle)
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log", "--config", str(config))
    assert replayed == sent
    assert (sent[-1].stamp_us - sent[0].stamp_us) * 1e-6 > 2.9
    names = [f"{kind}_A{a}" for kind in ("Adhesion", "AdhesionDetail", "InputHealth") for a in range(1, 9)]
    assert {f.can_id for f in sent} == {id_of(n) for n in (*names, "WrcdStatus", "WrcdRejects", "WrcdLink")}
    assert Counter(f.data[1] >> 4 for f in sent if f.can_id == id_of("Adhesion_A8"))[1] > 50


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


def test_dump_of_a_bus_beyond_the_rings_capacity_replays(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path, seconds=0.6)
    noise = [Frame(0, 0x500 + i, bytes(8)) for i in range(60)]  # 12 000 frames/s
    train.run(1500)
    log = train.asked(lambda frames: frames + [replace(n, stamp_us=frames[-1].stamp_us) for n in noise])
    sent, replayed = sent_and_replayed(log, tmp_path / "out.log")
    assert replayed == sent
    assert 0.15 < (sent[-1].stamp_us - sent[0].stamp_us) * 1e-6 < 0.6


def test_recorder_configuration_sets_folder_seconds_and_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from wrcd.config.config import DEFAULT
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
    assert given("").recorder == RecorderConfig(tmp_path / "a", 60.0, 20, 200.0)
    assert not given("seconds = 0").recorder.on
    for text, says in (("max_files = 0", "max_files"), ("secondes = 1", "seconds"), ("max_mb = 0.1", "max_mb")):
        with pytest.raises(InputError, match=says):
            given(text)
