"""vcan: `make vcan -- COMMAND`, a bus on a machine that has none, in a terminal as a user has it."""

import re

from tests.walk.terminal import Terminal
from tests.walk.walk import Step, Walk, expect

BOOT_S = 60.0
BOTH = """wrcd run -i socketcan -c vcan0 2>daemon.txt & daemon=$!
wrcd dump -i socketcan -c vcan0 >frames.txt & dump=$!
sleep 2
sim-ecu play wet.toml -c vcan0 --ahead >rig.txt
kill $daemon $dump
wait
"""
WET = """duration_s = 3
rail = [{ curve = "C" }]
drive = { creep_of_peak = [[0, 0], [1, 0.8]] }
"""


def take(walk: Walk) -> str:
    """Rig and daemon on vcan0 by a script; then a shell, and in it a command that Ctrl-C ends."""
    (walk.folder / "both.sh").write_text(BOTH)
    (walk.folder / "wet.toml").write_text(WET)
    walk.sim_ecu("play", "wet.toml", "--fast", "--log", "wet.log")  # compiles the wheelset: in there it takes a minute
    with Terminal(walk, "vcan") as terminal:
        terminal.type("make vcan -- sh both.sh; echo status $?")
        terminal.wait_for("the end of both.sh", lambda s: "status 0" in s, BOOT_S)
        text = (walk.folder / "frames.txt").read_text()
        valid = len(re.findall(r" 091#.*Validity: Valid", text))
        expect(valid > 50, f"{valid} Valid frames of axle 1 among {len(text.splitlines())} frames")
        terminal.type("clear; make vcan")
        terminal.wait_for("the guest's prompt", lambda s: "vcan /" in s, BOOT_S)
        terminal.type("cd /sys/class/net; echo *; cd -; stty size; wrcd dump -i socketcan -c vcan1; echo ended")
        terminal.wait_for("the buses, and the size", lambda s: "lo vcan0 vcan1" in s and "30 100" in s, 10)
        terminal.press("C-c")
        terminal.type("exit 7")
        terminal.type("echo status $?")
        terminal.wait_for("the end of the guest", lambda s: "status 2" in s, 20)
        terminal.keep()
    frames = len(text.splitlines())
    return f"{frames} frames on vcan0, {valid} of them Valid adhesion of axle 1; a shell at a terminal, ended by Ctrl-C"


STEP = Step("vcan", take, (("tmux", "tmux"), ("make", "make")))
