"""The packaged vehicles: listed with the speed from which they hunt, and taken as briefs."""

import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import read_brief, written
from sim_ecu.loop.drive_scenario import load_drive_scenario
from sim_ecu.physics.wheelset import Bogie
from sim_ecu.play.scenario import load_scenario, packaged
from sim_ecu.play.suspension import conversions
from sim_ecu.play.vehicles import load_vehicle, packaged_vehicles, read_vehicle, vehicle_path, vehicle_title
from sim_ecu.resources import TO_DRIVE
from wrcd.config.settings import parse_toml, read_toml
from wrcd.errors import InputError


def test_list_has_a_line_for_each_scenario_and_each_vehicle_with_its_hunting(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["list"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    for name in packaged_vehicles():
        assert vehicle_title(name) != name
        assert lines[name].endswith(f": {vehicle_title(name)}")
    played = {name: (load_scenario(name), "") for name in packaged()}
    driven = {name: (load_drive_scenario(name).train, ", to drive") for name in packaged(TO_DRIVE)}
    for name, (s, more) in (played | driven).items():
        axles = f"{len(s.axles)} axle" + "s" * (len(s.axles) > 1)
        assert " ".join(lines[name].split()) == f"{name} {s.duration_s:.0f} s, {axles}{more}: {s.title}"
    assert "hunting on dry rail from 146.7 m/s" in lines["multiple-unit"]
    assert "hunting on dry rail none below 200 m/s" in lines["high-speed-coach"]


def test_list_prints_before_the_simulation_is_imported() -> None:
    code = """
import builtins, sys
def first(*args, **_):
    sys.stdout.write(f"{'numba' in sys.modules} {args[0]}")
    raise SystemExit(0)
builtins.print = first
from sim_ecu.cli.main import main
main(["list"])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.startswith("False all-curves ")


@pytest.mark.parametrize("name", packaged_vehicles())
def test_a_packaged_vehicle_is_a_brief_that_is_written_and_read_again(name: str) -> None:
    brief = read_brief(read_toml(vehicle_path(name)))
    assert brief.wheelset == load_vehicle(name)
    assert read_brief(parse_toml(written(brief), "brief.toml")) == brief


PARTS = """
vehicle = "multiple-unit"
[suspension]
axle_box_longitudinal_N_m = 2.0e6
bush_longitudinal_N_m = 0.5e6
axle_box_spacing_m = 2.0
axle_box_lateral_N_m = 1.5e6
yaw_damper_N_s_m = 1.0e5
yaw_dampers = 4
yaw_damper_spacing_m = 2.6
"""


def test_suspension_gives_constants_of_a_bogie_by_its_parts_and_the_rest_stays() -> None:
    bogie = read_vehicle(parse_toml(PARTS, "parts.toml")).bogie
    expected = {
        "primary_yaw_N_m_rad": 2 * 2.5e6 * 1.0**2,
        "primary_lateral_N_m": 2 * 1.5e6,
        "secondary_yaw_damping_N_m_s_rad": 4 * 1.0e5 * 1.3**2,
    }
    assert bogie is not None
    assert asdict(bogie) == pytest.approx(asdict(Bogie()) | expected)


def test_suspension_says_how_a_constant_came_about() -> None:
    assert "primary_yaw_N_m_rad = 2 x (2e+06 + 500000) x (2 / 2)^2 = 5e+06" in conversions(parse_toml(PARTS, "-"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[suspension]\nyaw_damper_N_s_m = 1e5", "suspension.yaw_damper_N_s_m: needs yaw_damper_spacing_m, too"),
        (
            "[vehicle]\nprimary_lateral_N_m = 3e6\n[suspension]\nbush_lateral_N_m = 1e6",
            "suspension.bush_lateral_N_m: [vehicle] gives primary_lateral_N_m, too",
        ),
        ("[suspension]\nyaw_dampers = 2.5", "suspension.yaw_dampers: takes a whole number, not 2.5"),
        ("[suspension]\nyaw_dampers = 2", "suspension.yaw_dampers: nothing needs it without yaw_damper_N_s_m"),
        (
            'vehicle = "metro"\n[suspension]\naxle_box_lateral_N_m = 1e6',
            "suspension: a lone wheelset has none",
        ),
    ],
)
def test_suspension_that_does_not_fit_is_refused_with_its_key(text: str, said: str) -> None:
    with pytest.raises(InputError, match=re.escape(said)):
        read_vehicle(parse_toml(text, "parts.toml"))


def test_vehicle_file_that_names_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('vehicle = "mine.toml"\n')
    with pytest.raises(InputError, match=r"mine.toml:1: vehicle: mine.toml names another file"):
        read_brief(read_toml(tmp_path / "mine.toml"))
