"""A log to a story: its own frames or the core's, the same either way."""

import csv
import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.cli.main import main as rig
from tests.support.scenarios import held
from tests.support.story import BEGIN_US, Ride, merged
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.logs.story import gather
from wrcd.logs.story_events import VALIDITIES
from wrcd.logs.story_records import Event
from wrcd.report.data import tables


def test_log_without_frames_of_wrcd_is_estimated(ride: Ride) -> None:
    assert ride.estimated.source == "estimated here"
    assert ride.sent.source == "frames of the log"


def test_estimated_adhesion_is_that_of_the_frames_sent(ride: Ride) -> None:
    ours, theirs = (s.axles[0].adhesion for s in (ride.estimated, ride.sent))
    for name in ("time_us", "validity", "available_pct", "used_pct", "contact", "surface"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), err_msg=name)
    bound = np.isfinite(theirs.low_pct)
    assert 0 < bound.sum() < np.isfinite(ours.low_pct).sum()  # Confidence ends at 4 points, and is of Valid frames
    assert (ours.low_pct[bound] >= theirs.low_pct[bound] - 0.01).all()
    assert (ours.high_pct[bound] <= theirs.high_pct[bound] + 0.01).all()
    a, b = ride.estimated.axles[0].detail, ride.sent.axles[0].detail
    assert a is not None
    assert b is not None
    np.testing.assert_array_equal(a.residual_db, b.residual_db)
    np.testing.assert_array_equal(a.rule, b.rule)


def test_adhesion_is_that_of_the_rows_of_a_replay(ride: Ride) -> None:
    rows = [r for r in csv.DictReader(ride.rows.read_text().splitlines()) if r["axle"] == "1"]
    a = ride.estimated.axles[0].adhesion
    assert len(rows) == len(a.time_us) > 500
    assert [VALIDITIES[k].value for k in a.validity] == [r["validity"] for r in rows]
    expected = [float(r["mu_available_pct"] or "nan") for r in rows]
    np.testing.assert_allclose(a.available_pct, expected, atol=1e-4)
    assert [round(float(r["time_s"]) * 1e6) for r in rows] == a.time_us.tolist()


def test_estimated_events_are_those_of_a_replay(ride: Ride) -> None:
    rows = [r for r in csv.DictReader(ride.events.read_text().splitlines()) if r["axle"] == "1"]
    events = ride.estimated.axles[0].events
    assert [e.begin_us for e in events[1:]] == [round(float(r["time_s"]) * 1e6) for r in rows][1:]
    assert [(e.validity.value, e.cause.label if e.cause else "") for e in events] == [
        (r["to"], r["cause"]) for r in rows
    ]
    lost = next(b for a, b in itertools.pairwise(events) if a.validity is Validity.VALID)
    assert lost.detail == next(r["detail"] for r in rows if r["from"] == "Valid") != ""


def test_events_cover_the_log_without_a_gap(ride: Ride) -> None:
    for story in (ride.estimated, ride.sent):
        events = story.axles[0].events
        assert (events[0].begin_us, events[-1].end_us) == (story.begin_us, story.end_us)
        assert all(a.end_us == b.begin_us for a, b in itertools.pairwise(events))


def test_events_of_frames_are_those_of_the_core_but_for_the_slots_of_a_cause(ride: Ride) -> None:
    """AdhesionDetail tells of a cause every 100 ms: one that is over before is lost, Validity is not."""

    def runs(events: tuple[Event, ...]) -> list[tuple[Validity, int]]:
        out: list[tuple[Validity, int]] = []
        for e in events:
            if not out or out[-1][0] is not e.validity:
                out.append((e.validity, e.begin_us))
        return out

    one, other = (runs(s.axles[0].events) for s in (ride.estimated, ride.sent))
    assert one == other
    causes = {e.cause for e in ride.estimated.axles[0].events}
    assert {e.cause for e in ride.sent.axles[0].events} <= causes


def test_replay_estimates_though_there_are_frames_of_wrcd(ride: Ride, config: Config) -> None:
    again = gather(ride.both, config, replay=True)
    assert again.source == "estimated here"
    a, b = again.axles[0].adhesion, ride.estimated.axles[0].adhesion
    np.testing.assert_array_equal(a.available_pct, b.available_pct)
    assert [e.detail for e in again.axles[0].events] == [e.detail for e in ride.estimated.axles[0].events]


def test_axles_without_an_input_frame_are_left_out_with_a_warning(ride: Ride) -> None:
    assert [a.number for a in ride.sent.axles] == [1]
    assert any("no input frame of axles 2, 3, 4" in w for w in ride.sent.warnings)


def test_partly_covered_log_is_said(ride: Ride, config: Config, tmp_path: Path) -> None:
    log = tmp_path / "part.log"
    lines = ride.both.read_text().splitlines(keepends=True)
    own = {"091", "092", "093", "094", "0A1", "0A9"}
    half = f"({(BEGIN_US + 5_500_000) * 1e-6:.6f}"
    log.write_text("".join(x for x in lines if x > half or x.split()[2][:3] not in own))
    story = gather(log, config)
    assert story.source == "frames of the log"
    (said,) = [w for w in story.warnings if "axle 1 are missing" in w]
    assert "missing for 5.5 of 11.0 s" in said
    first = story.axles[0].events[0]
    assert (first.validity, first.detail) == (Validity.NOT_AVAILABLE, "no frame of wrcd")
    assert first.duration_s == pytest.approx(5.5, abs=0.05)


