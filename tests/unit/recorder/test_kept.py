"""What slides revealed outlasts the daemon: in a file, beside a dump, and into a replay."""

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.recorded_train import RecordedTrain
from wrcd.bus.candump import format_line
from wrcd.cli.main import main
from wrcd.config.config import load_packaged
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.slides import FORMAT, kept_text, slides_of, take_kept
from wrcd.errors import InputError
from wrcd.recorder.kept import EVERY_US, KeptSlides, make_kept

SUMS = (5.0, 2.25, 1.1)  # of five slides, whose bias is beyond doubt


@pytest.fixture
def core(config: Config) -> Core:
    return Core(config)


def kept(file: Path, core: Core, said: list[str]) -> KeptSlides:
    return KeptSlides(file, core.estimator, said.append)


def test_next_daemon_goes_on_from_what_the_last_one_kept(config: Config, core: Core, tmp_path: Path) -> None:
    file, said = tmp_path / "state" / "slides-can0.json", list[str]()
    first = kept(file, core, said)
    first.close()
    assert not file.exists()  # nothing is new
    core.estimator.take_slides(SUMS)
    first.close()
    after = Core(config)
    kept(file, after, said)
    assert after.estimator.slides == core.estimator.slides
    assert after.estimator.slides[:3] == SUMS
    assert slides_of(after.estimator).bias == pytest.approx(0.45)
    assert [f.name for f in file.parent.iterdir()] == [file.name]
    assert said == []


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[1]", "\x00" * 40, '{"format": "wrcd-slides/1"}',
        '{"format": "wrcd-slides/2", "design": "DESIGN", "slides": [5, 2.25, 1.1]}',
        f'{{"format": "{FORMAT}", "design": "a\\nb", "slides": [0, 0, 0]}}',
        *(f'{{"format": "{FORMAT}", "design": "DESIGN", "slides": {sums}}}' for sums in (
            "[NaN, 0, 0]", "[1e9, 0, 0]", "[-1, 0, 0]", "[5, 2.25]", "[5, 4, 1.1]", "[5, 2.25, 9]", '["a", 0, 0]',
            "[Infinity, 0, 0]", "null", '"500"', f"[{'9' * 401}, 0, 0]",
        )),
    ],
)  # fmt: skip
def test_damaged_file_is_left_aside_with_one_line(core: Core, tmp_path: Path, text: str) -> None:
    file, said = tmp_path / "slides-can0.json", list[str]()
    file.write_text(text.replace("DESIGN", core.config.design.checksum))
    kept(file, core, said)
    assert said == [f"{file}: is damaged, or no {FORMAT}: left aside as slides-can0.aside"]
    assert core.estimator.slides == (0.0, 0.0, 0.0, 0.0)
    assert [f.name for f in tmp_path.iterdir()] == ["slides-can0.aside"]


def test_file_of_another_design_is_left_aside(core: Core, tmp_path: Path) -> None:
    file, said = tmp_path / "slides-can0.json", list[str]()
    lone = load_packaged(4, "lone-wheelset")
    other = Core(lone)
    other.estimator.take_slides(SUMS)
    file.write_text(kept_text(other.estimator))
    kept(file, core, said)
    ours, theirs = core.config.design.checksum[:12], lone.design.checksum[:12]
    assert said == [f"{file}: is of the design {theirs}, not {ours}: left aside as slides-can0.aside"]
    assert core.estimator.slides[0] == 0.0


def test_file_that_cannot_be_read_or_written_stops_no_daemon(core: Core, tmp_path: Path) -> None:
    (tmp_path / "slides-can0.json").mkdir()
    said = list[str]()
    of = kept(tmp_path / "slides-can0.json", core, said)
    assert "cannot be read: Is a directory" in said[0]
    core.estimator.take_slides(SUMS)
    of.close()  # and leaves alone what it could not read
    assert len(said) == 1
    os.mkfifo(tmp_path / "pipe.json")
    kept(tmp_path / "pipe.json", core, said)
    assert "pipe.json: is damaged" in said[1]


def test_file_is_written_every_ten_minutes_in_which_it_has_changed(core: Core, tmp_path: Path) -> None:
    file, said = tmp_path / "slides-can0.json", list[str]()
    of = kept(file, core, said)
    of.turn(0)
    of.turn(EVERY_US)
    assert of._child is None  # nothing is new
    core.estimator.take_slides(SUMS)
    of.turn(2 * EVERY_US - 1)
    assert of._child is None
    of.turn(2 * EVERY_US)
    assert of._child is not None
    assert of._child.wait(60.0) == ""
    of.turn(2 * EVERY_US + 1)
    assert json.loads(file.read_text())["slides"] == list(SUMS)
    file.unlink()
    of.close()
    assert not file.exists()  # nothing is new
    assert said == []


def test_write_that_failed_is_tried_again(core: Core, tmp_path: Path) -> None:
    file, said = tmp_path / "folder" / "slides-can0.json", list[str]()
    of = kept(file, core, said)
    (tmp_path / "folder").write_text("no folder")
    core.estimator.take_slides(SUMS)
    of.turn(0)
    for turn in (1, 2):
        of.turn(turn * EVERY_US)
        assert of._child is not None
        of._child.wait(60.0)
        of.turn(turn * EVERY_US + 1)
        assert said == [f"{file}: not written: Not a directory"]  # once
    (tmp_path / "folder").unlink()
    of.close()
    assert json.loads(file.read_text())["slides"] == list(SUMS)


