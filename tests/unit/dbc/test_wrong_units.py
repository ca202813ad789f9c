"""`wrcd check --log` names a unit that is read wrongly, and none of sound sensors: scenarios of the rig, played in one
unit and read in another."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_ecu.cli.main import main as sim_ecu
from wrcd.cli.main import main
from wrcd.config.config import packaged
from wrcd.dbc.bus_check.wrong_units import LAT_NOISE, OTHER_UNIT, YAW_NOISE

SCENARIOS = Path(__file__).parents[3] / "sim_ecu/play/scenarios"
YAW, LAT, TORQUE, SPEED = "YawRate_A1.YawRate", "LatAccel_A1.LatAccel", "Torque_A1.Torque", "VehicleSpeed.Speed"
# so much of each as there is something to see
SECONDS = {"leaf-patch": 12, "wet": 12, "dry": 12, "stop-and-go": 30}
Named = Callable[..., str]


def mapping(signal: str, keys: str, axles: int = 1) -> str:
    """The packaged configuration with more keys of one signal."""
    text = packaged(axles)
    assert text.count(f'"{signal}"') == 1
    return text.replace(f'"{signal}"', f'{{ signal = "{signal}", {keys} }}') if keys else text


@pytest.fixture
def named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Named:
    """What a check says of units, of a scenario that is sent by one configuration and read by another."""

    def run(scenario: str, head: str, sent: str, read: str, seconds: float, *edits: tuple[str, str]) -> str:
        text = re.sub(r"(?m)^duration_s.*\n", "", (SCENARIOS / f"{scenario}.toml").read_text())
        for old, new in edits:
            assert text.count(old) == 1
            text = text.replace(old, new)
        (tmp_path / "scenario.toml").write_text(f"duration_s = {seconds}\n{head}\n{text}")
        (tmp_path / "sent.toml").write_text(sent)
        (tmp_path / "read.toml").write_text(read)
        log = tmp_path / "played.log"
        played = ["play", str(tmp_path / "scenario.toml"), "--config", str(tmp_path / "sent.toml"), "--fast"]
        assert sim_ecu([*played, "--log", str(log)]) == 0
        capsys.readouterr()
        status = main(["check", "--config", str(tmp_path / "read.toml"), "--log", str(log)])
        text = capsys.readouterr().out
        said = [line for line in text.splitlines() if "reads as if it were in" in line]
        assert status in (0, 1)
        assert re.search(rf"(?m)^{YAW} +yaw_rate 1 ", text)  # the table of the signals: the log was looked at
        assert not said or status == 1
        return "\n".join(said)

    return run


@pytest.mark.parametrize("scenario", SECONDS)
@pytest.mark.parametrize(("signal", "unit"), [(LAT, "g"), (YAW, "deg/s")])
def test_unit_that_is_read_wrongly_is_named(scenario: str, signal: str, unit: str, named: Named) -> None:
    sent = mapping(signal, f'unit = "{unit}"')
    # Held at the peak the wheelset moves so little that the roll of cross-level is most of what it feels, and its unit
    # is not told.
    alignment = [('"erri-low"', '"good"')] if scenario in ("wet", "dry") else []
    said = named(scenario, "", sent, packaged(1), SECONDS[scenario], *alignment)
    (line,) = said.splitlines()
    assert line.startswith(f"  {signal}: ")
    assert f"reads as if it were in {unit}, " in line
    assert f'{{ signal = "{signal}", unit = "{unit}" }}' in line  # the line that mends it


def test_line_that_is_named_mends_it(named: Named) -> None:
    sent = mapping(LAT, 'unit = "g"')
    said = named("leaf-patch", "", sent, packaged(1), 12)
    key, _, value = said.partition(": lateral_acceleration = ")[2].partition(" }")[0].partition("{ ")
    assert not key
    assert named("leaf-patch", "", sent, mapping(LAT, value.partition(", ")[2]), 12) == ""


def test_line_keeps_what_else_the_mapping_says(named: Named) -> None:
    sent, read = mapping(YAW, 'unit = "deg/s", sign = -1'), mapping(YAW, "sign = -1, timeout_ms = 12")
    said = named("wet", "", sent, read, SECONDS["wet"])
    line = f'write in [[axle]]: yaw_rate = {{ signal = "{YAW}", sign = -1, timeout_ms = 12, unit = "deg/s" }}'
    assert f"if it is, {line}, or mend" in said


def test_line_of_a_force_at_the_rim_has_a_unit_of_force(named: Named) -> None:
    sent, read = (mapping(TORQUE, f'at = "rim", unit = "{unit}"') for unit in ("kN", "N"))
    said = named("wet", "", sent, read, 6)
    assert "the torque reads as if it were in kN, 1e+03 times too small" in said
    assert f'torque = {{ signal = "{TORQUE}", at = "rim", unit = "kN" }}' in said


def test_line_of_one_of_two_torques_keeps_the_other(named: Named) -> None:
    def torques(unit: str) -> str:
        both = (
            f'{{ signal = "{TORQUE}", share = 0.5, unit = "{unit}" }}, {{ signal = "Torque_A2.Torque", share = 0.5 }}'
        )
        return packaged(1).replace(f'"{TORQUE}"', f"[{both}]")

    said = named("wet", "", torques("kNm"), torques("Nm"), 6)
    changed, other = (
        f'{{ signal = "{TORQUE}", share = 0.5, unit = "kNm" }}',
        '{ signal = "Torque_A2.Torque", share = 0.5 }',
    )
    assert f"if it is, write in [[axle]]: torque = [{changed}, {other}], or mend" in said


SOUND = [
    (file.stem, sensors)
    for file in sorted(SCENARIOS.glob("*.toml"))
    for sensors in ("mems", "tactical")
    if "sensors =" not in file.read_text()  # a scenario with sensors of its own
]


@pytest.mark.parametrize(
    ("scenario", "sensors"),  # in make test every second scenario, with one kind of sensors in turn; the rest at night
    [pytest.param(*x, marks=() if k % 8 in (0, 5) else pytest.mark.night) for k, x in enumerate(SOUND)],
)
def test_of_sound_sensors_no_unit_is_named(scenario: str, sensors: str, named: Named) -> None:
    text = packaged({"four-axles": 4, "six-axles": 6}.get(scenario, 2))
    seed = 1 if sensors == "mems" else 2
    assert named(scenario, f'seed = {seed}\nsensors = "{sensors}"', text, text, 12) == ""


def test_canted_curve_accuses_no_unit(named: Named) -> None:
    """Gravity takes off what the curve gives: the accelerometer says nothing of a curve that the gyro shows."""
    balanced = ("cant_rad = 0.07", "cant_rad = 0.106")
    assert named("curves", "", packaged(2), packaged(2), 25, balanced) == ""


def test_noise_alone_names_no_unit() -> None:
    """A filter within a sensor leaves less of its noise than the design's has."""
    for noise in (YAW_NOISE, LAT_NOISE):
        assert noise.cost(1e-4) <= OTHER_UNIT


