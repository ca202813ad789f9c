"""Frames made for any configuration: all of them are accepted, and every axle is Valid on them."""

from pathlib import Path

import pytest

from wrcd.bus.log import Damage, format_line, read_log
from wrcd.config import load_config
from wrcd.core.causes import Validity
from wrcd.core.core import Core
from wrcd.tools.cli import main
from wrcd.tools.synthetic import Synthetic

ROOT = Path(__file__).parents[3]
TRAIN_DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 2147484161 Imu: 14 A
 SG_ Crc : 7|8@0+ (1,0) [0|255] "" A
 SG_ Counter : 11|4@0+ (1,0) [0|14] "" A
 SG_ Turn : 23|24@0- (0.0001,0) [-800|800] "deg/s" A
 SG_ Side : 56|32@1- (1,0) [-200|200] "m/s2" A
BO_ 514 Health: 3 A
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" A
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" A
 SG_ Imu : 16|4@1+ (1,0) [0|15] "" A
BO_ 530 Effort: 4 A
 SG_ Which M : 7|8@0+ (1,0) [0|9] "" A
 SG_ Motor m3 : 23|16@0- (0.002,0) [-60|60] "kNm" A
 SG_ Brake m4 : 23|16@0+ (0.002,0) [0|60] "kNm" A
BO_ 532 Train: 4 A
 SG_ V : 7|16@0+ (0.01,0) [0|500] "km/h" A
 SG_ Way : 23|2@0+ (1,0) [0|3] "" A
 SG_ Load : 31|8@0+ (1,0) [0|200] "kN" A
BO_ 768 Out: 2 A
 SG_ Friction : 0|8@1+ (0.5,0) [0|100] "%" A
 SG_ State : 8|2@1+ (1,0) [0|3] "" A
VAL_ 514 Imu 3 "betriebsbereit" 9 "Fehler" ;
VAL_ 532 Way 1 "vorwaerts" 2 "rueckwaerts" ;
VAL_ 768 State 0 "NotAvailable" 1 "Valid" 2 "Degraded" ;
SIG_VALTYPE_ 2147484161 Side : 1;
"""
TRAIN = """
dbc = { file = "train.dbc" }
wheelset = { name = "default" }
[vehicle]
speed = "Train.V"
direction = "Train.Way"
[[axle]]
number = 1
yaw_rate = { signal = "Imu.Turn", sign = -1, e2e = "P11", data_id = 77, status = "Health.Imu" }
lateral_acceleration = { signal = "Imu.Side", sign = -1 }
torque = [
    { signal = "Effort.Motor", at = "motor", gear_ratio = 4.0, sign = -1 }, { signal = "Effort.Brake", sign = -1 },
]
axle_load = "Train.Load"
adhesion = { message = "Out", mu_available = { signal = "Friction", not_available = 255 }, validity = "State" }
"""


@pytest.fixture(params=["train.toml", "third-party.toml"])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    if request.param == "third-party.toml":
        return ROOT / "tests/data/dbc/third-party.toml"
    (tmp_path / "train.dbc").write_text(TRAIN_DBC)
    (tmp_path / "train.toml").write_text(TRAIN)
    return tmp_path / "train.toml"


def test_every_frame_is_accepted_and_every_axle_is_valid(file: Path) -> None:
    core = Core(load_config(file))
    keys = set()
    for tick in Synthetic(core.config).ticks(400):
        stamps = [f.stamp_us for f in tick]
        assert stamps == sorted(stamps)
        for frame in tick:
            core.feed(frame)
            keys.add(frame.key)
    assert core.counts.rejected == {}
    assert keys == set(core.receiver.keys)
    assert {r.validity for r in core.reports} == {Validity.VALID}
    assert [r.mu_used_pct for r in core.reports] == pytest.approx([10.0] * len(core.reports), abs=0.1)


def test_log_of_them_replays_by_columns_to_what_the_core_makes(file: Path, tmp_path: Path) -> None:
    core = Core(load_config(file))
    frames = [f for tick in Synthetic(core.config).ticks(300) for f in tick]
    made = [o.frame for f in frames for o in core.feed(f)]
    log = tmp_path / "bus.log"
    log.write_text("".join(format_line(f, "can0") + "\n" for f in frames))
    assert main(["replay", str(log), "--config", str(file), "-o", str(tmp_path / "out.log")]) == 0
    assert [f for f, _ in read_log(tmp_path / "out.log", Damage())] == made