def test_each_frame_twice_is_said(ride: Ride, config: Config, tmp_path: Path) -> None:
    log = tmp_path / "twice.log"
    log.write_text(merged(ride.both, ride.both))
    assert any("two daemons" in w for w in gather(log, config).warnings)


def test_log_whose_inputs_are_all_refused_is_an_error(ride: Ride, config: Config, tmp_path: Path) -> None:
    log = tmp_path / "refused.log"
    lines = [x for x in ride.log.read_text().splitlines() if x.split()[2].startswith("101#")]
    log.write_text("".join(f"{x[:-2]}{int(x[-2:], 16) ^ 0xFF:02X}\n" for x in lines))
    with pytest.raises(InputError, match="wrcd check --log"):
        gather(log, config)


def test_pipe_is_refused(config: Config) -> None:
    with pytest.raises(InputError, match="read twice"):
        gather(Path("/dev/null"), config)


def test_axle_without_a_frame_of_its_own_is_left_out_though_a_message_of_several_tells_its_torque(
    tmp_path: Path,
) -> None:
    own_dbc = Path(__file__).parents[2] / "data/dbc/third-party.toml"
    scenario, log, sent = (tmp_path / name for name in ("a.toml", "a.log", "sent.log"))
    scenario.write_text(held("C", 2.0))
    assert rig(["play", str(scenario), "--fast", "--config", str(own_dbc), "--log", str(log)]) == 0
    assert main(["replay", str(log), "--config", str(own_dbc), "-o", str(sent)]) == 0
    both = tmp_path / "both.log"
    both.write_text(merged(log, sent))
    config = load_config(own_dbc)
    told = gather(both, config)
    assert (told.source, [a.number for a in told.axles]) == ("frames of the log", [1])
    assert any("no input frame of axle 2: NotAvailable throughout; not shown" in w for w in told.warnings)
    # a torque at it: sensors are dead there, and that is to be seen
    pulls, n = re.subn(r"( 18F20101#....)0000", r"\g<1>0040", both.read_text())
    assert n > 100
    both.write_text(pulls)
    assert [a.number for a in gather(both, config).axles] == [1, 2]


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A log of a train whose message carries Validity and MuAvailable alone, and its configuration."""
    folder, example = tmp_path_factory.mktemp("own"), Path(__file__).parents[3] / "examples/own-dbc"
    dbc = re.sub(r"( SG_ |VAL_ \d+ )(Confidence|SampleAge) .*\n", "", (example / "train.dbc").read_text())
    (folder / "train.dbc").write_text(dbc)
    config, log = folder / "train.toml", folder / "own.log"
    config.write_text((example / "train.toml").read_text())
    (folder / "s.toml").write_text(held("C", 2.5))
    assert rig(["play", str(folder / "s.toml"), "--fast", "--config", str(config), "--log", str(log)]) == 0
    return log, config


def test_estimated_interval_model_and_rule_need_no_signal_of_the_trains_message(own: tuple[Path, Path]) -> None:
    log, file = own
    assert main(["replay", str(log), "--config", str(file), "--explain", "--csv", str(log.with_suffix(".csv"))]) == 0
    rows = list(csv.DictReader(log.with_suffix(".csv").read_text().splitlines()))
    a, d = (told := gather(log, load_config(file)).axles[0]).adhesion, told.detail
    assert d is not None
    assert a.time_us.tolist() == d.time_us.tolist() == [round(float(r["time_s"]) * 1e6) for r in rows]
    for name, column in (("low_pct", a.low_pct), ("high_pct", a.high_pct)):
        np.testing.assert_allclose(column, [float(r[name] or "nan") for r in rows], atol=0.0051)
    assert d.winner.tolist() == [int((r["winning_model"] or "0").split(":")[0]) for r in rows]
    assert d.rule.tolist() == [int((r["dominant_rule"] or "0").split(":")[0]) for r in rows]
    valid = [r for r in rows if r["validity"] == "Valid"]
    assert len(valid) > 50
    for r in valid:
        assert float(r["low_pct"]) < float(r["mu_available_pct"]) < float(r["high_pct"])
        assert float(r["high_pct"]) - float(r["mu_available_pct"]) == pytest.approx(float(r["half_width_pp"]), abs=0.02)
        assert r["winning_model"]
        assert r["dominant_rule"]
    cold = [r for r in rows if r["validity"] == "NotAvailable"]
    assert {r[c] for r in cold for c in ("half_width_pp", "low_pct", "high_pct", "dominant_rule")} == {""}


def test_why_and_report_of_an_own_dbc_have_interval_model_and_rule(
    own: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    log, file = own
    told = gather(log, load_config(file))
    assert main(["why", str(log), "2", "--config", str(file), "--json"]) == 0
    now = json.loads(capsys.readouterr().out)["axles"][0]["now"]
    assert now["low_pct"] < now["available_pct"] < now["high_pct"]
    assert now["model"]
    assert now["rule_sentence"].startswith("If ")
    page = tables(told)
    assert np.isfinite(page["axle1.adhesion"]["low"].values).sum() > 50
    assert (page["axle1.detail"]["rule"].values > 0).sum() > 50
