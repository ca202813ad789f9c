"""vcan: `make vcan -- COMMAND`, a bus on a machine that has none, in a terminal as a user has it."""

import re
import time
from collections.abc import Callable

from tests.support.page_commands import run_by
from tests.walk.terminal import Terminal
from tests.walk.walk import Step, Walk, expect

BOOT_S = 60.0
PLAY_S = BOOT_S + 60.0  # 24 s of them play
SCRIPT = """candump -L vcan0 >sent.log & dump=$!
wrcd run -i socketcan -c vcan0 2>daemon.txt & daemon=$!
until grep -q 091# sent.log; do sleep .2; done
canplayer vcan0=can0 -I wet.log
kill $daemon
wait $daemon
kill $dump
"""
WET = """duration_s = 3
rail = [{ curve = "C" }]
drive = { creep_of_peak = [[0, 0], [1, 0.8]] }
"""


def take(walk: Walk) -> str:
    """A log played by a script, with can-utils; a shell, and in it a command that Ctrl-C ends; the page's commands."""
    (walk.folder / "play.sh").write_text(SCRIPT)
    (walk.folder / "wet.toml").write_text(WET)
    walk.sim_ecu("play", "wet.toml", "--fast", "--log", "wet.log")
    log = walk.folder / "wet.log"
    log.write_text(re.sub(r"(?m) R$", "", log.read_text()))  # canplayer takes no direction
    with Terminal(walk, "vcan") as terminal:
        terminal.type("make vcan -- sh play.sh; echo status $?")
        terminal.wait_for("the end of play.sh", lambda s: "status 0" in s, BOOT_S)
        said = walk.wrcd("dump", "sent.log").splitlines()
        made = sum("Adhesion_A1" in line for line in said)
        valid = sum("Adhesion_A1" in line and "Validity: Valid" in line for line in said)
        # How many are Valid is a matter of time, which a guest on a busy machine does not have: shown, not judged.
        expect(made >= 10, f"{made} frames of adhesion among {len(said)} frames")
        terminal.type("clear; make vcan")
        terminal.wait_for("the guest's prompt", lambda s: "vcan /" in s, BOOT_S)
        terminal.type("cd /sys/class/net; echo *; cd -; stty size; wrcd dump -i socketcan -c vcan1; echo ended")
        terminal.wait_for("the buses, and the size", lambda s: "lo vcan0 vcan1" in s and "30 100" in s, 10)
        time.sleep(1)  # dump is silent until something comes
        terminal.press("C-c")
        terminal.wait_for("the prompt after Ctrl-C", lambda s: s.rstrip().endswith("#"), 20)
        terminal.type("exit 7")
        terminal.wait_for("the end of the guest, and its status", lambda s: "Error 7\n$" in s, 20)
        terminal.keep()
        lines = take_page(terminal)
    return (
        f"{len(said)} frames on vcan0, {made} of them adhesion of axle 1 and {valid} Valid; a shell at a terminal, "
        f"Ctrl-C ends what runs in it; the page's {lines} lines as they stand there"
    )


def take_page(terminal: Terminal) -> int:
    """Type every command of the page; its last block is that of the shell. Returns how many."""
    *single, shell = [s.commands for s in run_by("tests/walk/vcan.py", "docs/how-to/without-can.md")]
    terminal.type("PATH=.venv/bin:$PATH")
    commands = [c for block in single for c in block]
    for number, command in enumerate(commands, start=1):
        ended = re.compile(rf"status (\d+) of {number}\b")  # not that of the one before, which may still stand there
        terminal.type(f"clear; {command}; echo status $? of {number}")
        screen = terminal.wait_for(f"the end of `{command}`", _has(ended), PLAY_S)
        expect(f"status 0 of {number}" in screen, f"`{command}` says\n{screen}")
    terminal.type(f"clear; {shell[0]}")
    terminal.wait_for("the guest's prompt", lambda s: "vcan /" in s, BOOT_S)
    for command in shell[1:]:
        terminal.type(command)
    terminal.wait_for("frames of the daemon by candump", lambda s: " 091 " in s, BOOT_S)
    terminal.press("C-c")
    terminal.wait_for("the prompt after Ctrl-C", lambda s: s.rstrip().endswith("#"), 20)
    terminal.type("exit")
    terminal.wait_for("the end of the guest", lambda s: s.endswith("\n$") or s.rstrip().endswith("\n$"), 20)
    return len(commands) + len(shell)


def _has(pattern: re.Pattern[str]) -> Callable[[str], bool]:
    return lambda screen: pattern.search(screen) is not None


STEP = Step("vcan", take, (("tmux", "tmux"), ("make", "make")), on_vcan=True)
