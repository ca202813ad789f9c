"""The FMU: what it describes, and that it is the rig, to the bit."""

import json
import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import e2e.p11
import numpy as np
import pytest
from fmpy import supported_platforms
from fmpy.validation import validate_fmu

from sim_ecu.cli.main import main
from sim_ecu.loop.drive_scenario import DriveScenario, load_drive_scenario
from sim_ecu.loop.fmu.pack import LOADER, pack
from sim_ecu.loop.fmu.plant import VALID, Plant, reseeded, seed_of, variables
from sim_ecu.loop.rig import LOOP, WRCD, Rig
from sim_ecu.physics.actuators import Valve
from sim_ecu.play.encoder import data_id, databases
from sim_ecu.play.scenario import Course
from tests.support.fmu_master import STEPS, demand
from wrcd import __version__

ROOT = Path(__file__).parents[3]
SCENARIO = """
title = "two axles <brake> on wet rail"
duration_s = 20
speed_m_s = 15
axles = [1, 2]
seed = 3

[[rail]]
curve = "C"

[driver]
demand = [[0, 0], [0.2, -0.8]]

[actuators.drive] # the cylinders take a part from the first metre on
max_brake_N_m = 8000

[[fault]]
kind = "crc"
at_s = 0.4
duration_s = 0.5
of = "yaw_rate"
axle = 2

[[fault]]
kind = "nan"
at_s = 0.6
duration_s = 0.3
of = "lateral_acceleration"
axle = 1

[[fault]]
kind = "status"
at_s = 0.8
duration_s = 0.3
of = "torque"
axle = 1
"""
MESSAGES = {  # output, without its axle: message and signal
    "sensor.speed": ("VehicleSpeed", "Speed"), "sensor.wheel_speed": ("WheelSpeed_A{}", "WheelSpeed"),
    "sensor.pressure": ("BrakePressure_A{}", "Pressure"), "sensor.yaw_rate": ("YawRate_A{}", "YawRate"),
    "sensor.lateral_acceleration": ("LatAccel_A{}", "LatAccel"), "sensor.torque": ("Torque_A{}", "Torque"),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """two.fmu, of SCENARIO, and greasy.fmu, of a packaged one."""
    out = tmp_path_factory.mktemp("fmu")
    (out / "two.toml").write_text(SCENARIO)
    pack(str(out / "two.toml"), out / "two.fmu")
    pack("brake-greasy", out / "greasy.fmu")
    return out


@pytest.fixture(scope="module")
def driven(folder: Path) -> dict[str, Any]:
    """What FMPy saw, and the process's own lines."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.fmu_master", str(folder / "two.fmu"), str(folder / "greasy.fmu")],
        cwd=ROOT, timeout=300, check=False, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr  # and not by a signal: several instances came and went
    log, _, result = done.stdout.rpartition("RESULT")
    return {**json.loads(result), "log": log, "stderr": done.stderr}


def scenario(folder: Path, name: str = "two.toml") -> DriveScenario:
    return load_drive_scenario(folder / name)


def ride(s: DriveScenario, outputs: list[str], steps: int) -> list[list[float]]:
    """The same values of a Rig, its frames decoded by cantools, of those that say which of them are usable."""
    rig = Rig(s, [LOOP, WRCD])
    by_id = {m.frame_id: m for db in databases() for m in db.messages}
    speed = float(s.train.speed.at(np.zeros(1))[0])
    outputs = [o for o in outputs if not o.endswith(VALID)]
    now = {o: speed if o.endswith("speed") else 0.0 for o in outputs}
    energy = np.zeros(len(s.axles))
    rows = []
    for k in range(steps):
        for n in s.axles:
            torque, valve = demand(k, n)
            rig.demand(n, torque, Valve(valve))
        step = rig.step()
        told = {}
        for f in step.frames:
            message = by_id[f.can_id]
            identity = data_id(message)
            if e2e.p11.e2e_p11_check(bytearray(f.data), identity):
                decoded: Any = message.decode(f.data, decode_choices=False)
                its = message.signals[-1]
                if decoded["Status"] == 0 and its.minimum <= decoded[its.name] <= its.maximum:
                    told[message.name] = decoded
        energy += step.slip_energy_J
        now |= {"driver.share": step.share, "truth.speed": step.speed_m_s, "truth.distance": step.distance_m}
        for place, n in enumerate(s.axles):
            of_axle = {
                "wheel_speed": step.wheel_m_s, "pressure": step.pressure_bar, "torque": step.torque_N_m,
                "adhesion_available": step.mu_available, "adhesion_used": step.mu_used, "slip": step.slip_m_s,
                "slip_energy": energy,
            }  # fmt: skip
            now |= {f"axle{n}.truth.{name}": float(column[place]) for name, column in of_axle.items()}
        for o in outputs:
            name = re.sub(r"^axle\d\.", "", o)
            if name in MESSAGES:
                message_name, signal = MESSAGES[name]
                message_name = message_name.format(o[4])
                if message_name in told:
                    now[o] = told[message_name][signal]
        rows.append([now[o] for o in outputs])
    return rows


def columns(rows: list[list[float]], outputs: list[str], *, valid: bool) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Of values, or of whether they may be used."""
    return np.array(rows)[:, [o.endswith(VALID) is valid for o in outputs]]


def assert_equal(fmu: list[list[float]], rig: list[list[float]], outputs: list[str]) -> None:
    np.testing.assert_allclose(columns(fmu, outputs, valid=False), np.array(rig), rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("name", ["two.fmu", "greasy.fmu"])
def test_fmu_has_no_problem_in_fmpys_validation(folder: Path, name: str) -> None:
    assert validate_fmu(str(folder / name)) == []
    assert supported_platforms(str(folder / name)) == ["linux64"]


def test_model_description_says_its_scenario_its_version_and_that_steps_are_fixed(folder: Path) -> None:
    with zipfile.ZipFile(folder / "two.fmu") as z:
        root = ElementTree.fromstring(z.read("modelDescription.xml"))
        assert '<th scope="row">axle2.sensor.yaw_rate</th>' in z.read("documentation/index.html").decode()
        assert z.read("resources/scenario.toml").decode() == SCENARIO
        assert z.read("resources/requirements.txt").decode() == f"wrcd[bench]=={__version__}\n"
    assert root.attrib["version"] == __version__
    assert "two axles <brake> on wet rail" in root.attrib["description"]
    cosimulation, experiment = root.find("CoSimulation"), root.find("DefaultExperiment")
    assert cosimulation is not None
    assert experiment is not None
    assert cosimulation.attrib["canHandleVariableCommunicationStepSize"] == "false"
    assert (experiment.attrib["stepSize"], experiment.attrib["stopTime"]) == ("0.005", "20.0")
    starts = {v.attrib["name"]: v[0].attrib.get("start") for v in root.iter("ScalarVariable")}
    assert (starts["seed"], starts["start_speed"], starts["driver.is_input"]) == ("3", "15", "false")


def test_same_scenario_makes_the_same_bytes_and_another_another_guid(folder: Path) -> None:
    pack(str(folder / "two.toml"), folder / "again.fmu")
    assert (folder / "again.fmu").read_bytes() == (folder / "two.fmu").read_bytes()
    made = []
    for name in ("two.fmu", "greasy.fmu"):
        with zipfile.ZipFile(folder / name) as z:
            made.append(json.loads(z.read("resources/made.json"))["guid"])
    assert made[0] != made[1]


def test_making_an_fmu_leaves_nothing_in_the_process_or_the_folder(folder: Path) -> None:
    path, modules = list(sys.path), "wrcd_rig_fmu" in sys.modules
    pack("brake-wet", folder / "wet.fmu")
    assert sys.path == path
    assert ("wrcd_rig_fmu" in sys.modules) is modules is False
    assert {p.suffix for p in folder.iterdir()} == {".fmu", ".toml"}


def test_sensor_has_the_unit_of_its_signal() -> None:
    by_name = {m.name: m for db in databases() for m in db.messages}
    said = {"m/s^2": "m/s2", "N*m": "N.m"}
    sensors = [v for v in variables([1, 2]) if v.signal is not None]
    assert len(sensors) == 11
    for v in sensors:
        assert v.signal is not None
        unit = by_name[v.signal[0]].get_signal_by_name(v.signal[1]).unit
        assert v.unit == said.get(str(unit), unit)


def test_fmu_driven_by_fmpy_gives_the_rigs_outputs(folder: Path, driven: dict[str, Any]) -> None:
    assert len(driven["ride"]) == STEPS
    rig = ride(scenario(folder), driven["outputs"], STEPS)
    assert_equal(driven["ride"], rig, driven["outputs"])
    assert np.all(np.ptp(np.array(rig), axis=0) > 0.0)  # each of them says something


@pytest.mark.parametrize(
    ("sensor", "begin_s", "end_s", "unusable_s"),
    [
        ("axle2.sensor.yaw_rate", 0.4, 0.9, 0.025),  # broken checksums: when the newest good frame is too old
        ("axle1.sensor.lateral_acceleration", 0.6, 0.9, 0.0),  # not available, in a good frame
        ("axle1.sensor.torque", 0.8, 1.1, 0.0),  # the sender says Error
    ],
)
def test_sensor_that_fails_keeps_its_value_and_says_that_it_is_not_valid(
    driven: dict[str, Any], sensor: str, begin_s: float, end_s: float, unusable_s: float
) -> None:
    rows, outputs = np.array(driven["ride"]), driven["outputs"]
    t = np.arange(1, STEPS + 1) * 0.005
    fails = (t > begin_s + 0.001) & (t < end_s - 0.001)
    assert len(set(rows[fails, outputs.index(sensor)])) == 1
    invalid = t[(rows[:, outputs.index(sensor + VALID)] == 0.0) & (t > 0.01)]  # its first frame comes then
    assert invalid[0] == pytest.approx(begin_s + unusable_s, abs=0.012)
    assert invalid[-1] == pytest.approx(end_s, abs=0.012)
    assert len(invalid) == round((invalid[-1] - invalid[0]) / 0.005) + 1


def test_reset_begins_anew(driven: dict[str, Any]) -> None:
    assert driven["after reset"] == driven["ride"]


def test_instances_and_fmus_in_one_process_do_not_meet(folder: Path, driven: dict[str, Any]) -> None:
    first, beside, stranger, later = driven["in turn"]
    assert first == later == driven["ride"][:40]
    two = reseeded(scenario(folder), 2)
    assert_equal(beside, ride(replace(two, driver=Course((0.0,), (-0.25,))), driven["outputs"], 40), driven["outputs"])
    greasy = load_drive_scenario("brake-greasy")
    slow = replace(greasy, train=replace(greasy.train, speed=Course((0.0,), (12.5,))))
    outputs = [o for o in driven["outputs"] if not o.startswith("axle2")]
    assert_equal(stranger, ride(slow, outputs, 40), outputs)


def test_step_of_20_ms_is_four_of_5_with_the_inputs_held(folder: Path, driven: dict[str, Any]) -> None:
    rig = Plant(scenario(folder))
    rig.start(0.0)
    rows = []
    for k in range(40):
        for n in (1, 2):
            torque, valve = demand(k // 4 * 4, n)
            rig.set(f"axle{n}.torque", torque)
            rig.set(f"axle{n}.valve", valve)
        rig.step(k * 0.005, 0.005)
        if k % 4 == 3:
            rows.append([float(rig.values[o]) for o in driven["outputs"]])
    assert driven["wide"] == rows


def test_driver_asks_in_each_step_what_its_input_says() -> None:
    rig = Plant(load_drive_scenario("brake-greasy"))
    rig.set("driver.is_input", True)
    rig.start(0.0)
    for k, share in enumerate((0.0, -0.5, 0.25)):
        rig.set("driver.input", share)
        rig.step(k * 0.005, 0.005)
        assert rig.values["driver.share"] == share


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ("before the start", "a step before the initialization has ended"),
        ("step 0.004", "a communication step of 0.004 s: it must be 0.005 s or a multiple of it"),
        ("step 0.0075", "a communication step of 0.0075 s: it must be 0.005 s or a multiple of it"),
        ("step 0", "a communication step of 0 s: it must be 0.005 s or a multiple of it"),
        ("step -0.005", "a communication step of -0.005 s: it must be 0.005 s or a multiple of it"),
        ("step nan", "a communication step of nan s: it must be 0.005 s or a multiple of it"),
        ("step inf", "a communication step of inf s: it must be 0.005 s or a multiple of it"),
        ("elsewhere", "a step from 1.000000 s, but this FMU stands at 0.005000 s and cannot go back"),
        ("axle1__valve", "axle1.valve: takes 0 (fill), 1 (hold) or 2 (vent), not 3"),
        ("axle1__torque", "axle1.torque: takes a number, not nan"),
        ("axle2__torque", "axle2.torque: takes a number, not inf"),
        ("seed", "seed: must not be negative, is -1"),
        ("start_speed", "start_speed: takes 0 to 100 m/s, not 500"),
    ],
)
def test_step_that_cannot_be_done_is_discarded_with_its_reason(driven: dict[str, Any], what: str, why: str) -> None:
    assert driven["refusals"][what] == [2, why, True]
    assert f"[DISCARD] {why}\n" in driven["log"]


def test_refusal_is_told_once_by_each_instance_where_nobody_reads_the_log(driven: dict[str, Any]) -> None:
    lines = driven["stderr"].splitlines()
    assert lines.count("refusals: a step before the initialization has ended") == 1
    assert sum(line.startswith("refusals: ") for line in lines) == 1


def test_step_after_refused_ones_is_done(driven: dict[str, Any]) -> None:
    assert driven["refusals"]["none"] == [0, "", False]


def test_simulate_fmu_reaches_its_end(driven: dict[str, Any]) -> None:
    time_s, speed = driven["simulated"]
    assert time_s == pytest.approx(0.5)
    assert 14.0 < speed < 15.0


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ("version", rf"this FMU was made by wrcd 9\.{re.escape(__version__)}, installed is {re.escape(__version__)}"),
        ("variables", "this FMU describes other variables than the wrcd that loads it has"),
        ("axles", r"scenario\.toml: axles: has the axles \[1, 2, 3\], the FMU describes \[1, 2\]"),
    ],
)
def test_fmu_that_is_not_what_it_describes_is_not_instantiated(driven: dict[str, Any], what: str, why: str) -> None:
    assert driven[what] == "Failed to instantiate model"
    assert re.search(rf"\[FATAL\] .*\n?.*{why}", driven["log"])


