"""`wrcd check --log` and `--live`: logs of the rig, sound and with each thing wrong that it must name."""

import re
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import numpy as np
import pytest

from sim_ecu.cli.main import main as sim_ecu
from sim_ecu.play.interface import open_bus
from sim_ecu.play.play import RealTime
from sim_ecu.play.scenario import read_scenario
from wrcd.cli.main import main
from wrcd.config.config import packaged
from wrcd.config.settings import parse_toml
from wrcd.core.core import Core
from wrcd.core.design_fit import DesignFit
from wrcd.core.estimator import Estimator
from wrcd.dbc.bus_check.input_figures import noise

ROOT = Path(__file__).parents[3]
THIRD_PARTY = ROOT / "tests/data/dbc/third-party.toml"
Checked = Callable[..., tuple[int, str]]

STEADY = """
duration_s = {seconds}
rail = [{{ curve = "B" }}]
drive = {{ utilisation = [[0, 0], [0.5, 0.5]] }}
"""
CURVE = """
duration_s = 20
drive = { utilisation = 0.3 }
[[rail]]
curve = "B"
[[rail]]
from_m = 120
curve = "B"
radius_m = 600
cant_rad = 0.02
transition_m = 60
[[rail]]
from_m = 340
curve = "B"
transition_m = 60
"""
ACCELERATING = """
duration_s = 20
speed_m_s = 10
hold_speed = false
rail = [{ curve = "A" }]
drive = { torque_N_m = [[0, 0], [1, 9000], [8, 9000], [10, -9000], [20, -9000]] }
"""


@pytest.fixture
def checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Checked:
    """Play a scenario with faults, and check its log with a configuration: status and text."""

    def run(scenario: str, *faults: str, config: str | Path | None = None) -> tuple[int, str]:
        file, log = tmp_path / "scenario.toml", tmp_path / "played.log"
        file.write_text(scenario)
        if not isinstance(config, Path):
            (tmp_path / "config.toml").write_text(packaged(1) if config is None else config)
            spoken, config = [], tmp_path / "config.toml"
        else:
            spoken = ["--config", str(config)]
        given = [word for f in faults for word in ("--fault", f)]
        assert sim_ecu(["play", str(file), *given, *spoken, "--fast", "--log", str(log)]) == 0
        capsys.readouterr()
        status = main(["check", "--config", str(config), "--log", str(log)])
        return status, capsys.readouterr().out

    return run


def row(text: str, signal: str) -> list[str]:
    """The cells of a signal's line."""
    (line,) = (line for line in text.splitlines() if line.startswith(f"{signal} "))
    return re.split(r" {2,}", line)


def test_sound_log_is_fine_and_its_signals_are_told(checked: Checked) -> None:
    status, text = checked(STEADY.format(seconds=6))
    verdict = "fine in what the signals tell: nothing would stop Valid. They do not tell 2 of 2 signs and whether"
    assert (status, text.splitlines()[0]) == (0, f"{verdict} the vehicle is that of the design")
    _, of, per_s, cycle, usual, jitter, longest, refused, seen, step, limit = row(text, "YawRate_A1.YawRate")
    assert (of, per_s, cycle, usual, jitter) == ("yaw_rate 1", "200.1", "5 ms", "5.0", "0.0")
    assert (longest, refused, limit) == ("5.0 / 15", "0.0 %", "0.0 %")
    assert seen.endswith(" rad/s")
    assert re.fullmatch(r"1e-06 / 0\.000(29|3|31)", step)  # the noise of the rig's gyro
    assert row(text, "VehicleSpeed.Speed")[2:5] == ["50.0", "20 ms", "20.0"]
    assert re.search(r"axle 1: Valid 8\d\.\d %, WarmingUp 1\d\.\d %", text)


def fit(word: str, axles: tuple[int, int] = (1, 2)) -> DesignFit:
    return DesignFit(axles, word, 250.0, 30.0, 1.5, 0.5, 0.05, {"gamma": 1.5, "primary_yaw_N_m_rad": 0.5})