def test_dump_has_the_state_at_its_beginning_and_a_replay_takes_it(config: Config, tmp_path: Path) -> None:
    """The frames of the daemon itself: of one that begins with the log, with slides from before."""
    train = RecordedTrain(config, tmp_path / "dumps", seconds=30.0)
    estimator = train.sim.core.estimator
    estimator.take_slides(SUMS)
    train.recorder._states[0] = 0, kept_text(estimator)  # a daemon takes them before it has a recorder
    train.run(4000)
    estimator.take_slides((6.0, 2.7, 1.3))
    train.run(500)
    log = train.asked()
    state = log.with_suffix(".state.json")
    assert json.loads(state.read_text())["slides"] == list(SUMS)
    sent = [f for f in train.link.sent if f.stamp_us < train.sim.t - 3_000_000]

    def replayed(*options: str) -> set[str]:
        out = tmp_path / "out.log"
        assert main(["replay", str(log), "-o", str(out), *options]) == 0
        return set(out.read_text().splitlines())

    lines = {format_line(f, "vcan0") for f in sent}
    assert lines <= {line.removesuffix(" T") for line in replayed("--state", str(state))}
    assert not lines <= {line.removesuffix(" T") for line in replayed()}


def test_replay_refuses_a_state_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = Path("tests/golden/leaf-film.log")
    assert main(["replay", str(log), "--state", str(tmp_path / "no.json")]) == 2
    assert "no.json: cannot be read: No such file or directory" in capsys.readouterr().err
    (tmp_path / "some.json").write_text("{}")
    assert main(["replay", str(log), "--state", str(tmp_path / "some.json")]) == 2
    assert f"some.json: is damaged, or no {FORMAT}" in capsys.readouterr().err


def test_why_and_report_take_the_state(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As a replay does: slides that showed more than the words before them widen the interval."""
    log, core, state = "tests/golden/leaf-film.log", Core(load_packaged(4)), tmp_path / "ride.state.json"
    core.estimator.take_slides((6.0, 2.7, 1.3))
    state.write_text(kept_text(core.estimator))

    def half_width(*options: str) -> float:
        assert main(["why", log, "2", "--axle", "1", "--json", *options]) == 0
        now = json.loads(capsys.readouterr().out)["axles"][0]["now"]
        return float(now["high_pct"] - now["low_pct"]) / 2.0

    assert half_width("--state", str(state)) > 1.1 * half_width()
    assert main(["report", log, "--state", str(state), "-o", str(tmp_path / "page.html")]) == 0
    assert main(["why", log, "4", "--state", str(tmp_path / "no.json")]) == 2
    assert "no.json: cannot be read" in capsys.readouterr().err
    assert main(["replay", log, "-o", str(tmp_path / "sent.log")]) == 0
    sent = str(tmp_path / "sent.log")
    assert main(["why", sent, "2", "--axle", "1"]) == 0
    assert "frames of the log" in capsys.readouterr().out
    assert main(["why", sent, "2", "--axle", "1", "--state", str(state)]) == 2  # estimated, and of no input
    assert "has neither a frame of wrcd nor one of a mapped input" in capsys.readouterr().err


@pytest.mark.parametrize("log", [0.7, -0.7, math.fsum([0.7] * 3) / 3, 0.1 + 0.2])
def test_sums_of_any_number_of_slides_are_taken(core: Core, tmp_path: Path, log: float) -> None:
    weight = total = squares = 0.0
    for _ in range(300):
        weight, total, squares = 0.98 * weight + 1.0, 0.98 * total + log, 0.98 * squares + log * log
        core.estimator.take_slides((weight, total, squares))
        take_kept(core.estimator, kept_text(core.estimator), tmp_path)


def test_daemon_keeps_as_it_turns_and_as_it_ends(config: Config, tmp_path: Path) -> None:
    train, said = RecordedTrain(config, tmp_path / "dumps"), list[str]()
    of = KeptSlides(tmp_path / "slides-can0.json", train.sim.core.estimator, said.append)
    train.daemon._kept = of
    train.run(100)
    assert of._next_us is not None
    train.sim.core.estimator.take_slides(SUMS)
    train.daemon.on_signal(15)
    train.daemon.run()
    assert json.loads((tmp_path / "slides-can0.json").read_text())["slides"] == list(SUMS)


def test_daemon_begins_with_what_is_kept(config: Config, tmp_path: Path) -> None:
    core = Core(replace(config, recorder=replace(config.recorder, folder=tmp_path)))
    core.estimator.take_slides(SUMS)
    (tmp_path / "slides-can_0.json").write_text(kept_text(core.estimator))
    after, said = Core(core.config), list[str]()
    assert make_kept(after, "can:0", said.append) is not None
    assert after.estimator.slides == core.estimator.slides
    assert make_kept(Core(replace(config, recorder=replace(config.recorder, folder=None))), "can0", said.append) is None


def test_several_logs_begin_with_no_one_state(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, text = "tests/golden/leaf-film.log", kept_text(Core(load_packaged(1)).estimator)
    (tmp_path / "s.json").write_text(text)
    assert main(["replay", log, log, "--state", str(tmp_path / "s.json"), "--csv", str(tmp_path / "out")]) == 2
    assert "--state: is what one log begins with" in capsys.readouterr().err


def test_text_is_what_it_was_made_from(core: Core, tmp_path: Path) -> None:
    core.estimator.take_slides((0.1 + 0.2, -0.1, 1 / 30))
    text = kept_text(core.estimator)
    before = core.estimator.slides
    core.estimator.take_slides((0.0, 0.0, 0.0))
    take_kept(core.estimator, text, tmp_path)
    assert core.estimator.slides == before
    with pytest.raises(InputError, match="is damaged"):
        take_kept(core.estimator, text[:-3], tmp_path)
