"""`wrcd report --plot`: pictures of a story."""

from pathlib import Path

import numpy as np
import pytest

from sim_ecu.resources import TRUTH_DBC
from tests.support.story import DEGRADED, VALID, Ride, adhesion, axle, detail, story
from wrcd.cli.main import main
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.report.picture import MAX_POINTS, broken, draw, thinned

SIGNATURES = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


def texts(svg: Path) -> str:
    """What a picture says; matplotlib puts each text into a comment beside its outlines."""
    return svg.read_text()


@pytest.mark.parametrize("suffix", SIGNATURES)
def test_picture_is_of_the_kind_that_its_suffix_says(ride: Ride, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"ride{suffix}"
    draw(ride.sent, ride.sent.axles, ride.sent.begin_us, ride.sent.end_us, out)
    assert out.read_bytes().startswith(SIGNATURES[suffix])


def test_picture_names_causes_fall_truth_and_design(lone_ride: Ride, tmp_path: Path) -> None:
    out = tmp_path / "ride.svg"
    draw(lone_ride.sent, lone_ride.sent.axles, lone_ride.sent.begin_us, lone_ride.sent.end_us, out)
    shown = texts(out)
    for text in (
        "Axle 1", "NotAvailable: WarmingUp", "<!-- Valid -->", "Saturated", "Adhering",
        "truth", "in use", "→", "its 90 % interval", "4: curve B, linear region",
        lone_ride.sent.config.design.checksum[:12], "seconds after the log's first frame",
    ):  # fmt: skip
        assert text in shown, text


def test_same_story_gives_the_same_picture(ride: Ride, tmp_path: Path) -> None:
    one, other = tmp_path / "one.svg", tmp_path / "other.svg"
    for out in (one, other):
        draw(ride.sent, ride.sent.axles, ride.sent.begin_us, ride.sent.end_us, out)
    assert one.read_bytes() == other.read_bytes()


def test_picture_of_a_part_shows_that_part_only(ride: Ride, tmp_path: Path) -> None:
    out = tmp_path / "part.svg"
    draw(ride.sent, ride.sent.axles, ride.sent.begin_us + 2_000_000, ride.sent.begin_us + 4_000_000, out)
    assert "WarmingUp" not in texts(out)
    assert "→" not in texts(out)


def test_picture_without_detail_says_so(config: Config, tmp_path: Path) -> None:
    out = tmp_path / "bare.svg"
    made = story(config, axle(adhesion(np.full(100, 30.0), [VALID] * 50 + [DEGRADED] * 50)))
    draw(made, made.axles, made.begin_us, made.end_us, out)
    assert "the log has no AdhesionDetail" in texts(out)


def test_picture_of_an_axle_without_any_value_is_drawn(config: Config, tmp_path: Path) -> None:
    out = tmp_path / "none.svg"
    a = adhesion(np.full(100, np.nan), 0, half=np.nan, used=np.nan)
    made = story(config, axle(a, detail(100, Cause.INPUT_SILENT)))
    draw(made, made.axles, made.begin_us, made.end_us, out)
    assert "NotAvailable: InputSilent" in texts(out)


def test_long_curve_keeps_its_least_and_most() -> None:
    values = np.zeros(100_000, np.float32)
    values[[1234, 77_777]] = -5.0, 9.0
    t, least, most = thinned(np.arange(100_000.0), values)
    assert len(t) == MAX_POINTS
    assert (least.min(), most.max()) == (-5.0, 9.0)
    short, same, _ = thinned(np.arange(10.0), values[:10])
    assert len(short) == 10
    assert same is not None


def test_command_writes_what_is_asked_for(ride: Ride, tmp_path: Path) -> None:
    out = tmp_path / "part.svg"
    args = ["report", str(ride.both), "--plot", str(out), "--dbc", str(TRUTH_DBC)]
    assert main([*args, "--from", "4", "--to", "9", "--axle", "1"]) == 0
    assert "→" in texts(out)
    assert [*tmp_path.iterdir()] == [out]  # no page where none is asked for
    assert main([*args, "--force", "-o", str(tmp_path / "ride.html")]) == 0
    assert "WarmingUp" in texts(out)
    assert (tmp_path / "ride.html").exists()


def test_command_overwrites_when_forced(ride: Ride, tmp_path: Path) -> None:
    there = tmp_path / "there.png"
    there.write_text("mine")
    assert main(["report", str(ride.both), "--plot", str(there), "--force"]) == 0
    assert there.read_bytes().startswith(SIGNATURES[".png"])


def test_line_ends_where_frames_are_missing() -> None:
    a, d = adhesion(np.full(100, 30.0)), detail(100)
    rows = np.r_[0:40, 60:100]
    cut = a.part(rows)
    found = broken(cut, 20_000)
    assert len(found.time_us) == 81
    assert np.flatnonzero(np.isnan(found.available_pct)).tolist() == [40]
    assert np.isnan(found.high_pct[40])
    assert (found.contact[40], found.validity[40]) == (-1, -1)
    assert found.time_us[40] == a.time_us[39] + 60_000
    assert broken(a, 20_000) is a
    shorter = broken(d.part(np.array([0, 1, 15])), 100_000)
    assert np.isnan(shorter.residual_db[2]).all()
    assert not shorter.stale[2].any()


def test_line_of_a_long_log_ends_where_frames_are_missing() -> None:
    a = adhesion(np.full(20_000, 30.0))
    rows = np.r_[0:10_000, 10_004:20_000]
    found = broken(a.part(rows), 20_000)
    t, least, most = thinned((found.time_us * 1e-6).astype(np.float64), found.available_pct)
    assert len(t) < 2 * MAX_POINTS
    (place,) = np.flatnonzero(np.isnan(least))
    assert np.isnan(most[place])
    assert t[place] == pytest.approx((a.time_us[9_999] + 60_000) * 1e-6)


def test_log_of_a_single_input_frame_has_nothing_to_draw_or_explain(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "one.log"
    log.write_text(ride.log.read_text().splitlines(keepends=True)[0])
    assert main(["report", str(log), "--plot", str(tmp_path / "one.png")]) == 2
    assert main(["why", str(log), "0"]) == 2
    assert capsys.readouterr().err.count(f"wrcd: error: {log}: ") == 2


def test_log_of_a_single_frame_of_wrcd_is_drawn_explained_and_reported(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "one.log"
    lines = [x for x in ride.both.read_text().splitlines(keepends=True) if " 091#" in x]
    log.write_text(lines[300])
    assert main(["report", str(log), "--plot", str(tmp_path / "one.png")]) == 0
    assert main(["why", str(log), "0"]) == 0
    assert "% available" in capsys.readouterr().out
    assert main(["report", str(log), "-o", str(tmp_path / "one.html")]) == 0
    shown = capsys.readouterr()
    assert "All frames of the log are of one moment" in shown.out
    assert "MISSING_RENDERERS" not in shown.err
