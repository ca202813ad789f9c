"""A train of its own DBC: CAN FD frames, torque parts and statuses of other messages survive a dump."""

import json
from pathlib import Path

import pytest

from tests.support.rig_frames import ticks_of
from tests.support.scripted_link import ScriptedLink
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.core.configuration import Config, RecorderConfig
from wrcd.core.core import Core
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.recorder.recorder import Recorder
from wrcd.recorder.state import capture, encode, restore
from wrcd.service.loop import Daemon

THIRD_PARTY = Path(__file__).parents[2] / "data/dbc/third-party.toml"
OWN_STATUS = """
dbc = { file = "own.dbc" }
wheelset = { name = "multiple-unit" }
limits = { constant_speed_m_s = 25.0 }
[[axle]]
number = 1
yaw_rate = { signal = "Imu.Turn", status = "Health.Imu", ok = [3], degraded = [4] }
lateral_acceleration = "Imu.Side"
torque = [ "Effort.Motor", { signal = "Effort.Brake", sign = -1 } ]
adhesion = { message = "Out", mu_available = { signal = "Friction", not_available = 255 }, validity = "State" }
"""
OWN_DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 513 Imu: 8 A
 SG_ Turn : 0|32@1- (0.000001,0) [-20|20] "rad/s" A
 SG_ Side : 32|32@1- (0.00001,0) [-200|200] "m/s2" A
BO_ 514 Health: 1 A
 SG_ Imu : 0|4@1+ (1,0) [0|15] "" A
BO_ 530 Effort: 4 A
 SG_ Motor : 0|16@1- (0.002,0) [-60|60] "kNm" A
 SG_ Brake : 16|16@1+ (0.002,0) [0|60] "kNm" A
BO_ 768 Out: 2 A
 SG_ Friction : 0|8@1+ (0.5,0) [0|100] "%" A
 SG_ State : 8|2@1+ (1,0) [0|3] "" A
VAL_ 768 State 0 "NotAvailable" 1 "Valid" 2 "Degraded" ;
"""


@pytest.fixture
def own(tmp_path: Path) -> Config:
    (tmp_path / "own.dbc").write_text(OWN_DBC)
    (tmp_path / "own.toml").write_text(OWN_STATUS)
    return load_config(tmp_path / "own.toml")


def test_dump_with_fd_frames_replays_to_what_was_sent(tmp_path: Path) -> None:
    config = load_config(THIRD_PARTY)
    core, link, said = Core(config), ScriptedLink(), list[str]()
    now = 0
    recorder = Recorder(RecorderConfig(tmp_path, 2.0, 20, 200.0), core, "vcan0", said.append)
    daemon = Daemon(core, link, clock=lambda: now, steady=lambda: now, recorder=recorder)
    for tick in ticks_of(config, 3.5):
        link.waiting += tick
        now = tick[0].stamp_us // 5_000 * 5_000 + 6_000
        daemon.turn()
    recorder.close(now)
    (log,) = tmp_path.glob("*-exit.log")
    assert main(["replay", str(log), "--config", str(THIRD_PARTY), "-o", str(tmp_path / "out.log")]) == 0
    own = {f.key for f in link.sent}
    recorded = [f for f, _ in read_log(log, Damage())]
    assert {len(f.data) for f in recorded if f.fd} == {12}
    sent = [f for f in recorded if f.key in own]
    assert [f for f, _ in read_log(tmp_path / "out.log", Damage())] == sent
    assert len(sent) > 100


@pytest.mark.parametrize("at", [1, 399, 400, 403])
def test_restored_core_goes_on_with_status_and_parts(own: Config, at: int) -> None:
    core, again = Core(own), Core(own)
    ticks = ticks_of(own, 3.0)
    for k, tick in enumerate(ticks):
        for f in tick:
            if f.can_id == 514:
                f.data = b"\4" if 300 <= k < 500 else b"\3"
    fed = [f for tick in ticks[:at] for f in tick]
    for f in fed:
        core.feed(f)
    restore(again, json.loads(json.dumps(encode(capture(core)), allow_nan=False)))
    # the status does not come again for some time: what is known of it is part of the state
    rest = [f for k, tick in enumerate(ticks[at:]) for f in tick if k > 15 or f.can_id != 514]
    sent = [[o.frame for f in rest for o in c.feed(f)] for c in (core, again)]
    assert sent[0] == sent[1]
    assert encode(capture(core)) == encode(capture(again))
    assert core.counts.rejected == again.counts.rejected == {"status": 1}  # the first frame came before its status