def test_loader_without_wrcd_names_the_python_that_lacks_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sim_ecu.loop.fmu.slave", None)
    with pytest.raises(ImportError, match=rf"needs the package wrcd\[bench\] .*, {re.escape(sys.executable)}: "):
        exec(LOADER, {"__name__": "wrcd_rig_fmu"})


def test_seed_parameter_is_the_scenarios_key(folder: Path) -> None:
    (folder / "seven.toml").write_text(SCENARIO.replace("seed = 3", "seed = 7"))
    assert seed_of(scenario(folder)) == 3
    other = scenario(folder, "seven.toml")
    assert [(a.seed, a.track_seed) for a in reseeded(scenario(folder), 7).train.axles] == [
        (a.seed, a.track_seed) for a in other.train.axles
    ]


def test_axle_with_a_seed_of_its_own_keeps_it(folder: Path) -> None:
    (folder / "own.toml").write_text(SCENARIO + "[axle.2]\nseed = 99\n")
    again = reseeded(scenario(folder, "own.toml"), 7)
    assert [(a.seed, a.track_seed) for a in again.train.axles] == [(7 * 16 + 1, 7 * 16 + 1), (99, None)]


@pytest.mark.parametrize(
    ("output", "why"),
    [
        ("rig.zip", "-o: does not end in .fmu — write rig.fmu"),
        ("nowhere/rig.fmu", "-o: no such folder"),
        ("folder.fmu", "-o: is a folder — name the file to write"),
    ],
)
def test_file_that_cannot_be_made_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], output: str, why: str
) -> None:
    (tmp_path / "folder.fmu").mkdir()
    assert main(["fmu", "-o", str(tmp_path / output)]) == 2
    assert why in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["folder.fmu"]
