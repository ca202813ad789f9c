"""A recorder that was off, and single stamps that are wrong: what every tool makes of them."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.campaign.kinds.log import figures
from tests.support.story import BEGIN_US, Ride
from wrcd.cli.main import main
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.dbc.bus_check.check import check_log
from wrcd.errors import InputError
from wrcd.logs.log_comparison import compare
from wrcd.logs.reader import LogReader
from wrcd.logs.story import gather
from wrcd.logs.story_records import GAP, Gaps
from wrcd.report.data import tables

HOUR_US = 3_600_000_000
GONE_AT_US, SILENT_US = 9_000_000, (2_500_000, 3_400_000)
Moved = Callable[[int, str], int | None]  # the stamp of a line, or None: left out


def changed(log: Path, output: Path, stamp: Moved) -> Path:
    """The same lines with other stamps, in microseconds since BEGIN_US."""
    lines = []
    for line in log.read_text().splitlines(keepends=True):
        stamp_us = stamp(round(float(line[1:18]) * 1e6) - BEGIN_US, line)
        if stamp_us is not None:
            stamp_us += BEGIN_US
            lines.append(f"({stamp_us // 1_000_000}.{stamp_us % 1_000_000:06d}{line[18:]}")
    output.write_text("".join(lines))
    return output


def silent(us: int, line: str) -> int | None:
    """The gyro does not speak for a while."""
    return None if SILENT_US[0] < us < SILENT_US[1] and " 101#" in line else us


def off(us: int, line: str) -> int | None:
    """And the recorder is off for an hour."""
    kept = silent(us, line)
    return kept if kept is None or us < GONE_AT_US else kept + HOUR_US


@pytest.fixture(scope="module")
def logs(ride: Ride, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A ride in which the gyro is silent, and the same with the recorder off for an hour."""
    folder = tmp_path_factory.mktemp("gaps")
    return changed(ride.log, folder / "silent.log", silent), changed(ride.log, folder / "off.log", off)


def said(capsys: pytest.CaptureFixture[str], pattern: str) -> float:
    (found,) = re.findall(pattern, capsys.readouterr().out)
    return float(found)


