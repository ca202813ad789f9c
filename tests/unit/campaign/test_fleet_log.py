"""A log through the kind `log`."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.campaign.fleet import tally
from sim_ecu.campaign.fleet.fleet_page import steps_of
from sim_ecu.campaign.fleet.tally import CLASSES
from sim_ecu.campaign.kinds.log import CAUSES, FIGURES, by_axle, cause_column, class_column, replayed
from sim_ecu.jobs.job import Job, Scalar
from tests.support.can_ids import VEHICLE_SPEED
from tests.support.fleet import ONE_AXLE, SECONDS, SOUND, SPEED_M_S, with_fault
from tests.support.scenarios import LogOf
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.errors import InputError

SPEED_ID = f" {VEHICLE_SPEED:03X}#"


def figures(log: Path, configuration: Path | None = None) -> tuple[dict[str, Scalar], dict[str, Any]]:
    """Of a log, and what its detail says."""
    found = dict(replayed(Job("log", {"log": str(log), "configuration": str(configuration or "")})))
    return found, json.loads(str(found["detail"]))


Judged = tuple[dict[str, Scalar], dict[str, Any]]


@pytest.fixture(scope="module")
def sound(log_of: LogOf) -> Path:
    return log_of(SOUND)


@pytest.fixture(scope="module")
def judged(sound: Path) -> Judged:
    return figures(sound)


def test_shares_are_those_of_the_rows_of_a_replay(sound: Path, judged: Judged, tmp_path: Path) -> None:
    assert main(["replay", str(sound), "--csv", str(tmp_path / "rows.csv")]) == 0
    rows = list(csv.DictReader((tmp_path / "rows.csv").read_text().splitlines()))
    found, detail = judged

    def share(column: str, word: str) -> float:
        return [r[column] for r in rows].count(word) / len(rows)

    assert found["valid"] == pytest.approx(share("validity", "Valid"))
    assert found["not_available"] == pytest.approx(share("validity", "NotAvailable"))
    for cause in CAUSES:
        assert found[cause_column(cause)] == pytest.approx(share("cause", cause.words)), cause.label
    for name in CLASSES[:-1]:
        hours = sum(r["validity"] == "Valid" and r["surface"] == name for r in rows) * 0.02 / 3600
        assert found[class_column("hours", name)] == pytest.approx(hours), name
    for axle in detail["axles"]:
        own = [r for r in rows if r["axle"] == str(axle["axle"])]
        assert axle["valid"] == pytest.approx(sum(r["validity"] == "Valid" for r in own) / len(own))


def test_figures_are_those_that_are_declared(judged: Judged) -> None:
    assert set(judged[0]) == {f.name for f in FIGURES}


def test_way_is_the_trains(judged: Judged) -> None:
    found, detail = judged
    assert found["km"] == pytest.approx(SPEED_M_S * SECONDS / 1000, rel=0.01)
    assert found["hours"] == pytest.approx(SECONDS / 3600, rel=0.01)
    km = sum(float(str(found[class_column("km", c)])) for c in CLASSES)
    assert km == pytest.approx(2 * float(str(found["km"])))
    for axle in detail["axles"]:
        assert axle["step_m"] == 100.0
        assert [sum(step) for step in axle["way"]] == pytest.approx([100, 50], abs=3)


def test_sound_log_has_nothing_suspicious(judged: Judged) -> None:
    found, detail = judged
    assert (found["suspects"], found["whole"], detail["suspects"]) == (0, True, [])


def test_axles_without_a_frame_are_no_part_of_the_shares(judged: Judged) -> None:
    found, detail = judged
    assert (found["axles"], detail["without_frame"]) == (2, [3, 4])


@pytest.mark.parametrize(
    ("kind", "axle", "what", "seconds"),
    [("reverse", 2, "GyroReversed", 4.0), ("dead", 1, "GyroDead", 12.0), ("crc", 2, "RefusedCrc", 4.0)],
)
def test_faulty_gyro_is_named(log_of: LogOf, kind: str, axle: int, what: str, seconds: float) -> None:
    found, detail = figures(log_of(with_fault(kind, axle, seconds)))
    named = {(s["what"], s["axle"]): s for s in detail["suspects"]}
    assert (what, axle) in named
    assert 0.0 <= named[what, axle]["first_s"] < seconds
    assert 0.0 < named[what, axle]["seconds"] <= seconds
    assert found["suspects"] == len(named)
    assert {a for _, a in named} == {axle}


def test_log_without_speed_has_classes_by_time_alone(sound: Path, tmp_path: Path) -> None:
    log = tmp_path / "slow.log"
    lines = sound.read_text().splitlines(keepends=True)
    log.write_text("".join(line for line in lines if SPEED_ID not in line))
    assert len(log.read_text().splitlines()) < len(lines)
    found, detail = figures(log)
    assert (found["km"], found["valid"]) == (0.0, 0.0)
    assert {s["what"] for s in detail["suspects"]} == {"InputSilent"}
    for axle in detail["axles"]:
        assert axle["way"] == []
        assert sum(map(sum, axle["time"])) == pytest.approx(SECONDS, rel=0.01)


def test_clock_that_is_set_back_makes_a_log_no_longer(sound: Path, tmp_path: Path) -> None:
    log, lines = tmp_path / "back.log", sound.read_text().splitlines(keepends=True)
    half = len(lines) // 2
    back = [f"({float(line[1:18]) - 3600:.6f}{line[18:]}" for line in lines[half:]]
    log.write_text("".join([*lines[:half], *back]))
    found, _ = figures(log)
    assert found["clock_steps"] == 1
    assert found["hours"] == pytest.approx(SECONDS / 3600, rel=0.02)


def test_cut_log_is_judged_and_said_not_to_be_whole(sound: Path, tmp_path: Path) -> None:
    log = tmp_path / "cut.log"
    log.write_bytes(sound.read_bytes()[: sound.stat().st_size // 2 - 7])
    found, detail = figures(log)
    assert (found["whole"], len(detail["warnings"])) == (False, 1)
    assert "cut off" in detail["warnings"][0]


def test_own_configuration_is_used(sound: Path, tmp_path: Path) -> None:
    own = tmp_path / "wrcd.toml"
    own.write_text(ONE_AXLE)
    found, detail = figures(sound, own)
    assert (found["axles"], detail["without_frame"]) == (1, [])


def test_figures_do_not_hang_on_how_many_frames_are_held(
    sound: Path, judged: Judged, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tally, "BLOCK", 7)
    found, detail = figures(sound)
    assert detail == judged[1]
    assert {name: value for name, value in found.items() if name != "detail"} == pytest.approx(
        {name: value for name, value in judged[0].items() if name != "detail"}
    )


def test_log_that_changed_meanwhile_is_an_error(sound: Path) -> None:
    with pytest.raises(InputError, match="has changed since"):
        replayed(Job("log", {"log": str(sound)}, {"log": "of another time"}))


@pytest.mark.parametrize(
    ("text", "said"),
    [("no log at all\n", "not one readable frame"), ("(1700000000.000000) can0 7FF#00\n", "usable input")],
)
def test_log_that_tells_nothing_is_an_error(tmp_path: Path, text: str, said: str) -> None:
    log = tmp_path / "bad.log"
    log.write_text(text)
    with pytest.raises(InputError, match=said):
        figures(log)


def test_axles_astride_five_kilometres_are_drawn_in_the_same_steps_and_none_is_lost() -> None:
    axles = list(tally.Tally(load_config(None)).axles.values())[:2]
    for axle, metres in zip(axles, (5_100, 5_000), strict=True):
        parts = metres // 50
        axle.way.add(50.0 * np.arange(parts, dtype=np.float64), np.zeros(parts, np.int64), np.full(parts, 50.0))
        axle.metres = float(metres)
    width, sums = steps_of({"axles": by_axle(axles)})
    assert width == "1 km"
    assert sums.sum() == 10_100
