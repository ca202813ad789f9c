"""A train whose torques take turns in one message, axle 1 in page 0, axle 2 in page 1: every tool tells them apart.

The values are the golden log's; axle 2 has half the torque, and its page stops after 2.5 s.
"""

import math
import re
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pytest

from wrcd import resources
from wrcd.bus.positions import message_key
from wrcd.bus.units import Quantity
from wrcd.config.config import load_config
from wrcd.dbc.bus_check.check import check_log
from wrcd.logs.story import gather
from wrcd.logs.why import explain
from wrcd.monitor.sources import model_of_log

GOLDEN = Path(__file__).parents[2] / "golden" / "leaf-film.log"
BEGIN_S, STOP_S = 1_700_000_000, 2.5
SENSORS = """
BO_ {yaw} Yaw_A{axle}: 8 X
 SG_ YawRate : 0|32@1- (1e-6,0) [-2|2] "rad/s" X

BO_ {lat} Lat_A{axle}: 8 X
 SG_ LatAccel : 0|32@1- (1e-5,0) [-50|50] "m/s^2" X
"""
ADHESION = """
BO_ {id} Adhesion_A{axle}: 8 X
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" X
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" X
 SG_ Validity : 12|4@1+ (1,0) [0|2] "" X
 SG_ MuAvailable : 16|16@1+ (0.01,0) [0|100] "%" X
"""
WORDS = """
BA_ "GenMsgCycleTime" BO_ {id} 20;
VAL_ {id} Validity 0 "NotAvailable" 1 "Valid" 2 "Degraded" ;
VAL_ {id} MuAvailable 65534 "Error" 65535 "NotAvailable" ;
"""
SHARED = """
BO_ 768 Torques: 8 X
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" X
 SG_ Torque1 m0 : 8|32@1- (0.01,0) [-100000|100000] "N*m" X
 SG_ Torque2 m1 : 8|32@1- (0.01,0) [-100000|100000] "N*m" X
 SG_ Torque3 m2 : 8|32@1- (0.01,0) [-100000|100000] "N*m" X

BO_ 769 Speed: 8 X
 SG_ Speed : 0|16@1- (0.01,0) [-100|100] "m/s" X
"""
CYCLES = {"Yaw_A1": 5, "Lat_A1": 5, "Yaw_A2": 5, "Lat_A2": 5, "Torques": 5, "Speed": 20}
CONFIG = """
dbc = { file = "pages.dbc" }
wheelset = { name = "multiple-unit" }
vehicle = { speed = "Speed.Speed" }
"""
AXLE = """
[[axle]]
number = {axle}
yaw_rate = "Yaw_A{axle}.YawRate"
lateral_acceleration = "Lat_A{axle}.LatAccel"
torque = {{ signal = "Torques.Torque{page}", timeout_ms = 50 }}
adhesion = "Adhesion_A{axle}"
"""


def dbc_text() -> str:
    axles = (1, 2)
    text = "".join(SENSORS.format(axle=a, yaw=512 + 16 * a, lat=513 + 16 * a) for a in axles) + SHARED
    text += "".join(ADHESION.format(axle=a, id=144 + a) for a in axles)
    text += 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
    ids = {name: number for number, name in re.findall(r"BO_ (\d+) (\w+):", text)}
    text += "".join(f'BA_ "GenMsgCycleTime" BO_ {ids[name]} {ms};\n' for name, ms in CYCLES.items())
    return 'VERSION ""\nNS_ :\nBS_:\nBU_: X\n' + text + "".join(WORDS.format(id=144 + a) for a in axles)