BY = "(likelihood ratio 250 of 30 calm stretches)"
TIMES = "conicity x 1.5, primary yaw stiffness x 0.5"
UNSEEN = "fine in what the signals tell: nothing would stop Valid. They do not tell 2 of 2 signs"
VEHICLE = "whether the vehicle is that of the design"
HINT = "make one for it: `sim-ecu calibrate`, then `sim-ecu design`"


@pytest.mark.parametrize(
    ("words", "status", "first", "finding"),
    [
        (["Like"], 0, UNSEEN, ""),
        (["Like", "Unknown"], 0, f"{UNSEEN} and {VEHICLE}", ""),
        (
            ["Unsure"], 0, f"{UNSEEN} and {VEHICLE}",
            f"  wheelset: axles 1 and 2: the design may be another bogie's {BY}: {TIMES}; {HINT}",
        ),
        (
            ["Unlike"], 1, "1 finding would stop Valid or make it wrong",
            f"  wheelset: axles 1 and 2: the design is another bogie's {BY}: {TIMES}; adhesion is about 1.5 points too "
            f"high here; {HINT}",
        ),
    ],
)  # fmt: skip
def test_what_bogies_say_of_the_design_is_told(
    checked: Checked, monkeypatch: pytest.MonkeyPatch, words: list[str], status: int, first: str, finding: str
) -> None:
    fits = tuple(fit(word, (2 * k + 1, 2 * k + 2)) for k, word in enumerate(words))
    monkeypatch.setattr(Core, "design_fits", property(lambda _: fits))
    came, text = checked(STEADY.format(seconds=2))
    lines = text.splitlines()
    assert (came, lines[0]) == (status, first)
    assert [line for line in lines if line.startswith("  wheelset: ")] == ([finding] if finding else [])
    own = next(k for k, line in enumerate(lines) if line.startswith("wheelset  "))
    assert lines[own:] == ["wheelset  the design is for 'multiple-unit'", *(f"  {f.sentence}" for f in fits)]
    if status:
        assert lines[1] == finding


def test_what_slides_say_of_the_design_is_told(checked: Checked, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Estimator, "slides", property(lambda _: (8.6, 1.7, 0.4, 0.2)))
    status, text = checked(STEADY.format(seconds=2))
    slides = "9 slides show that the estimates before them were 22 % too high: intervals are wider by that"
    assert f"  wheelset: {slides}; {HINT}" in text.splitlines()
    assert status == 0


def test_design_without_a_bogie_is_one_of_which_the_signals_cannot_tell(checked: Checked) -> None:
    _, text = checked(STEADY.format(seconds=2))
    assert text.splitlines()[-1] == (
        "wheelset  the design is for 'multiple-unit'; whether the train has it, the signals cannot tell"
    )


def test_sound_log_of_a_third_partys_dbc_is_fine(checked: Checked) -> None:
    status, text = checked("axles = [1, 2]" + STEADY.format(seconds=6), config=THIRD_PARTY)
    assert status == 0, text
    assert row(text, "RS2_Beschl.Querbeschl")[1] == "lateral_acceleration 2"


def test_gyro_with_the_wrong_sign_is_named(checked: Checked) -> None:
    status, text = checked(STEADY.format(seconds=25), "reverse:at=0,for=100")
    assert status == 1
    verdict = text.partition("worth a look")[0].partition("\n\n")[0]
    assert "would stop Valid" in verdict
    assert re.search(r"axle 1: GyroReversed in \d\d\.\d % .*YawRate_A1.YawRate", verdict)


def test_failed_status_is_named_with_its_share(checked: Checked) -> None:
    status, text = checked("axles = [1, 2]" + STEADY.format(seconds=5), "status:at=2,for=10,axle=2", config=THIRD_PARTY)
    assert status == 1
    assert re.search(r"axle 2: InputSilent in .*RS2_Gyro.Drehrate .*refused since: \d+ status", text)
    assert re.search(r"RS2_Gyro.Drehrate: 6\d\.\d % of its frames are refused: \d+ status", text)
    assert "axle 1:" not in text.partition("worth a look")[0]


