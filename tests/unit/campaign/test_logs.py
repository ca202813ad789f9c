"""`sim-ecu campaign --logs`: which logs there are, what the rows of them say, and what is left in the folder."""

import csv
import gzip
import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from sim_ecu.campaign.kinds.log import CAUSES, CLASSES, FIGURES, figures, of_design
from sim_ecu.cli.main import main
from tests.support.can_ids import VEHICLE_SPEED
from tests.support.scenarios import LogOf
from wrcd.cli.main import main as wrcd
from wrcd.config.config import load_config
from wrcd.core.design_fit import DesignFit
from wrcd.errors import InputError, Status

SPEED_M_S, SECONDS = 25.0, 6.0
RIDE = """
duration_s = {}
axles = [1, 2]
speed_m_s = {}
[[rail]]
curve = "A"
[drive]
creep_of_peak = [[0.0, 0.0], [1.0, 1.0]]
"""
SOUND = RIDE.format(SECONDS, SPEED_M_S)
ONE_AXLE = """
[vehicle]
speed = "VehicleSpeed.Speed"
[[axle]]
number = 1
yaw_rate = "YawRate_A1.YawRate"
lateral_acceleration = "LatAccel_A1.LatAccel"
torque = "Torque_A1.Torque"
"""
BROKEN = "7402/broken.log"
SPEED_ID = f" {VEHICLE_SPEED:03X}#"
Judged = tuple[dict[str, Any], dict[str, Any]]


def with_fault(kind: str, axle: int, seconds: float) -> str:
    """The ride for so long, with a fault of a gyro throughout, and far from the peak: there a sound gyro is quiet."""
    fault = f'kind = "{kind}"\nof = "yaw_rate"\naxle = {axle}\nat_s = 0.0\nduration_s = {seconds}\n'
    ride = RIDE.format(seconds, SPEED_M_S).replace("[1.0, 1.0]", "[1.0, 0.2]")
    return f"{ride}[[fault]]\n{fault}"


def judge(log: Path, configuration: Path | None = None) -> Judged:
    """A log's figures, and what its detail says."""
    found = dict(figures({"log": str(log), "configuration": str(configuration or "")}))
    return found, json.loads(str(found["detail"]))


@pytest.fixture(scope="module")
def sound(log_of: LogOf) -> Path:
    return log_of(SOUND)


@pytest.fixture(scope="module")
def judged(sound: Path) -> Judged:
    return judge(sound)


def test_shares_are_those_of_the_rows_of_a_replay(sound: Path, judged: Judged, tmp_path: Path) -> None:
    assert wrcd(["replay", str(sound), "--csv", str(tmp_path / "rows.csv")]) == 0
    rows = list(csv.DictReader((tmp_path / "rows.csv").read_text().splitlines()))
    found, _ = judged

    def share(column: str, word: str) -> float:
        return [r[column] for r in rows].count(word) / len(rows)

    frame = 0.02 / SECONDS  # before the first of them there is a part of a slot
    assert found["valid"] == pytest.approx(share("validity", "Valid"), abs=frame)
    assert found["not_available"] == pytest.approx(share("validity", "NotAvailable"), abs=frame)
    for cause, name in CAUSES.items():
        assert found[name] == pytest.approx(share("cause", cause.words), abs=2 * 0.02 / SECONDS), name  # to a frame
    for name, surface in zip(CLASSES, ("Dry", "Wet", "Reduced", "Low", "VeryLow"), strict=False):
        hours = sum(r["validity"] == "Valid" and r["surface"] == surface for r in rows) * 0.02 / 3600
        assert found[f"hours_{name}"] == pytest.approx(hours), name


def test_figures_are_those_that_are_declared(judged: Judged) -> None:
    assert {name: type(value) for name, value in judged[0].items()} == FIGURES


@pytest.mark.parametrize(
    ("words", "said", "conicity"), [(["Unknown"], "Unknown", 0.0), (["Like", "Unknown"], "Like", 1.2),
                                    (["Like", "Unsure"], "Unsure", 1.3), (["Unlike", "Like"], "Unlike", 1.4)]
)  # fmt: skip
def test_conicity_is_that_of_the_bogies_that_are_not_unlike(words: list[str], said: str, conicity: float) -> None:
    fits = [
        DesignFit((1, 2), word, 5.0, 30.0, 0.0, 0.1, 0.05, {"gamma": 1.2 + 0.2 * k}) for k, word in enumerate(words)
    ]
    config = load_config(None)
    found = of_design(fits, config.design)
    assert found["design_fit"] == said
    expected = conicity * config.design.wheelset["gamma"] if conicity else np.nan
    assert found["conicity"] == pytest.approx(expected, nan_ok=True)


