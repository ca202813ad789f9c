"""What the tools make of the demo's log: `wrcd monitor` in a terminal, `why` and `plot`, `report` in a browser.

Each key, and what a reader does on the page, is tried in tests/unit and tests/browser.
"""

import re
import shutil

from tests.browser.chromium import PATH, chromium, opened
from tests.walk.demo import png_size
from tests.walk.terminal import Terminal
from tests.walk.walk import Step, Walk, expect, played

START_S = 30.0  # textual and numpy are loaded by a cold interpreter
KEY_S = 20.0  # of a busy machine; how fast it is, is measured elsewhere
KEYS, CLOSES = "q quit", "Esc closes"
FALL_S = "9.3"  # the leaf film begins at 9 s
MAX_MB = 10.0


def monitor(walk: Walk) -> str:
    """Open it at 100 × 30; why, save, 80 × 24, quit."""
    with Terminal(walk, "monitor") as t:
        t.type(f"clear; .venv/bin/wrcd monitor {played(walk)} --dbc dbc/sim_ecu.dbc; echo status $?")
        t.wait_for("axle 1's estimate beside the truth", _has_axle_1, START_S)
        t.keep()
        t.press("w")
        t.wait_for("why, by w", lambda s: CLOSES in s and "residual" in s and "rule" in s, KEY_S)
        t.keep("-why")
        t.press("Escape")
        t.wait_for("the plot again", lambda s: CLOSES not in s, KEY_S)
        t.resize(80, 24)
        small = t.wait_for("the keys in 80 × 24", _has_axle_1, KEY_S)
        t.keep("-80x24")
        expect(max(map(len, small.splitlines())) <= 80, "a line is longer than 80 columns")
        t.press("q")
        t.wait_for("the end by q", lambda s: "status 0" in s, KEY_S)
    return "axle 1 with truth, why told, 80 × 24 too"


def _has_axle_1(screen: str) -> bool:
    """Whether the keys are there, and the table has axle 1 with a state and a value."""
    return all((KEYS in screen, "truth" in screen, re.search(r"1 \S (Valid|Degraded) +\d+\.\d %", screen)))


def why(walk: Walk) -> str:
    """wrcd why, wrcd report --png."""
    log = played(walk)
    said = walk.wrcd("why", log, FALL_S)
    (walk.out / "why.txt").write_text(said)
    change = next((line for line in said.splitlines() if "fell from" in line), None)
    expect(change is not None, f"no fall is told:\n{said}")
    expect("rule" in said and "residual" in said, f"neither rule nor residual is told:\n{said}")
    picture = walk.folder / "fall.png"
    walk.wrcd("report", log, "--png", picture.name, "--from", "7", "--to", "12")
    width, height = png_size(picture)
    shutil.copy(picture, walk.out / "plot.png")
    return f"{' '.join((change or '').split())}; picture {width} × {height}"


def report(walk: Walk) -> str:
    """Write the report, open it wide, narrow and dark, take its pictures."""
    walk.wrcd("report", played(walk), "-o", "report.html")
    path = walk.folder / "report.html"
    size_mb = path.stat().st_size / 1e6
    expect(size_mb <= MAX_MB, f"report.html has {size_mb:.1f} MB")
    with chromium() as browser:
        for name, width, scheme in (("report-1200", 1200, "light"), ("report-400", 400, "dark")):
            with opened(browser, path, width, scheme=scheme) as found:  # type: ignore[arg-type]  # a word of the two
                verdict = found.page.inner_text(".findings").strip()
                expect(len(verdict) > 20, f"the verdict is {verdict!r}")
                wide = found.page.evaluate("document.documentElement.scrollWidth")
                expect(wide <= width, f"in a window of {width} px the page has {wide} px")
                found.page.screenshot(path=walk.out / f"{name}.png", full_page=True)
                expect(not found.complaints, "the page complains:\n" + "\n".join(found.complaints))
    return f"{size_mb:.1f} MB, no complaint; 1200 px wide, and 400 px in the dark"


STEPS = [
    Step("monitor", monitor, (("tmux", "tmux"),)),
    Step("why", why),
    Step("report", report, ((PATH, "chromium"),)),
]
