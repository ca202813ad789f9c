"""Low rail by kilometre from logs: where a log's blocks lie, trains pooled, what is wrong with the places."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sim_ecu.campaign.kinds.log import figures
from sim_ecu.campaign.track_table import by_block, draw_track, stretches
from sim_ecu.cli.main import main
from sim_ecu.score.low_rail import TrackBlocks, is_low
from tests.support.can_ids import VEHICLE_SPEED
from tests.support.scenarios import LogOf
from wrcd.errors import InputError, Status

FILM_M = (500.0, 700.0)
FILM = f"""
duration_s = 30.0
speed_m_s = 40.0
axles = [1, 2]
rail = [{{ curve = "A" }}, {{ from_m = {FILM_M[0]}, curve = "F" }}, {{ from_m = {FILM_M[1]}, curve = "A" }}]
drive = {{ torque_N_m = [[0.0, 0.0], [1.5, 800.0]] }}
"""


@pytest.fixture(scope="module")
def film(log_of: LogOf) -> Path:
    """Two axles at 40 m/s over 200 m of film."""
    return log_of(FILM)


def blocks(log: Path, from_km: float, direction: str) -> TrackBlocks:
    found = figures({"log": str(log), "from_km": from_km, "direction": direction})
    rows = json.loads(str(found["detail"]))["blocks"]
    return TrackBlocks(*np.array(rows, np.float64).T)


def test_film_lies_at_its_kilometre_whichever_way_the_train_runs(film: Path) -> None:
    up, down = blocks(film, 12.0, "up"), blocks(film, 12.0, "down")
    assert up.number[is_low(up)].tolist() == [125, 126]
    assert down.number[is_low(down)].tolist() == [113, 114]
    assert (up.number.min(), up.number.max(), down.number.min()) == (120, 131, 108)


def test_places_behind_a_hole_in_the_speed_are_not_known(film: Path, tmp_path: Path) -> None:
    log, speed = tmp_path / "hole.log", f" {VEHICLE_SPEED:03X}#"
    lines = film.read_text().splitlines(keepends=True)
    first_s = float(lines[0][1:18])
    log.write_text("".join(x for x in lines if speed not in x or not 5.0 < float(x[1:18]) - first_s < 7.0))
    assert blocks(log, 0.0, "up").number.max() == 1


def test_log_without_a_place_has_no_blocks(film: Path) -> None:
    assert json.loads(str(figures({"log": str(film)})["detail"]))["blocks"] == []


def test_place_needs_its_direction(film: Path) -> None:
    with pytest.raises(InputError, match="from_km, direction: only one is given"):
        figures({"log": str(film), "from_km": 12.0})


def said(*low: int, until: int = 12) -> list[tuple[float, ...]]:
    """Rows of a passage over blocks 0 to `until` whose low ones are these."""
    return [(n, *((5.0, 9.0, 30.0) if n in low else (30.0, 40.0, 30.0))) for n in range(until)]


def test_passages_of_several_trains_are_pooled(tmp_path: Path) -> None:
    passages = [("7401", said(5, 6)), ("7401", said(5)), ("7402", said(5, 6, 9)), ("7402", said())]
    table = by_block(passages).set_index("km")
    assert table.loc[0.5, ["passages", "trains", "called_low", "is_low"]].tolist() == [4, 2, 3, True]
    assert table.loc[0.6, ["called_low", "is_low"]].tolist() == [2, False]  # half of them is not most
    assert table.loc[0.9, ["called_low", "is_low"]].tolist() == [1, False]
    assert table.loc[0.5, "available_pct"] == 5.0
    assert list(stretches(table.reset_index())) == ["low rail: km 0.5 to 0.6: 3 of 4 passages, 2 trains, adhesion 5 %"]
    unsure = [(0.0, 8.0, 17.0, 30.0)]  # which two passages may not call low, but three may
    assert [bool(by_block([("7401", unsure)] * n)["is_low"][0]) for n in (1, 2, 3)] == [False, False, True]
    draw_track(table.reset_index(), tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


def test_stretches_that_are_apart_are_told_one_by_one_and_blocks_of_which_nothing_is_said_are_left_out() -> None:
    silent = [(20.0, float("nan"), float("nan"), 30.0)]
    table = by_block([("7401", [*said(2, 3, 4, 8), *silent])])
    assert [line.split(":")[1] for line in stretches(table)] == [" km 0.2 to 0.5", " km 0.8 to 0.9"]
    assert table["km"].max() == 1.1


def test_passages_that_say_nothing_of_a_block_or_of_its_surroundings_do_not_count(tmp_path: Path) -> None:
    nothing = by_block([("7401", [])])
    draw_track(nothing, tmp_path / "x.png")
    assert (len(nothing), list(stretches(nothing))) == (0, [])
    short = [(5.0, 5.0, 9.0, float("nan"))]
    table = by_block([("7401", said(5)), ("7402", short)]).set_index("km")
    assert table.loc[0.5, ["passages", "called_low", "is_low"]].tolist() == [1, 1, True]


@pytest.fixture
def fleet(film: Path, tmp_path: Path) -> Path:
    for name in ("7401/a.log", "7402/b.log"):
        (tmp_path / "logs" / name).parent.mkdir(parents=True)
        shutil.copy(film, tmp_path / "logs" / name)
    return tmp_path


def campaign(folder: Path, places: str, out: str = "out") -> int:
    (folder / "places.csv").write_text(places)
    return main([
        "campaign", "--jobs", "1", "--logs", str(folder / "logs"), "--from-km", str(folder / "places.csv"),
        "-o", str(folder / out),
    ])  # fmt: skip


HEAD = "log,from_km,direction\n"


@pytest.mark.usefixtures("jobs_here")
def test_logs_with_places_give_a_table_and_a_picture_by_kilometre(
    fleet: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert campaign(fleet, f"\ufeff{HEAD}7401/a.log,1012.0,up\n7402/b.log,1013.2,down\n") == Status.DONE
    table = pd.read_csv(fleet / "out/low-rail.csv")
    assert table[table["is_low"]]["km"].tolist() == [1012.5, 1012.6]
    assert set(table.loc[table["is_low"], "trains"]) == {2}
    assert (fleet / "out/low-rail.png").read_bytes().startswith(b"\x89PNG")
    assert "low rail: km 1012.5 to 1012.7: 2 of 2 passages, 2 trains, adhesion" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("places", "told"),
    [
        ("km\n", "places.csv:1: does not begin with log,from_km,direction"),
        (f"{HEAD}7401/a.log,twelve,up\n", "places.csv:2: is '7401/a.log,twelve,up'"),
        (f"{HEAD}7401/a.log,12,up\n\n", "places.csv:3: is ''"),
        (f"{HEAD}7401/a.log,12,north\n", "places.csv:2: is '7401/a.log,12,north'"),
        (f"{HEAD}7401/a.log,nan,up\n", "places.csv:2: is '7401/a.log,nan,up'"),
        (f"{HEAD}7401/a.log,1,up\n7401/a.log,55,down\n", "places.csv:3: 7401/a.log stands there twice"),
        (f"{HEAD}7401/a.log,12,up\n", "places.csv: --from-km: has no line for 7402/b.log"),
    ],
)
def test_what_is_wrong_with_the_places_is_told_before_anything_runs(
    fleet: Path, places: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert campaign(fleet, places) == Status.BAD_INPUT
    assert told in capsys.readouterr().err
    assert not (fleet / "out").exists()


def test_places_are_of_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", "x.toml", "-o", str(tmp_path), "--from-km", "p.csv"]) == Status.BAD_INPUT
    assert "--from-km: is of --logs" in capsys.readouterr().err
