"""`wrcd monitor` of a bus that is half full: no frame is lost, and none is sent."""

import html
import re
import sys
import time
from pathlib import Path
from select import select

import pytest

from tests.support.can_socket import CHANNEL, FRAME, pair
from tests.support.daemon_frames import GOOD, START_US, DaemonFrames
from tests.support.on_terminal import OnTerminal
from tests.support.processes import ROOT, wait_for
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

SECONDS, TURN_S = 2, 0.01
PER_TURN = 20  # frames: half of what a bus of 500 kbit/s carries
UNMAPPED_ID = 0x300
WAIT_S = 60
# its reader is a process of its own, as ever
MONITOR = """
import os, sys
from functools import partialmethod
from wrcd.cli.main import main
from wrcd.monitor.sources import ReaderProcess
on_pair = {"module": "tests.support.reader_on_pair", "files": (int(os.environ["END"]),)}
ReaderProcess.__init__ = partialmethod(ReaderProcess.__init__, **on_pair)
sys.exit(main(sys.argv[1:]))
"""


def traffic(config: Config) -> list[list[bytes]]:
    """What a daemon says of four axles, and numbered frames of an id that nobody knows, by turns."""
    turns: list[list[bytes]] = [[] for _ in range(round(SECONDS / TURN_S))]
    for f in DaemonFrames(config).stretch(0, SECONDS * 1_000_000, GOOD, axles=range(4)):
        turns[int((f.stamp_us - START_US) / 1e6 / TURN_S)].append(packed(f))
    number = 0
    for turn in turns:
        while len(turn) < PER_TURN:
            turn.append(packed(Frame(0, UNMAPPED_ID, number.to_bytes(8, "big"))))
            number += 1
    return turns


def packed(f: Frame) -> bytes:
    return FRAME.pack(f.can_id, len(f.data), f.data.ljust(8, b"\0"))


def test_no_frame_is_lost_and_none_is_sent(config: Config, tmp_path: Path) -> None:
    """What it saves afterwards is every frame that was on the bus, in order; the bus has carried no other."""
    turns, (inside, bus) = traffic(config), pair()
    bus.setblocking(False)
    end = inside.fileno()
    command = [sys.executable, "-c", MONITOR, "monitor", "-i", "socketcan", "-c", CHANNEL]
    app = OnTerminal(command, {"PYTHONPATH": str(ROOT), "END": str(end)}, tmp_path, pass_fds=(end,))
    try:
        app.wait_for(b"no Adhesion frame", WAIT_S)
        for turn in turns:
            time.sleep(TURN_S)
            wait_for("the reader", WAIT_S, lambda: not select([inside], [], [], 0)[0])  # a bus whose kernel holds all
            for data in turn:
                bus.send(data)
        before = len(app.seen)
        wait_for("silence, after the last frame", WAIT_S, lambda: b"no Adhesion frame for" in app.seen[before:])
        assert b"30.0 %" in app.seen  # while they came
        app.press(b"s")
        app.wait_for(b"saved wrcd-monitor", WAIT_S)
        app.press(b"q")
        assert app.process.wait(WAIT_S) == 0
        (log,) = tmp_path.glob(f"wrcd-monitor-{CHANNEL}-*.log")
        held = [packed(f) for f, _ in read_log(log, Damage())]
        assert held == [data for turn in turns for data in turn]
        (picture,) = tmp_path.glob(f"wrcd-monitor-{CHANNEL}-*.svg")
        drawn = html.unescape(picture.read_text()).replace("\xa0", " ")
        assert re.findall(r"lost +\d+", drawn) == ["lost 0"]
        with pytest.raises(BlockingIOError):
            bus.recv(64)
    finally:
        app.close()
        inside.close()
        bus.close()
