"""The packaged vehicles: listed with the speed from which they hunt, and taken as briefs."""

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import read_brief, written
from sim_ecu.play.vehicles import load_vehicle, packaged_vehicles, vehicle_path, vehicle_title
from wrcd.config.settings import parse_toml, read_toml


def test_list_has_a_line_for_each_vehicle_with_its_title_and_its_hunting(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    for name in packaged_vehicles():
        assert vehicle_title(name) != name
        assert lines[name].endswith(f": {vehicle_title(name)}")
    assert "hunting on dry rail from 146.7 m/s" in lines["multiple-unit"]
    assert "hunting on dry rail none below 200 m/s" in lines["high-speed-coach"]


@pytest.mark.parametrize("name", packaged_vehicles())
def test_a_packaged_vehicle_is_a_brief_that_is_written_and_read_again(name: str) -> None:
    brief = read_brief(read_toml(vehicle_path(name)))
    assert brief.wheelset == load_vehicle(name)
    assert read_brief(parse_toml(written(brief), "brief.toml")) == brief