@pytest.fixture(scope="module")
def train(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The configuration and the log."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "pages.dbc").write_text(dbc_text())
    (folder / "pages.toml").write_text(CONFIG + "".join(AXLE.format(axle=a, page=a) for a in (1, 2)))
    theirs: Any = cantools.database.load_file(resources.DBC)
    ours: Any = cantools.database.load_string(dbc_text(), "dbc")
    sent: list[tuple[float, str, dict[str, float]]] = []
    for m in can.LogReader(GOLDEN):
        name = next((x.name for x in theirs.messages if x.frame_id == m.arbitration_id), "")
        values = theirs.decode_message(m.arbitration_id, m.data, decode_choices=False) if name else {}
        at = m.timestamp
        for axle in (1, 2):
            if name == "YawRate_A1":
                sent.append((at, f"Yaw_A{axle}", {"YawRate": values["YawRate"]}))
            elif name == "LatAccel_A1":
                sent.append((at, f"Lat_A{axle}", {"LatAccel": values["LatAccel"]}))
            elif name == "Torque_A1" and (axle == 1 or at < BEGIN_S + STOP_S):
                page = {"Page": axle - 1, f"Torque{axle}": values["Torque"] / axle}
                sent.append((at + 0.005 * (axle - 1), "Torques", page))
        if name == "VehicleSpeed":
            sent.append((at, "Speed", {"Speed": values["Speed"]}))
    lines = []
    for at, name, values in sorted(sent, key=lambda x: x[0]):
        message = ours.get_message_by_name(name)
        lines.append(f"({at:.6f}) can0 {message.frame_id:03X}#{message.encode(values).hex().upper()}\n")
    (folder / "pages.log").write_text("".join(lines))
    return folder / "pages.toml", folder / "pages.log"


def test_check_tells_pages_apart(train: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    config, log = train
    assert check_log(log, config) == 1
    text = capsys.readouterr().out
    rows = {line.split()[0]: re.split(r" {2,}", line) for line in text.splitlines() if line.startswith("Torques.")}
    assert float(rows["Torques.Torque1"][2]) == pytest.approx(100.0, abs=0.5)
    assert float(rows["Torques.Torque2"][2]) == pytest.approx(50.0, abs=0.5)  # of five seconds
    assert [rows[name][3] for name in rows] == ["–", "–"]  # the DBC's cycle is the message's
    assert re.search(r"Torques\.Torque2: longest gap 250\d\.\d ms, time-out 50", text)
    assert not re.search(r"Torques\.Torque1: longest gap", text)


def test_page_that_never_comes_is_named(train: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    config, log = train
    third = config.parent / "third.toml"
    third.write_text(CONFIG + AXLE.format(axle=1, page=1) + AXLE.format(axle=2, page=3))
    assert check_log(log, third) == 1
    assert "Torques.Torque3: its message comes, but not one frame that carries it" in capsys.readouterr().out


def test_why_and_report_have_each_axles_torque(train: tuple[Path, Path]) -> None:
    config, log = train
    story = gather(log, load_config(config))
    one, two = (explain(story, axle, story.begin_us + 2_000_000).torque_Nm for axle in (1, 2))
    assert one == pytest.approx(15_000, rel=0.02)
    assert two == pytest.approx(one / 2, rel=0.01)
    torque = {axle: series.values["torque_Nm"] for axle, series in story.torque.items()}
    assert (len(torque[1]), len(torque[2])) == (500, 249)
    assert all(np.isfinite(values).all() for values in torque.values())
    assert math.isnan(explain(story, 2, story.end_us).torque_Nm)


def test_monitor_counts_the_frames_that_carry_an_input(train: tuple[Path, Path]) -> None:
    file, log = train
    config = load_config(file)
    model, _ = model_of_log(log, config, (), None, 500_000)
    assert any(message_key(m) in model.watched for m in config.database.messages if m.name == "Torques")
    for axle, at_s, rate, age_ms in ((0, 2.4, 100, 10), (1, 2.4, 100, 10), (0, 4.9, 100, 10), (1, 4.9, 0, 2405)):
        at_us = BEGIN_S * 1_000_000 + round(at_s * 1e6)
        (torque,) = [i for i in model.inputs_at(model.axles[axle], at_us) if i.quantity is Quantity.TORQUE]
        assert torque.rate_hz == pytest.approx(rate, abs=1)
        assert torque.age_ms == pytest.approx(age_ms, abs=11)
        assert torque.is_stale is (rate == 0)