def test_gap_is_no_part_of_any_share(
    logs: tuple[Path, Path], config: Config, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """check, report, campaign and comparison say the same of a log with a gap, and nearly that of the one without: the
    axle begins anew after the gap."""
    shares = []
    for log in logs:
        assert check_log(log, None) == 1
        checked = said(capsys, r"axle 1: Valid ([\d.]+) %")
        assert main(["report", str(log), "-o", str(tmp_path / "r.html")]) == 0
        reported = said(capsys, r"Axle 1 was Valid for ([\d.]+) % of 1\d\.\d s")
        campaign: dict[str, Any] = dict(figures({"log": str(log)}))
        story = gather(log, config)
        ((alone, other),) = [c.valid_shares for c in compare(story, story)]
        assert checked == reported == pytest.approx(100 * campaign["valid"], abs=0.05)
        assert checked == pytest.approx(100 * alone, abs=0.05)
        assert alone == other
        assert campaign["hours"] * 3600 == pytest.approx(11.0, abs=0.05)
        shares.append(checked)
    assert 0.0 < shares[0] - shares[1] < 12.0  # a second of window in eleven


def test_check_names_the_gap_and_what_is_wrong_beside_it(
    logs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert check_log(logs[1], None) == 1
    text = capsys.readouterr().out
    assert "1 gap of 3600.0 s in all without any frame: no part of what follows" in text
    assert re.search(r"axle 1: InputSilent in \d\.\d % of 11\.0 s: yaw rate YawRate_A1\.YawRate", text)
    assert "YawRate_A1.YawRate: longest gap 900.0 ms, time-out 15" in text
    assert re.search(r"^LatAccel_A1\.LatAccel .* 200\.\d  .* 5\.0 / 15 ", text, re.MULTILINE)


def test_gap_is_an_event_of_its_own_and_ends_an_outage(logs: tuple[Path, Path], config: Config) -> None:
    story = gather(logs[1], config)
    (axle,) = story.axles
    (gap,) = [e for e in axle.events if e.is_gap]
    assert gap.duration_s == pytest.approx(3600.0, abs=0.05)
    assert (gap.detail, gap.validity) == (GAP, Validity.NOT_AVAILABLE)
    assert sum(e.duration_s for e in axle.events) == pytest.approx((story.end_us - story.begin_us) * 1e-6)
    assert all(a.end_us == b.begin_us for a, b in zip(axle.events, axle.events[1:], strict=False))
    assert all(sum(e.duration_s for e in run) < 10.0 for run in axle.not_valid_runs())
    table = tables(story)["axle1.events"]  # what the report's strip shows
    shown_s = table["end"].values - table["time"].values
    assert shown_s.sum() == pytest.approx(axle.spells.known_s)
    assert any("a gap, from 9.0 s on (3600 s): no frame at all" in f.text for f in story.verdict)
    assert not any("between wrcd's own frames" in f.text for f in story.verdict)
    rates = {m.name: m.mean_hz for m in story.bus.messages}
    assert rates["LatAccel_A1"] == pytest.approx(200.0, abs=0.5)
    assert max(m.longest_gap_ms for m in story.bus.messages) < 1000.0


def test_gap_in_a_log_with_wrcds_frames(ride: Ride, config: Config, tmp_path: Path) -> None:
    log = changed(ride.both, tmp_path / "both.log", lambda us, _: us if us < GONE_AT_US else us + HOUR_US)
    whole, story = gather(ride.both, config), gather(log, config)
    (gap,) = [e for e in story.axles[0].events if e.is_gap]
    assert gap.duration_s == pytest.approx(3600.0, abs=0.05)
    ours, theirs = story.axles[0].spells, whole.axles[0].spells
    assert ours.share(Validity.VALID) == pytest.approx(theirs.share(Validity.VALID), abs=0.002)


def test_times_with_gaps_taken_out() -> None:
    gaps = Gaps.of([(10, 110), (200, 1200)])
    assert gaps.total_us == 1100
    assert gaps.taken_out(gaps.begin_us).tolist() == [10, 100]
    assert gaps.taken_out(gaps.end_us).tolist() == [10, 100]
    assert Gaps.of([]).taken_out(gaps.begin_us).tolist() == [10, 200]


@pytest.mark.parametrize("off_us", [6_200_000, -6_200_000, 1_000_000_000_000_000], ids=["ahead", "behind", "31 years"])
def test_stray_stamps_cost_nothing(ride: Ride, config: Config, tmp_path: Path, off_us: int) -> None:
    """Frame 1500 and frame 2001 with a stamp that their neighbours do not have: they come at the time of the frame
    before."""
    lines = ride.log.read_text().splitlines(keepends=True)
    numbers = iter(range(1, len(lines) + 1))
    log = changed(ride.log, tmp_path / "hop.log", lambda us, _: us + off_us * (next(numbers) in (1500, 2001)))
    assert sum(a != b for a, b in zip(lines, log.read_text().splitlines(keepends=True), strict=True)) == 2
    story, sound = gather(log, config), gather(ride.log, config)
    assert (story.begin_us, story.end_us) == (sound.begin_us, sound.end_us)
    assert story.axles[0].spells.lasted_s(Validity.VALID) == sound.axles[0].spells.lasted_s(Validity.VALID)
    way = "behind" if off_us < 0 else "ahead of"
    (warning,) = [w for w in story.warnings if "bad stamp" in w]
    assert f"bad stamp of 2 frames, first frame 1500, {abs(off_us) * 1e-6:.3g} s {way} its neighbours'" in warning
    assert not story.clock_steps
    assert not len(story.gaps.begin_us)


def test_two_frames_on_end_at_another_time_are_a_clock_that_was_set(ride: Ride, config: Config, tmp_path: Path) -> None:
    numbers = iter(range(1, 1 << 30))
    log = changed(ride.log, tmp_path / "set.log", lambda us, _: us + 6_200_000 * (next(numbers) in (1500, 1501)))
    story = gather(log, config)
    assert len(story.clock_steps) == 1
    assert not any("bad stamp" in w for w in story.warnings)


@pytest.mark.parametrize("every", [2, 3, 50])
def test_frames_of_two_recorders_that_are_5_s_apart_are_refused(ride: Ride, tmp_path: Path, every: int) -> None:
    """They are no stray ones, however single each is."""
    numbers = iter(range(1, 1 << 30))
    log = changed(ride.log, tmp_path / "two.log", lambda us, _: us + 5_000_000 * (next(numbers) % every == 0))
    with pytest.raises(InputError, match="out of time order by more than 1 s"):
        list(LogReader(log).in_order())