def test_way_is_the_trains(judged: Judged) -> None:
    found, detail = judged
    assert found["km"] == pytest.approx(SPEED_M_S * SECONDS / 1000, rel=0.01)
    assert found["hours"] == pytest.approx(SECONDS / 3600, rel=0.01)
    assert sum(found[f"km_{c}"] for c in CLASSES) == pytest.approx(2 * found["km"])
    assert [len(axle["metres"]) for axle in detail["axles"]] == [1, 1]
    assert sum(map(sum, (axle["metres"][0] for axle in detail["axles"]))) == pytest.approx(2000 * found["km"], abs=1.0)


def test_way_is_parted_by_kilometres(log_of: LogOf) -> None:
    found, detail = judge(log_of(RIDE.format(40.0, 60.0).replace("[1, 2]", "[1]")))
    (axle,) = detail["axles"]
    assert np.sum(axle["metres"], axis=1) == pytest.approx([1000, 1000, 400], abs=15)
    assert np.sum(axle["metres"], axis=0) == pytest.approx([1000 * found[f"km_{c}"] for c in CLASSES], abs=1.0)


def test_sound_log_has_nothing_suspicious_and_axles_without_a_frame_are_no_part_of_it(judged: Judged) -> None:
    found, detail = judged
    assert (found["suspects"], found["whole"], detail["suspects"]) == (0, True, [])
    assert (found["axles"], detail["without_frame"]) == (2, [3, 4])


@pytest.mark.parametrize(
    ("kind", "axle", "what", "seconds"),
    [("reverse", 2, "GyroReversed", 4.0), ("dead", 1, "GyroDead", 12.0), ("crc", 2, "RefusedCrc", 4.0)],
)
def test_faulty_gyro_is_named(log_of: LogOf, kind: str, axle: int, what: str, seconds: float) -> None:
    found, detail = judge(log_of(with_fault(kind, axle, seconds)))
    named = {(s["what"], s["axle"]): s for s in detail["suspects"]}
    assert (what, axle) in named
    assert 0.0 < named[what, axle]["seconds"] <= seconds
    assert found["suspects"] == len(named)
    assert found["worst_s"] == max(s["seconds"] for s in named.values())
    assert {a for _, a in named} == {axle}
    assert (found["refused"] > 0) == (kind == "crc")


def test_log_without_speed_has_classes_by_time_alone(sound: Path, tmp_path: Path) -> None:
    log = tmp_path / "slow.log"
    lines = sound.read_text().splitlines(keepends=True)
    log.write_text("".join(line for line in lines if SPEED_ID not in line))
    assert len(log.read_text().splitlines()) < len(lines)
    found, detail = judge(log)
    assert (found["km"], found["valid"]) == (0.0, 0.0)
    assert found["hours_not_valid"] == pytest.approx(2 * SECONDS / 3600, rel=0.01)
    assert {s["what"] for s in detail["suspects"]} == {"InputSilent"}


def test_clock_that_is_set_back_makes_a_log_no_longer(sound: Path, tmp_path: Path) -> None:
    log, lines = tmp_path / "back.log", sound.read_text().splitlines(keepends=True)
    half = len(lines) // 2
    back = [f"({float(line[1:18]) - 3600:.6f}{line[18:]}" for line in lines[half:]]
    log.write_text("".join([*lines[:half], *back]))
    found, _ = judge(log)
    assert found["clock_steps"] == 1
    assert found["hours"] == pytest.approx(SECONDS / 3600, rel=0.02)