@pytest.mark.parametrize(("of", "needed"), [("yaw_rate", True), ("torque", False)])
def test_signs_in_curves(checked: Checked, of: str, needed: bool) -> None:
    status, text = checked(CURVE, f"reverse:at=0,for=100,of={of}")
    line = next(line for line in text.splitlines() if "speed times yaw rate" in line and "correlation" in line)
    assert ("against each other; one of them needs sign = -1" in line) is needed
    if needed:
        assert status == 1
    else:
        assert re.search(r": fits; correlation (0\.[89]\d|1\.00) in curves", line)


@pytest.mark.parametrize("reversed_torque", [True, False])
def test_sign_of_torque_against_the_change_of_speed(checked: Checked, reversed_torque: bool) -> None:
    status, text = checked(ACCELERATING, *["reverse:at=0,for=100,of=torque"][: int(reversed_torque)])
    if reversed_torque:
        assert status == 1
        assert "torque Torque_A1.Torque against the change of speed: correlation -" in text.partition("\n\n")[0]
    else:
        assert re.search(
            r"torque Torque_A1\.Torque against the change of speed: fits; correlation (0\.9\d|1\.00)", text
        )


def test_odd_signals_deserve_a_look(checked: Checked) -> None:
    faults = ("burst:at=3,for=0.03,of=yaw_rate", "bias:at=3,for=1,of=torque,amount=1000000")
    _, text = checked(STEADY.format(seconds=5), *faults)
    looks = text.partition("worth a look")[2].partition("\n\n")[0]
    assert "YawRate_A1.YawRate: longest gap 35.0 ms, time-out 15" in looks
    assert re.search(r"Torque_A1.Torque: \d+\.\d % of its values stand at an end of its range", looks)


def test_clipped_samples_deserve_a_look(checked: Checked, tmp_path: Path) -> None:
    config = tmp_path / "clips.toml"
    signal = '"LatAccel_A1.LatAccel"'
    config.write_text(packaged(1).replace(signal, f"{{ signal = {signal}, range = [-0.3, 0.3] }}"))
    _, text = checked(STEADY.format(seconds=5), config=config)
    assert re.search(r"LatAccel: [\d.]+ % of its values are clipped at an end of its range: no part", text)
    assert "YawRate_A1.YawRate: " not in text.partition("\n\n")[0]


def test_coarse_signal_deserves_a_look(checked: Checked, tmp_path: Path) -> None:
    config = tmp_path / "coarse.toml"
    dbc = (ROOT / "examples/own-dbc/train.dbc").read_text().replace("(0.001,0) [-30|30]", "(0.1,0) [-30|30]")
    (tmp_path / "train.dbc").write_text(dbc)
    config.write_text((ROOT / "examples/own-dbc/train.toml").read_text())
    _, text = checked(STEADY.format(seconds=5), config=config)
    step = "Bogie1.GyroZ: a step of 0.0017 rad/s is 5.8 times the noise of the design's sensor"
    assert f"{step}: a sound one is taken for frozen" in text


def test_wrong_unit_of_the_accelerometer_is_told_by_its_noise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], checked: Checked
) -> None:
    checked(STEADY.format(seconds=4))
    lat = '"LatAccel_A1.LatAccel"'
    wrong = packaged(1).replace(lat, f'{{ signal = {lat}, unit = "g", range = [-20, 20] }}')
    (tmp_path / "wrong.toml").write_text(wrong)
    main(["check", "--config", str(tmp_path / "wrong.toml"), "--log", str(tmp_path / "played.log")])
    said = r"LatAccel_A1.LatAccel: its noise of [\d.]+ m/s2 is (9|10)\.\d times that of the design's sensor"
    assert re.search(said, capsys.readouterr().out)


