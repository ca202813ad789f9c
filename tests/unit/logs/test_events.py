"""`wrcd replay --events`: from a log the rows that were live, beside the others, and of several logs."""

import csv
import io
from pathlib import Path

import pytest

from tests.support.can_ids import YAW_RATE_A1
from tests.support.recorded_train import RecordedTrain, second_sender, spoiler
from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.core.configuration import Config
from wrcd.core.events import COLUMNS, csv_line
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture(scope="module")
def faulty(config: Config, tmp_path_factory: pytest.TempPathFactory) -> tuple[RecordedTrain, Path]:
    """Eight seconds with faults, and their log: what came, and what the daemon sent beside it."""
    folder = tmp_path_factory.mktemp("bus")
    train, came = RecordedTrain(config, folder), list[Frame]()

    def noted(frames: list[Frame]) -> list[Frame]:
        came.extend(frames)
        return frames

    train.run(1500, noted)
    train.sim.silent = {YAW_RATE_A1}
    train.run(300, noted)
    train.sim.silent = set()
    train.run(1500, noted)
    train.run(200, lambda frames: noted([f for frame in frames for f in (frame, second_sender(frame))]))
    train.run(1500, noted)
    train.sim.spike = 1_000_000
    train.run(40, noted)
    train.sim.spike = 0
    train.run(1500, noted)
    log = folder / "faulty.log"
    lines = sorted([*came, *train.link.sent], key=lambda f: f.stamp_us)
    log.write_text("".join(format_line(f, "vcan0") + "\n" for f in lines))
    train.recorder.close(train.now())  # it has begun a dump
    return train, log


def test_replay_of_a_log_gives_the_rows_that_were_live(faulty: tuple[RecordedTrain, Path], tmp_path: Path) -> None:
    """By columns, sixteen slots at once; the daemon's own frames in the log are neither inputs nor rivals."""
    train, log = faulty
    live = "".join([csv_line(COLUMNS), *(c.csv_line for c in train.sim.core.events.since(0))])
    every = [word for axle in "1234" for word in ("--axle", axle)]  # of which three have not one frame
    outputs = ["-o", str(tmp_path / "out.log"), "--events", str(tmp_path / "events.csv")]
    assert main(["replay", str(log), *every, *outputs]) == 0
    assert (tmp_path / "events.csv").read_text() == live
    causes = [r["cause"] for r in rows(live) if r["axle"] == "1"]
    assert causes == [
        "WarmingUp", "", "InputStale", "InputSilent", "WarmingUp", "", "TwoSenders", "InputStale", "InputSilent",
        "WarmingUp", "", "Restarted", "",
    ]  # fmt: skip
    assert {r["axle"] for r in rows(live)} == {"1", "2", "3", "4"}
    assert train.link.health.foreign_frames == 0


def test_dump_has_the_rows_that_its_replay_gives(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path / "dumps", seconds=9.0)
    train.run(2000, spoiler(1))
    train.sim.silent = {YAW_RATE_A1}
    train.run(700)
    train.sim.silent = set()
    log = train.asked(spoiler(2))
    every = [word for axle in "1234" for word in ("--axle", axle)]  # of which three have not one frame
    assert main(["replay", str(log), "-o", str(tmp_path / "out.log"), "--events", str(tmp_path / "e.csv"), *every]) == 0
    since, *written = rows(log.with_suffix(".events.csv").read_text())
    assert written == rows((tmp_path / "e.csv").read_text())
    assert {"InputSilent", "WarmingUp", "InputStale", ""} <= {r["cause"] for r in written}
    # it has begun with the daemon, and forgotten nothing
    assert (since["time_s"], since["axle"]) == ("1700000000.001000", "")


def test_rows_go_to_the_screen_in_place_of_the_others(
    faulty: tuple[RecordedTrain, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, log = faulty
    assert main(["replay", str(log), "--events", "-"]) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[0] == ",".join(COLUMNS)
    assert len(rows(shown)) > 12
    assert main(["replay", str(log), "--events", str(tmp_path / "e.csv"), "--csv", str(tmp_path / "t.csv")]) == 0
    assert capsys.readouterr().out == ""
    assert (tmp_path / "e.csv").read_text() == shown
    assert len((tmp_path / "t.csv").read_text().splitlines()) > 300
    assert main(["replay", str(log), "--events", "-", "--explain"]) == 2
    assert "--events: " in capsys.readouterr().err


def test_rows_are_of_the_axles_and_the_time_that_are_asked_for(
    faulty: tuple[RecordedTrain, Path], tmp_path: Path
) -> None:
    train, log = faulty
    changes = train.sim.core.events.since(0)
    begin_us, end_us = changes[5].time_us, changes[-1].time_us
    asked = [c for c in changes if c.axle == 1 and begin_us <= c.time_us < end_us]
    assert 0 < len(asked) < len([c for c in changes if c.axle == 1])
    out = tmp_path / "events.csv"
    first_us = next(f.stamp_us for f, _ in read_log(log, Damage()))
    part = [f"{(us - first_us) * 1e-6:.6f}" for us in (begin_us, end_us)]
    options = ["--relative", "--from", part[0], "--to", part[1], "--axle", "1", "--events", str(out)]
    assert main(["replay", str(log), *options]) == 0
    found = rows(out.read_text())
    assert [(r["axle"], r["to"]) for r in found] == [("1", c.after.value) for c in asked]
    assert found[0]["time_s"] == f"{(asked[0].time_us - first_us) / 1e6:.6f}"
