"""Scenarios to drive as TOML: the declared keys are the parser's, and what is wrong is named."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.loop.drive_scenario import TABLES, DriveScenario, load_drive_scenario, read_drive_scenario
from sim_ecu.physics.actuators import Actuators, Drive, Pneumatics
from sim_ecu.physics.cleaning import Cleaning
from sim_ecu.play.scenario import packaged
from sim_ecu.play.scenario_keys import Measure
from sim_ecu.resources import TO_DRIVE
from wrcd.config.settings import parse_toml
from wrcd.errors import InputError, NotThere

ROOT = Path(__file__).parents[3]
RAIL, DRIVER = 'rail = [{ curve = "A" }]\n', "driver = { demand = -1.0 }\n"
WITH = {
    "": "@\n" + RAIL + DRIVER,
    "driver": RAIL + "[driver]\ndemand = 0\n@\n",
    "axle.N": RAIL + DRIVER + "[axle.1]\n@\n",
    **{name: RAIL + DRIVER + f"[{name}]\n@\n" for name in TABLES if name.startswith(("actuators", "cleaning"))},
}


def read(text: str) -> DriveScenario:
    return read_drive_scenario(parse_toml(text, "test.toml"), "test")


def mistake(text: str) -> str:
    with pytest.raises(InputError) as e:
        read(text)
    return str(e.value)


@pytest.mark.parametrize("table", TABLES)
def test_parser_knows_the_declared_keys_and_no_other(table: str) -> None:
    said = mistake(WITH[table].replace("@", "qqqqqq = 1"))
    assert set(said.partition("known here: ")[2].split(", ")) == {k.name for k in TABLES[table]}


@pytest.mark.parametrize(
    ("table", "key"), [(table, key) for table, keys in TABLES.items() for key in keys if isinstance(key, Measure)]
)
def test_declared_range_is_the_parsers(table: str, key: Measure) -> None:
    for value in (key.low - 1.0, key.high * 10 + 1.0):
        expected = f"{key.name}: takes a number from {key.low:g} to {key.high:g}, not"
        assert expected in mistake(WITH[table].replace("@", f"{key.name} = {value!r}"))


def test_every_constant_of_actuators_and_cleaning_has_a_key() -> None:
    constants = {f.name for kind in (Drive, Pneumatics) for f in fields(kind)} | {"full_brake_N_m"}
    declared = {k.name for t in ("actuators", "actuators.drive", "actuators.pneumatics") for k in TABLES[t]}
    assert declared - {"drive", "pneumatics"} == constants
    assert {k.name for k in TABLES["cleaning"]} == {f.name for f in fields(Cleaning)}


def test_defaults_are_those_of_a_scenario_from_python() -> None:
    s = read(RAIL + DRIVER)
    assert s == DriveScenario(s.train, s.driver)
    assert (s.actuators, s.cleaning, s.stop_m_s) == (Actuators(), None, 3.0)
    assert s.driver.at(np.array([0.0, 9.0])).tolist() == [-1.0, -1.0]


def test_what_is_given_is_what_runs() -> None:
    s = read(
        "axles = [2, 3]\nspeed_m_s = 12\nstop_m_s = 0.5\nspeed_of_wrcd = 'wheels'\n"
        + RAIL
        + "[driver]\ndemand = [[0, 0.1], [5, 0.1], [5, -1]]\n"
        "[actuators]\nfull_brake_N_m = 18e3\n[actuators.drive]\nlag_s = 0.1\n[actuators.pneumatics]\nfill_s = 0.4\n"
        "[cleaning]\nenergy_kJ_m = 4\n"
    )
    assert s.axles == [2, 3]
    assert s.driver.at(np.array([4.9, 5.1])).tolist() == [0.1, -1.0]
    assert s.actuators == Actuators(replace(Drive(), lag_s=0.1), replace(Pneumatics(), fill_s=0.4), 18e3)
    assert s.cleaning == Cleaning(energy_kJ_m=4.0)
    assert (s.stop_m_s, s.speed_of_wrcd) == (0.5, "wheels")


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (RAIL, "driver:"),
        (RAIL + "[driver]\n", "driver.demand:"),
        (DRIVER, "axle.1.rail:"),
        (RAIL + "driver = { demand = 1.5 }\n", "driver.demand:"),
        (RAIL + DRIVER + "[drive]\ntorque_N_m = 0\n", "drive:"),  # of a scenario to play
        ("hold_speed = true\n" + RAIL + DRIVER, "hold_speed:"),
        ("speed_of_wrcd = 'radar'\n" + RAIL + DRIVER, "speed_of_wrcd:"),
    ],
)
def test_mistake_is_named_with_file_and_key(text: str, key: str) -> None:
    assert f" {key} " in (said := mistake(text))
    assert said.startswith("test.toml")


def test_packaged_scenarios_load_and_those_known_before_begin_with_five_quiet_seconds() -> None:
    assert {"brake-greasy", "brake-wet", "brake-leaf-patch", "traction-leaf-patch", "traction-wet-start"} < set(
        packaged(TO_DRIVE)
    )
    for name in packaged(TO_DRIVE):
        s = load_drive_scenario(name)
        assert s.train.name == name
        if name in ("brake-greasy", "brake-wet", "emergency-greasy", "emergency-wet"):
            assert np.abs(s.driver.at(np.linspace(0.0, 4.99, 50))).tolist() == [0.05] * 50
            assert abs(float(s.driver.at(np.array([5.01]))[0])) == 1.0


def test_scenario_to_play_is_said_to_be_one_and_a_missing_file_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="leaf-patch is one to play"):
        load_drive_scenario("leaf-patch")
    with pytest.raises(NotThere):
        load_drive_scenario(tmp_path / "none.toml")


def test_scenario_of_the_page_is_one() -> None:
    page = (ROOT / "docs/reference/scenario.md").read_text()
    s = read(page.partition("## A scenario to drive")[2].partition("```toml\n")[2].partition("```")[0])
    assert (s.actuators.full_brake_N_m, s.actuators.pneumatics.fill_s) == (20e3, 0.4)
