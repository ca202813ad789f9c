"""`wrcd monitor` on a bus between processes: no frame is lost, and none is sent."""

import html
import os
import re
import time
from pathlib import Path

from tests.support.daemon_frames import GOOD, START_US, DaemonFrames
from tests.support.on_terminal import OnTerminal
from tests.support.own_network import own_network
from tests.support.processes import BIN, ROOT, wait_for
from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

SECONDS, TURN_US = 2, 10_000
PER_TURN = 10  # frames
UNMAPPED_ID = 0x300
WAIT_S = 60
# the player begins when the monitor is there; the logger tells what else was on the bus
SCRIPT = """
env --default-signal=INT python -m can.logger {bus} -f bus.log >/dev/null 2>&1 & logs=$!
(until [ -e go ]; do sleep .1; done; python -m can.player {bus} in.log >/dev/null 2>&1; touch played) &
wrcd monitor {bus}; status=$?
kill -INT $logs
wait
exit $status
"""


def traffic(config: Config) -> list[Frame]:
    """What a daemon says of four axles, and numbered frames of an id that nobody knows."""
    said = DaemonFrames(config).stretch(0, SECONDS * 1_000_000, GOOD, axles=range(4))
    places = range(len(said), SECONDS * 1_000_000 // TURN_US * PER_TURN)
    turns = [START_US + k * TURN_US // PER_TURN for k in places]
    others = [Frame(at_us, UNMAPPED_ID, k.to_bytes(8, "big")) for k, at_us in zip(places, turns, strict=True)]
    return sorted([*said, *others], key=lambda f: f.stamp_us)


def test_no_frame_is_lost_and_none_is_sent(config: Config, tmp_path: Path) -> None:
    """What it saves afterwards is every frame that was on the bus, in order; the bus has carried no other."""
    prefix, bus = own_network()
    sent = traffic(config)
    (tmp_path / "in.log").write_text("".join(format_line(f, "can0") + "\n" for f in sent))
    environment = {"PYTHONPATH": str(ROOT), "PATH": f"{BIN}:{os.environ['PATH']}"}
    app = OnTerminal([*prefix, "bash", "-c", SCRIPT.format(bus=bus)], environment, tmp_path)
    try:
        app.wait_for(b"no Adhesion frame", WAIT_S)
        (tmp_path / "go").touch()
        wait_for("the player", WAIT_S, (tmp_path / "played").exists)
        time.sleep(1.0)  # until the monitor has read what has come
        app.press(b"s")
        app.wait_for(b"saved wrcd-monitor", WAIT_S)
        app.press(b"q")
        assert app.process.wait(WAIT_S) == 0
        (log,) = tmp_path.glob("wrcd-monitor-*.log")
        on_bus, held = ([(f.can_id, f.data) for f, _ in read_log(x, Damage())] for x in (tmp_path / "bus.log", log))
        assert held == on_bus == [(f.can_id, f.data) for f in sent]
        (picture,) = tmp_path.glob("wrcd-monitor-*.svg")
        drawn = html.unescape(picture.read_text()).replace("\xa0", " ")
        assert re.findall(r"lost +\d+", drawn) == ["lost 0"]
    finally:
        app.close()
