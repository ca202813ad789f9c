"""SIGHUP's configuration: what is taken over, what is refused by name, and what a mistake leaves alone."""

import shutil
from pathlib import Path

import pytest

from tests.support.can_ids import YAW_RATE_A1
from tests.support.sensor_simulator import SensorSimulator, until_ms, validities
from wrcd import resources
from wrcd.config.config import DEFAULT, load_config, load_config_to_run, packaged
from wrcd.service.reload import Reload

OWN_FILES = '[dbc]\nfile = "train.dbc"\n[estimator]\ndesign = "my.json"\n'


class Train:
    """A configuration with files of its own, the daemon's view of it, and the file to change."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "train.toml"
        self.dbc, self.design = folder / "train.dbc", folder / "my.json"
        shutil.copyfile(resources.DBC, self.dbc)
        shutil.copyfile(resources.DESIGN, self.design)
        self.write()
        self.config = load_config_to_run(self.file)
        self.reload = Reload(self.file, self.config)

    def write(self, more: str = "", text: str = DEFAULT) -> None:
        self.file.write_text(OWN_FILES + text + more)

    def read(self) -> str:
        """Reload; returns the line for the log."""
        self.config, line, self.took = self.reload.read(self.config)
        return line


@pytest.fixture
def train(tmp_path: Path) -> Train:
    return Train(tmp_path)


def test_changed_limits_are_applied_and_logged(train: Train) -> None:
    train.write(
        "[limits]\nmin_speed_m_s = 40\nnot_available_after_ms = 250\n",
        DEFAULT.replace("[vehicle]", "[vehicle]\ntorque_is_total = false"),
    )
    before = train.config
    line = train.read()
    assert "limits.min_speed_m_s 3 -> 40" in line
    assert "limits.not_available_after_ms 100 -> 250" in line
    assert "vehicle.torque_is_total true -> false" in line
    assert "restart" not in line
    assert (train.config.min_speed_m_s, train.config.not_available_after_us) == (40.0, 250_000)
    assert not train.config.torque_is_total
    assert train.config.database is before.database
    train.write()
    assert "40 -> 3" in train.read()
    assert train.read() == "reload: nothing has changed"
    assert train.took


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("[vehicle]", '[bus]\nchannel = "can7"\n[vehicle]', "bus.channel"),
        ("[vehicle]", '[bus]\ninterface = "virtual"\n[vehicle]', "bus.interface"),
        (
            "[vehicle]",
            '[vehicle]\nstatus_message = { message = "InputHealth_A5", overruns = "ReachSpeed" }',
            "vehicle.status_message",
        ),
        ('"Torque_A2.Torque"', '"Torque_A1.Torque"', "mapped signals"),
        ("[vehicle]", "[recorder]\nseconds = 30\n[vehicle]", "recorder.seconds"),
        ('"train.dbc"', '"other.dbc"', "dbc.file"),
        ('"my.json"', '"other.json"', "estimator.design"),
    ],
)
def test_other_changes_need_a_restart_and_are_named(train: Train, old: str, new: str, name: str) -> None:
    text = (OWN_FILES + DEFAULT).replace(old, new)
    train.file.write_text(text + "[limits]\nmin_speed_m_s = 5\n")
    assert train.read() == f"reload: limits.min_speed_m_s 3 -> 5; needs a restart: {name}"
    assert train.took
    assert train.config.min_speed_m_s == 5.0
    assert (train.config.interface, train.config.channel, train.config.dbc_file) == ("socketcan", "can0", train.dbc)


def test_recorder_bounds_are_applied(train: Train) -> None:
    train.write('[recorder]\nmax_files = 7\nmax_mb = 12.5\nfolder = "elsewhere"\n')
    line = train.read()
    assert "recorder.max_files 20 -> 7" in line
    assert "recorder.max_mb 200 -> 12.5" in line
    assert line.endswith("; needs a restart: recorder.folder")
    assert (train.config.recorder.max_files, train.config.recorder.max_mb) == (7, 12.5)
    assert train.config.recorder.folder is None


@pytest.mark.parametrize("text", [packaged(6), DEFAULT[: DEFAULT.rindex("[[axle]]")]], ids=["added", "removed"])
def test_added_or_removed_axle_needs_a_restart(train: Train, text: str) -> None:
    train.write(text=text)
    assert train.read() == "reload: nothing taken over; needs a restart: axle, mapped signals"
    assert not train.took
    assert len(train.config.axles) == 4


def test_changed_dbc_and_design_are_named_but_not_read(train: Train) -> None:
    """Reading a DBC takes longer than a tick."""
    train.dbc.write_text("no DBC at all")
    train.design.unlink()
    train.write("[limits]\nmin_speed_m_s = 5\n")
    assert train.read() == "reload: limits.min_speed_m_s 3 -> 5; needs a restart: dbc.file, estimator.design"


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ("[limits]\nmin_speed_m_s = 400\n", "limits.min_speed_m_s: takes a number from 0.1 to 60"),
        ("[limits\n", "not valid TOML"),
        (None, "no such file"),
    ],
)
def test_invalid_configuration_changes_nothing(train: Train, more: str | None, named: str) -> None:
    before = train.config
    if more is None:
        train.file.unlink()
    else:
        train.write(more)
    line = train.read()
    assert line.startswith("reload: nothing taken over: ")
    assert named in line
    assert "train.toml:" in line
    assert not train.took
    assert train.config is before


def test_error_that_the_new_dbc_explains_names_the_dbc(train: Train) -> None:
    train.dbc.write_bytes(train.dbc.read_bytes().replace(b"Torque_A1", b"Effort_A1"))
    train.write(text=DEFAULT.replace('"Torque_A1.Torque"', '"Effort_A1.Torque"'))
    line = train.read()
    assert "Effort_A1" in line
    assert line.endswith("(dbc.file changed too: restart for that)")


def test_core_runs_at_the_new_constant_speed(train: Train) -> None:
    without = DEFAULT.replace('speed = "VehicleSpeed.Speed"', "")
    train.write("[limits]\nconstant_speed_m_s = 20\n", without)
    assert "needs a restart: limits.constant_speed_m_s, mapped signals" in train.read()
    train.config = load_config(train.file)
    sim = SensorSimulator(train.config)
    assert validities(sim.run(1200))[-1] == "Valid"
    for speed, validity, cause in ((2, "NotAvailable", "Standstill"), (70, "Degraded", "SpeedOutOfRange")):
        train.write(f"[limits]\nconstant_speed_m_s = {speed}\n", without)
        assert f"-> {speed}" in train.read()
        sim.core.reconfigure(train.config)
        assert sim.run(1200)[-1]["Validity"] == validity
        assert sim.decoded("AdhesionDetail_A1")[-1]["Cause"] == cause


def test_core_runs_on_with_new_limits(train: Train) -> None:
    """Above the present speed the axle has no estimate; lowered again, one window later it has."""
    sim = SensorSimulator(train.config)

    def reload(limits: str) -> None:
        train.write(f"[limits]\n{limits}\n")
        train.read()
        sim.core.reconfigure(train.config)

    assert validities(sim.run(1500))[-1] == "Valid"
    reload("min_speed_m_s = 40")
    assert validities(sim.run(200)) == ["NotAvailable"]
    reload("min_speed_m_s = 3")
    back = sim.run(1500)
    assert validities(back) == ["NotAvailable", "Valid"]
    assert 920 <= until_ms(back, "Valid") <= 1040
    reload("not_available_after_ms = 400")
    # 400 ms of 20 ms each, where it would have been 100
    assert 400 <= until_ms(sim.during(600, silent={YAW_RATE_A1}), "NotAvailable") <= 440