def test_cut_log_is_judged_and_said_not_to_be_whole(sound: Path, tmp_path: Path) -> None:
    log = tmp_path / "cut.log"
    log.write_bytes(sound.read_bytes()[: sound.stat().st_size // 2 - 7])
    found, detail = judge(log)
    assert not found["whole"]
    assert any("cut off" in warning for warning in detail["warnings"])


def test_own_configuration_is_used(sound: Path, tmp_path: Path) -> None:
    (tmp_path / "wrcd.toml").write_text(ONE_AXLE)
    found, detail = judge(sound, tmp_path / "wrcd.toml")
    assert (found["axles"], detail["without_frame"]) == (1, [])


@pytest.mark.parametrize(
    ("text", "said"),
    [("no log at all\n", "not one readable frame"), ("(1700000000.000000) can0 7FF#00\n", "a mapped input")],
)
def test_log_that_tells_nothing_is_an_error(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "bad.log").write_text(text)
    with pytest.raises(InputError, match=said):
        judge(tmp_path / "bad.log")


def campaign(*arguments: str | Path) -> int:
    return main(["campaign", "--jobs", "1", *map(str, arguments)])


@pytest.fixture(scope="module")
def fleet(log_of: LogOf, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trains. The second has a configuration of its own, of one axle, and a log that is none."""
    folder = tmp_path_factory.mktemp("fleet")
    for train in ("7401", "7402"):
        (folder / train).mkdir()
    sound, reversed_gyro = log_of(SOUND), log_of(with_fault("reverse", 2, 4.0))
    (folder / "7401/a.log").write_bytes(sound.read_bytes())
    (folder / "7401/b.log").write_bytes(reversed_gyro.read_bytes())
    (folder / "7402/a.log.gz").write_bytes(gzip.compress(sound.read_bytes()))
    (folder / "7402/wrcd.toml").write_text(ONE_AXLE)
    (folder / BROKEN).write_text("no log at all\n")
    return folder


@pytest.fixture
def out(fleet: Path, tmp_path: Path, jobs_here: None) -> Path:
    """The fleet's results."""
    assert campaign("--logs", fleet, "-o", tmp_path / "out") == Status.STOPPED  # for the broken one
    return tmp_path / "out"


def rows_of(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder / "rows").set_index("log").sort_index()


def test_every_log_is_a_row_and_every_kilometre_of_an_axle_one_of_the_table(
    fleet: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = rows_of(out)
    assert rows[["train", "ending"]].T.to_dict("list") == {
        "7401/a.log": ["7401", "done"], "7401/b.log": ["7401", "done"], "7402/a.log.gz": ["7402", "done"],
        BROKEN: ["7402", "failed"],
    }  # fmt: skip
    assert "not one readable frame" in rows["error"][BROKEN]
    assert rows["axles"].tolist()[:3] == [2, 2, 1]
    assert rows["suspects"].tolist()[:3] == [0, 1, 0]
    assert rows["configuration"]["7402/a.log.gz"] == "7402/wrcd.toml"
    table = pd.read_parquet(out / "kilometres.parquet")
    assert table[["train", "log", "axle", "km"]].to_numpy().tolist() == [
        ["7401", "7401/a.log", 1, 0], ["7401", "7401/a.log", 2, 0], ["7401", "7401/b.log", 1, 0],
        ["7401", "7401/b.log", 2, 0], ["7402", "7402/a.log.gz", 1, 0],
    ]  # fmt: skip
    assert table[list(CLASSES)].sum().to_numpy() == pytest.approx(
        [1000 * rows[f"km_{c}"].sum() for c in CLASSES], abs=1.0
    )
    assert (out / "adhesion.png").read_bytes().startswith(b"\x89PNG")
    assert campaign("--logs", fleet, "-o", out) == Status.STOPPED  # says the same again
    said = capsys.readouterr().out
    assert "suspicious: 7401 axle 2: GyroReversed" in said
    assert f"failed: {BROKEN}: " in said


def test_only_what_is_new_or_edited_is_replayed_and_what_is_gone_goes(
    fleet: Path, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "copy" / fleet.name
    shutil.copytree(fleet, copy)
    shutil.copytree(out, tmp_path / "again")
    before = rows_of(out)["key"]
    (copy / BROKEN).unlink()
    (copy / "7401/b.log").write_bytes((fleet / "7401/b.log").read_bytes()[:-200])
    shutil.copy(fleet / "7401/a.log", copy / "7401/c.log")
    REPLAYED.clear()
    monkeypatch.setattr("sim_ecu.campaign.logs.LOG", _with(watched))
    assert campaign("--logs", copy, "-o", tmp_path / "again") == Status.DONE
    assert sorted(Path(log).name for log in REPLAYED) == ["b.log", "c.log"]
    after = rows_of(tmp_path / "again")["key"]
    assert sorted(after.index) == ["7401/a.log", "7401/b.log", "7401/c.log", "7402/a.log.gz"]
    assert [name for name in after.index if after[name] == before.get(name)] == ["7401/a.log", "7402/a.log.gz"]


REPLAYED: list[str] = []


def watched(inputs: dict[str, Any]) -> Any:
    REPLAYED.append(inputs["log"])
    return figures(inputs)


def _with(function: Any) -> Any:
    from dataclasses import replace

    from sim_ecu.campaign.kinds.log import LOG

    return replace(LOG, function=function)


@pytest.mark.usefixtures("jobs_here")
def test_log_whose_name_is_no_text_is_a_row_with_its_error(log_of: LogOf, tmp_path: Path) -> None:
    for train in (b"a", b"b\xff"):
        folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/logs/" + train))
        folder.mkdir(parents=True)
        (folder / "x.log").write_bytes(log_of(SOUND).read_bytes())
        (folder / "wrcd.toml").write_text(ONE_AXLE)
    assert campaign("--logs", tmp_path / "logs", "-o", tmp_path / "out") == Status.STOPPED
    assert rows_of(tmp_path / "out")["ending"].to_dict() == {"a/x.log": "done", "b\\xff/x.log": "failed"}


@pytest.mark.usefixtures("jobs_here")
def test_fleet_of_which_nothing_can_be_judged_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(tmp_path, "logs/1/a.log", text="no log at all")
    assert campaign("--logs", tmp_path / "logs", "-o", tmp_path / "out") == Status.STOPPED
    assert len(pd.read_parquet(tmp_path / "out/kilometres.parquet")) == 0
    assert "failed: 1/a.log: " in capsys.readouterr().out


def made(folder: Path, *names: str, text: str = "") -> Path:
    for name in names:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return folder


def listed(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> dict[str, int]:
    """How many logs of each train there are."""
    assert campaign("--logs", *arguments, "--dry-run") == Status.DONE
    head, *lines = capsys.readouterr().out.splitlines()
    found = {train: int(count) for train, count in (line.rsplit(maxsplit=1) for line in lines)}
    assert head == f"{sum(found.values())} logs of {len(found)} trains"
    return found


def test_folder_gives_every_log_below_it_and_nothing_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(tmp_path, "1/a.log", "1/2026/b.blf", "2/c.log.gz", "2/d.MF4", "3/e.trc")
    made(tmp_path, "1/a.state.json", "1/.hidden/x.log", "1/.y.log", "2/report.html", "4/Thumbs.db")
    made(tmp_path, "5/a.events.csv", text="time_s,axle,from\n")
    made(tmp_path, "5/frames.csv", text="timestamp,arbitration_id,extended,remote,error,dlc,data\n")
    made(tmp_path, "6/a.db", text="SQLite format 3\0")
    assert listed(capsys, tmp_path) == {"1": 2, "2": 2, "3": 1, "5": 1, "6": 1}


def test_train_is_the_first_folder_below_or_what_the_pattern_finds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made(tmp_path / "fleet", "2026/T7401_a.log", "2026/11/T7402_b.log", "2027/T7401_c.log", "T1_d.log")
    assert listed(capsys, tmp_path / "fleet") == {"2026": 2, "2027": 1, "fleet": 1}
    assert listed(capsys, tmp_path / "fleet", "--train", r"T(?P<train>\d+)_") == {"1": 1, "7401": 2, "7402": 1}


def test_glob_gives_what_it_matches_once_by_the_folder_before_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made(tmp_path, "7401/ride-1.log", "7401/other.log", "7402/ride-2.log")
    assert listed(capsys, f"{tmp_path}/*/ride-*.log") == {"7401": 1, "7402": 1}
    assert listed(capsys, f"{tmp_path}/**/**/ride-1.log") == {"7401": 1}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--logs", "{dir}/none"], "none: --logs: there is no log"),
        (["--logs", "{dir}/*/*.blf"], "--logs: there is no log"),
        (["--logs", "{dir}", "--train", "("], "--train: finds no group"),
        (["--logs", "{dir}", "--train", "a(.*)"], "--train: finds no group"),
        (["--logs", "{dir}", "--train", "X(?P<train>.*)"], "--train: finds no group"),
        (["--logs", "{dir}", "--config", "{dir}/wrong.toml"], "wrong.toml:1: vehicel"),
        (["--logs", "{dir}", "--limit", "0"], "--limit: takes"),
    ],
)
def test_what_is_wrong_is_told_before_anything_runs(
    tmp_path: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    made(tmp_path, "7401/a.log")
    made(tmp_path, "wrong.toml", text="[vehicel]\n")
    assert campaign(*(a.format(dir=tmp_path) for a in arguments), "-o", tmp_path / "out") == Status.BAD_INPUT
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
