"""Monitor: `wrcd monitor` of the demo's log in a terminal: keys pressed, the screen read as a user reads it."""

import re
import shutil
import xml.etree.ElementTree as ET

from tests.walk.terminal import Terminal
from tests.walk.walk import Step, Walk, expect, played

START_S = 30.0  # textual and numpy are loaded by a cold interpreter
KEY_S = 20.0  # of a busy machine; how fast it is, is measured elsewhere
KEYS, CLOSES = "q quit", "Esc closes"
MOMENT = re.compile(r"(\d+\.\d) s +\d\d:\d\d:\d\d")


def take(walk: Walk) -> str:
    """Open it at 100 × 30; events, why, zoom, save, 80 × 24, quit."""
    log = played(walk)
    before = set(walk.folder.iterdir())
    with Terminal(walk, "monitor") as t:
        t.type(f"clear; .venv/bin/wrcd monitor {log} --dbc dbc/sim_ecu.dbc; echo status $?")
        t.wait_for("the monitor", lambda s: KEYS in s and MOMENT.search(s) is not None, START_S)
        screen = t.wait_for("axle 1's estimate beside the truth", _has_axle_1, KEY_S)
        t.keep()
        first = _moment(screen)
        t.press("p")
        second = _moment(t.wait_for("another event by p", lambda s: _moment(s) not in ("", first), KEY_S))
        t.press("n")
        t.wait_for("the first again by n", lambda s: _moment(s) == first, KEY_S)
        width = _width(screen)
        t.press("+")
        zoomed = _width(t.wait_for("a narrower plot by +", lambda s: _width(s) not in ("", width), KEY_S))
        t.press("w")
        t.wait_for("why, by w", lambda s: CLOSES in s and "residual" in s and "rule" in s, KEY_S)
        t.keep("-why")
        t.press("Escape")
        t.wait_for("the plot again", lambda s: CLOSES not in s, KEY_S)
        t.press("s")
        t.wait_for(
            "the picture that is saved, by s", lambda s: re.search(r"saved \S+\.log .* and \.svg", s) is not None, KEY_S
        )
        t.resize(80, 24)
        small = t.wait_for("the keys in 80 × 24", lambda s: KEYS in s and _has_axle_1(s), KEY_S)
        t.keep("-80x24")
        expect(max(map(len, small.splitlines())) <= 80, "a line is longer than 80 columns")
        t.press("q")
        t.wait_for("the end by q", lambda s: "status 0" in s, KEY_S)
    pictures = [path for path in set(walk.folder.iterdir()) - before if path.suffix == ".svg"]
    expect(len(pictures) == 1, f"saved were {pictures}")
    expect(ET.parse(pictures[0]).getroot().tag.endswith("svg"), f"{pictures[0].name} is no picture")
    shutil.copy(pictures[0], walk.out / "monitor.svg")
    return (
        f"axle 1 with truth at {first} s and {second} s, {width} and {zoomed} wide, why told, a picture saved, "
        "80 × 24 too"
    )


def _has_axle_1(screen: str) -> bool:
    """Whether the table has axle 1 with a state and a value."""
    return re.search(r"1 \S (Valid|Degraded) +\d+\.\d %", screen) is not None and "truth" in screen


def _moment(screen: str) -> str:
    """The seconds that the head of the screen tells, of the cursor or of the newest."""
    found = MOMENT.search(screen)
    return found[1] if found else ""


def _width(screen: str) -> str:
    """How much time the plot shows, in its own words."""
    found = re.search(r"([\d.]+ \S+) wide", screen)
    return found[1] if found else ""


STEP = Step("monitor", take, (("tmux", "tmux"),))