def test_missing_axle_and_missing_message_are_named(checked: Checked) -> None:
    status, text = checked(STEADY.format(seconds=3), config=packaged(3))
    assert status == 1
    assert "  axles 2, 3: not one frame of their own came\n" in text
    faults = [f"burst:at=0,for=100,of={q}" for q in ("torque", "speed")]
    status, text = checked(STEADY.format(seconds=3), *faults)
    assert status == 1
    assert "  Torque_A1.Torque: not one frame of id 0x121 came\n" in text
    assert "  VehicleSpeed.Speed: not one frame of id 0x130 came\n" in text


def test_channels_order_and_damage_of_a_log_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], checked: Checked
) -> None:
    checked(STEADY.format(seconds=4))
    lines = (tmp_path / "played.log").read_text().splitlines(keepends=True)
    log = tmp_path / "changed.log"
    command = ["check", "--config", str(tmp_path / "config.toml"), "--log", str(log)]

    log.write_text("".join(lines) + "".join(line.replace("can0", "can1") for line in lines[:50]))
    assert main(command) == 2
    assert re.search(r"can0 \(\d+ frames\), can1 \(50 frames\)", capsys.readouterr().err)
    assert main([*command, "-c", "can0"]) == 0

    blocks = [lines[k : k + 100] for k in range(0, len(lines), 100)]  # 0.2 s each
    log.write_text("".join(line for k in range(len(blocks) & ~1) for line in blocks[k ^ 1]))
    assert main(command) == 0
    assert "out of time order" in capsys.readouterr().err

    log.write_text("".join(lines)[:-9])
    assert main(command) == 1
    assert "cut off" in capsys.readouterr().err


@contextmanager
def played(channel: str, seconds: float) -> Iterator[None]:
    """A rig that plays in real time on a virtual bus meanwhile."""
    bus = open_bus("virtual", channel)
    rig = RealTime(read_scenario(parse_toml(STEADY.format(seconds=seconds), "test"), "test"), bus, None, False)

    def play() -> None:
        while rig.step():
            time.sleep(rig.wait_s())

    player = threading.Thread(target=play)
    try:
        player.start()
        yield
        player.join()
    finally:
        bus.shutdown()


def test_live_bus_is_listened_to_and_nothing_is_sent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "one.toml"
    config.write_text(packaged(1))
    other = open_bus("virtual", "bus-check")
    try:
        other.set_filters(None)
        with played("bus-check", 3):
            status = main(["check", "--config", str(config), "--live", "2.5", "-i", "virtual", "-c", "bus-check"])
        seen = []
        while (m := other.recv(0.0)) is not None:
            seen.append(m.arbitration_id)
    finally:
        other.shutdown()
    text = capsys.readouterr().out
    assert set(seen) == {0x101, 0x111, 0x121, 0x130}
    assert float(row(text, "YawRate_A1.YawRate")[2]) > 100
    assert status in (0, 1)  # a busy computer may cost frames
    assert "axle 1: Valid" in text


def test_live_bus_that_is_silent_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--live", "0.2", "-i", "virtual", "-c", "silent"]) == 3
    text = capsys.readouterr().out
    assert "none of other ids came" in text
    assert float(re.findall(r"no frame of ([\d.]+) s fits", text)[0]) >= 0.2


def test_live_bus_that_falls_silent_is_not_fine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is listened to counts, with the silence at its end."""
    config = tmp_path / "one.toml"
    config.write_text(packaged(1))
    other, stop = open_bus("virtual", "falls-silent"), threading.Event()

    def talk() -> None:
        while not stop.wait(0.02):
            other.send(can.Message(arbitration_id=0x7FF, data=b"", is_extended_id=False))

    talker = threading.Thread(target=talk)  # whose frames are no input, and do not stop
    try:
        talker.start()
        with played("falls-silent", 1):
            status = main(["check", "--config", str(config), "--live", "5", "-i", "virtual", "-c", "falls-silent"])
    finally:
        stop.set()
        talker.join()
        other.shutdown()
    text = capsys.readouterr().out
    assert status == 1
    (seconds,) = re.findall(r"axle 1: InputSilent in [\d.]+ % of ([\d.]+) s", text)[:1]
    assert float(seconds) >= 5.0


FLOATS = """VERSION ""
NS_ :
BS_:
BU_: X
BO_ 513 Yaw: 8 X
 SG_ YawRate : 0|64@1- (1,0) [-2|2] "rad/s" X

