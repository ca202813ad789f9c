"""`wrcd monitor` on a real kernel's bus: its own terminal, a bus that carries what the guest bears."""

import html
import re
import socket
import sys
import time
from pathlib import Path

import pytest

from tests.support.daemon_frames import GOOD, START_US, DaemonFrames
from tests.support.on_terminal import OnTerminal
from tests.support.processes import ROOT
from wrcd.bus.frame import Frame
from wrcd.bus.rawcan import FRAME
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

SECONDS = 6
RATE = 2000  # frames a second: a bus of 500 kbit/s that is half full; with more the guest itself cannot keep time
TURN_S = 0.01
UNMAPPED_ID = 0x300


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config(None)


def traffic(config: Config) -> list[list[bytes]]:
    """What a daemon says of four axles, and numbered frames of an id that nobody knows, by turns."""
    made = DaemonFrames(config).stretch(0, SECONDS * 1_000_000, GOOD, axles=range(4))
    turns: list[list[bytes]] = [[] for _ in range(round(SECONDS / TURN_S))]
    for f in made:
        turns[int((f.stamp_us - START_US) / 1e6 / TURN_S)].append(packed(f))
    number = 0
    for turn in turns:
        while len(turn) < RATE * TURN_S:
            turn.append(packed(Frame(0, UNMAPPED_ID, number.to_bytes(8, "big"))))
            number += 1
    return turns


def packed(f: Frame) -> bytes:
    return FRAME.pack(f.can_id, len(f.data), f.data.ljust(8, b"\0"))


def send(channel: str, turns: list[list[bytes]]) -> float:
    """Send in real time. Returns how long it took."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as s:
        s.bind((channel,))
        begin = time.monotonic()
        for number, turn in enumerate(turns):
            time.sleep(max(begin + number * TURN_S - time.monotonic(), 0.0))
            for data in turn:
                s.send(data)
        return time.monotonic() - begin


def carried(channel: str) -> int:
    """Frames that an interface has carried."""
    return int(Path(f"/sys/class/net/{channel}/statistics/tx_packets").read_text())


COMMAND = (sys.executable, "-m", "wrcd.cli", "monitor")


def test_no_frame_is_lost_and_none_is_sent(bus: str, config: Config, tmp_path: Path) -> None:
    """What it saves afterwards is every frame that was on the bus, in order; the bus has carried no other."""
    turns = traffic(config)
    app = OnTerminal([*COMMAND, "-i", "socketcan", "-c", bus], {"PYTHONPATH": str(ROOT)}, tmp_path)
    try:
        app.wait_for(b"no Adhesion frame", 60)
        before = carried(bus)
        took = send(bus, turns)
        time.sleep(1.0)
        app.press(b"s")
        app.wait_for(b"saved wrcd-monitor", 60)
        app.press(b"q")
        assert app.process.wait(30) == 0
        sent = [data for turn in turns for data in turn]
        (log,) = tmp_path.glob(f"wrcd-monitor-{bus}-*.log")
        held = [packed(f) for f, _ in read_log(log, Damage())]
        print(f"\n{len(sent) / took:.0f} frames/s for {took:.1f} s: {len(sent) - len(held)} of {len(sent)} lost, "
              f"{len(app.seen) / took / 1000:.1f} kB/s to the terminal")  # fmt: skip
        assert held == sent
        assert carried(bus) - before == len(sent)
        (picture,) = tmp_path.glob(f"wrcd-monitor-{bus}-*.svg")
        drawn = html.unescape(picture.read_text()).replace("\xa0", " ")  # after the last frame, as the log is
        assert re.findall(r"lost +\d+", drawn) == ["lost 0"]
        assert b"30.0 %" in app.seen  # while they came: the picture is of a second of silence
    finally:
        app.close()
