"""A log whose clock is set back: times go on, and nothing of two periods is interleaved."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF
from mcap.reader import make_reader

from tests.support.story import BEGIN_US, Ride
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.dbc.bus_check.check import check_log
from wrcd.logs.columns import stretches
from wrcd.logs.story import gather
from wrcd.logs.time_order import MonotonicTime

STEP_AT_US, BACK_US = 9_000_000, 6_000_000


def set_back(log: Path, output: Path, back_us: int = BACK_US) -> Path:
    """The same with a clock that is set back in mid-ride; below 0: forward."""
    lines = []
    for line in log.read_text().splitlines(keepends=True):
        stamp_us = round(float(line[12:18]) + 1_000_000 * float(line[1:11]))
        if stamp_us - BEGIN_US >= STEP_AT_US:
            stamp_us -= back_us
            line = f"({stamp_us // 1_000_000}.{stamp_us % 1_000_000:06d}{line[18:]}"
        lines.append(line)
    output.write_text("".join(lines))
    return output


def test_times_go_on_where_a_clock_is_set_back() -> None:
    frames = [Frame(s, 0x10, b"") for s in (1_000_000, 2_000_000, 1_995_000, 500_000, 700_000, 100_000)]
    single, whole = MonotonicTime(), MonotonicTime()
    one_by_one = [single.moved(i)[0].stamp_us for i in single.items([(f, "can0") for f in frames])]
    assert one_by_one == [1_000_000, 2_000_000, 1_995_000, 2_000_000, 2_200_000, 2_200_000]
    at_once: list[int] = []
    for item in whole.items(stretches((f, "can0") for f in frames)):
        moved = whole.moved(item)
        at_once += [moved[0].stamp_us] if isinstance(moved, tuple) else moved.stamps_us.tolist()
    assert at_once == one_by_one
    assert [(s.at_us, s.back_us) for s in single.steps] == [(2_000_000, 1_500_000), (2_200_000, 600_000)]
    assert whole.steps == single.steps


@pytest.mark.parametrize("replay", [False, True])
def test_clock_that_is_set_back_turns_no_time_round(ride: Ride, config: Config, tmp_path: Path, replay: bool) -> None:
    log = set_back(ride.both, tmp_path / "back.log")
    story = gather(log, config, [ride.truth], replay=replay)
    assert story.end_us - story.begin_us == pytest.approx(11_000_000, abs=50_000)
    axle = story.axles[0]
    assert (np.diff(axle.adhesion.time_us) > 0).all()
    assert all(e.duration_s > 0 for e in axle.events)
    assert sum(e.duration_s for e in axle.events) == pytest.approx((story.end_us - story.begin_us) * 1e-6)
    before = [f for f in ride.sent.falls if f.end_us < BEGIN_US + STEP_AT_US - 1_000_000]
    for told, expected in zip(story.falls, before, strict=False):
        assert told.before_pct == pytest.approx(expected.before_pct, abs=1.0)
        assert told.after_pct == pytest.approx(expected.after_pct, abs=1.0)
    assert len(story.falls) >= len(before)
    assert before
    ((at_us, back_us),) = [(s.at_us, s.back_us) for s in story.clock_steps]
    assert at_us == pytest.approx(BEGIN_US + STEP_AT_US, abs=10_000)
    assert back_us == pytest.approx(BACK_US, abs=10_000)
    (said,) = [f for f in story.verdict if "clock was set back by 6.0 s at 9.0 s" in f.text]
    assert said.level == "warning"
    assert any("times go on over a step of its clock" in w for w in story.warnings)
    if replay:
        after = [e for e in axle.events if e.begin_us >= at_us - 20_000]
        assert any(e.validity is Validity.NOT_AVAILABLE and e.cause.label == "WarmingUp" for e in after)


def test_clock_that_is_set_back_is_counted_once(ride: Ride, config: Config, tmp_path: Path) -> None:
    story = gather(set_back(ride.both, tmp_path / "back.log"), config, replay=True)
    (told,) = [f for f in story.verdict if f.text.startswith("TimeSteps")]
    assert told.text.startswith("TimeSteps: 1 ")


def test_clock_that_is_set_forward_leaves_no_state_that_holds(ride: Ride, config: Config, tmp_path: Path) -> None:
    story = gather(set_back(ride.log, tmp_path / "forward.log", -1_000_000_000), config)
    (gap,) = [e for e in story.axles[0].events if e.is_gap]
    assert gap.duration_s == pytest.approx(1000.0, abs=0.1)
    assert 5.0 < story.axles[0].spells.lasted_s(Validity.VALID) < 11.0


@pytest.mark.parametrize("back_us", [BACK_US, 3_600_000_000], ids=["6 s", "an hour"])
def test_check_of_a_log_whose_clock_is_set_back(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str], back_us: int
) -> None:
    check_log(set_back(ride.log, tmp_path / "back.log", back_us), None)
    text, warnings = capsys.readouterr()
    assert f"by up to {back_us * 1e-6:.3g} s: taken for steps of the clock" in warnings
    assert re.search(r"^YawRate_A1\.YawRate .* 200\.\d  5 ms   5\.0    0\.0 ", text, re.MULTILINE)
    assert " of 11.0 s" in text
    assert "-" not in re.findall(r"axle 1: Valid .*", text)[0]


def test_check_of_a_log_whose_clock_is_set_by_days(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    check_log(set_back(ride.log, tmp_path / "forward.log", -30 * 86_400_000_000), None)
    assert "mapped frames in 11.0 s" in capsys.readouterr().out


@pytest.mark.parametrize("back_us", [2_000_000, 3_600_000_000], ids=["2 s", "an hour"])
def test_exports_of_a_log_whose_clock_is_set_back(ride: Ride, tmp_path: Path, back_us: int) -> None:
    """MF4 and MCAP change as often as the CSV, and their times go on."""
    log = set_back(ride.log, tmp_path / "back.log", back_us)
    names = [tmp_path / f"a.{suffix}" for suffix in ("csv", "mf4", "mcap")]
    options = [word for file in names for word in (f"--{file.suffix[1:]}", str(file))]
    assert main(["replay", str(log), *options]) == 0
    rows = [row["validity"] for row in csv.DictReader(names[0].read_text().splitlines()) if row["axle"] == "1"]
    with MDF(names[1]) as mdf:
        validity = mdf.get("Validity_A1")
        assert (np.diff(validity.timestamps) > 0).all()
        assert validity.timestamps[-1] == pytest.approx(11.0, abs=0.05)
        assert [str(x) for x in validity.samples.astype(str)] == rows
        assert (np.diff(mdf.get("YawRate_A1").timestamps) >= 0).all()
        assert all(len(places) == 1 for name, places in mdf.channels_db.items() if name != "time")
    with names[2].open("rb") as file:
        of_topic = [
            (m.log_time, json.loads(m.data)["Validity"])
            for _, channel, m in make_reader(file).iter_messages()
            if channel.topic == "/Adhesion_A1"
        ]
    assert [word for _, word in of_topic] == rows
    assert of_topic[-1][0] - of_topic[0][0] == pytest.approx(11.0e9, abs=0.1e9)