BO_ 514 Lat: 8 X
 SG_ LatAccel : 0|64@1- (1,0) [-50|50] "m/s^2" X

BO_ 515 Speed: 8 X
 SG_ Speed : 0|64@1- (1,0) [0|0] "m/s" X

BO_ 516 Torque: 8 X
 SG_ Torque : 0|64@1- (1,0) [0|0] "Nm" X

BO_ 145 Adhesion_A1: 8 X
 SG_ Validity : 12|4@1+ (1,0) [0|2] "" X
 SG_ MuAvailable : 16|16@1+ (0.01,0) [0|100] "%" X

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 513 5;
BA_ "GenMsgCycleTime" BO_ 514 5;
BA_ "GenMsgCycleTime" BO_ 515 20;
BA_ "GenMsgCycleTime" BO_ 516 10;
BA_ "GenMsgCycleTime" BO_ 145 20;
VAL_ 145 Validity 0 "NotAvailable" 1 "Valid" 2 "Degraded" ;
VAL_ 145 MuAvailable 65534 "Error" 65535 "NotAvailable" ;
SIG_VALTYPE_ 513 YawRate : 2;
SIG_VALTYPE_ 514 LatAccel : 2;
SIG_VALTYPE_ 515 Speed : 2;
SIG_VALTYPE_ 516 Torque : 2;
"""
FLOATS_CONFIG = """
dbc = { file = "floats.dbc" }
wheelset = { name = "multiple-unit" }
vehicle = { speed = "Speed.Speed" }
[[axle]]
number = 1
adhesion = "Adhesion_A1"
yaw_rate = "Yaw.YawRate"
lateral_acceleration = "Lat.LatAccel"
torque = "Torque.Torque"
"""


@pytest.mark.parametrize("step", [0.0, 0.01], ids=["fine", "quantized"])
def test_step_of_a_float_is_the_one_that_its_values_have(
    step: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "floats.dbc").write_text(FLOATS)
    (tmp_path / "floats.toml").write_text(FLOATS_CONFIG)
    rng = np.random.default_rng(1)
    lines = []
    for k in range(1200):
        at = f"({1_700_000_000 + k * 0.005:.6f}) can0 "
        yaw, lat = 3e-4 * rng.standard_normal(), 0.01 * rng.standard_normal()
        values = {513: yaw, 514: round(lat / step) * step if step else lat}
        values |= {515: 25.0 + 0.01 * rng.standard_normal()} if k % 4 == 0 else {}
        values |= {516: 5000.0 + rng.standard_normal()} if k % 2 == 0 else {}
        lines += [f"{at}{number:03X}#{struct.pack('<d', x).hex().upper()}\n" for number, x in values.items()]
    (tmp_path / "floats.log").write_text("".join(lines))
    main(["check", "--config", str(tmp_path / "floats.toml"), "--log", str(tmp_path / "floats.log")])
    text = capsys.readouterr().out
    assert "a step of 1 rad/s" not in text
    assert float(row(text, "Yaw.YawRate")[9].split(" / ")[0]) < 1e-4
    seen = float(row(text, "Lat.LatAccel")[9].split(" / ")[0])
    assert seen == pytest.approx(step) if step else seen < 1e-3


def test_noise_is_the_white_part_of_a_series() -> None:
    rng = np.random.default_rng(1)
    stamps = np.arange(5000, dtype=np.int64) * 5000
    values = 3e-4 * rng.standard_normal(5000) + np.sin(2 * np.pi * 1.0 * stamps * 1e-6)
    assert noise(stamps, values) == pytest.approx(3e-4, rel=0.05)
    stamps[2500:] += 1_000_000  # a gap, and the value elsewhere: no neighbours
    values[2500:] += 100.0
    assert noise(stamps, values) == pytest.approx(3e-4, rel=0.05)
    assert np.isnan(noise(stamps[:50], values[:50]))