@pytest.mark.parametrize(
    ("sent", "read", "unit"), [('unit = "kNm"', "", "kNm"), ("", 'unit = "kNm", range = [-1e6, 1e6]', "Nm")]
)
def test_torque_that_moves_no_train_or_that_no_wheel_carries(sent: str, read: str, unit: str, named: Named) -> None:
    said = named("wet", "", mapping(TORQUE, sent), mapping(TORQUE, read), 6)
    assert f"  {TORQUE}: the torque reads as if it were in {unit}, 1e+03 times too " in said


@pytest.mark.parametrize(("speed_m_s", "told"), [(25, False), (35, True)])
def test_speed_is_told_by_what_no_train_reaches(speed_m_s: float, told: bool, named: Named) -> None:
    faster = ("speed_m_s = 25.0", f"speed_m_s = {speed_m_s}")
    said = named("wet", "", mapping(SPEED, 'unit = "km/h"'), packaged(1), 6, faster)
    assert (f"  {SPEED}: the speed reads as if it were in km/h, 3.6 times too large" in said) is told


@pytest.mark.parametrize("speed_m_s", [8.0, 11.1, 14.0])
def test_speed_read_in_a_wrong_unit_is_told_by_two_axles(speed_m_s: float, named: Named) -> None:
    """40 km/h read as m/s: one mistake, where it might be both accelerometers'."""
    said = named(
        "leaf-patch", "axles = [1, 2]", mapping(SPEED, 'unit = "km/h"', 2), packaged(2), 12,
        ("speed_m_s = 25.0", f"speed_m_s = {speed_m_s}"),
    )  # fmt: skip
    (line,) = said.splitlines()
    assert line.startswith(f"  {SPEED}: the speed reads as if it were in km/h, 3.6 times too large")


@pytest.mark.parametrize("speed_m_s", [5.0, 11.1, 25.0])
@pytest.mark.parametrize("scenario", ["leaf-patch", "dry", "wet"])
def test_sound_speed_is_not_accused_by_two_axles(scenario: str, speed_m_s: float, named: Named) -> None:
    slower = ("speed_m_s = 25.0", f"speed_m_s = {speed_m_s}")
    assert not named(scenario, "axles = [1, 2]", packaged(2), packaged(2), 12, slower)


@pytest.mark.parametrize("lines", [3, 60, 200])
def test_log_of_a_moment_is_too_short_to_tell(lines: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    golden = (Path(__file__).parents[2] / "golden/leaf-film.log").read_text().splitlines(keepends=True)
    log = tmp_path / "moment.log"
    log.write_text("".join(golden[:lines]))
    (tmp_path / "one.toml").write_text(packaged(1))
    assert main(["check", "--config", str(tmp_path / "one.toml"), "--log", str(log)]) == 1
    assert "reads as if it were in" not in capsys.readouterr().out
