"""Makes docs/leaf-patch.png, docs/monitor.svg and docs/report.png, or those that are named, from rides played for them.

python -m tests.support.pictures [NAME...]
"""

import asyncio
import contextlib
import io
import os
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from sim_ecu import resources as rig
from sim_ecu.cli.main import main as sim_ecu
from sim_ecu.play import demo
from tests.support.chromium import chromium, opened
from wrcd.bus.dbc import load_dbc
from wrcd.config.config import load_config, load_packaged
from wrcd.logs.story import gather
from wrcd.monitor.screen import Monitor, without_fonts
from wrcd.monitor.sources import NoMore, model_of_log
from wrcd.report import report_page

DOCS = Path(__file__).parents[2] / "docs"
TERMINAL, WINDOW, COLOURS = (110, 34), (1240, 980), 128
MAX_BYTES = 300_000
FOUR_AXLES = """
title = "four axles over 150 m of leaf film, under steady traction"
duration_s = 24.0
speed_m_s = 25.0
axles = [1, 2, 3, 4]
rail = [{ curve = "A" }, { from_m = 225.0, curve = "F" }, { from_m = 375.0, curve = "A" }]
drive = { torque_N_m = [[0.0, 0.0], [1.5, 19000.0]] }
[axle.4]
rail = [{ curve = "C" }]
"""


def play(scenario: str | Path, log: str) -> Path:
    """Play a scenario into a log in this folder: pictures show the name that it was given."""
    if sim_ecu(["play", str(scenario), "--fast", "--log", log]):
        raise RuntimeError("the ride could not be played")
    return Path(log)


def of_the_demo() -> bytes:
    """What the demo draws of its own run on python-can's virtual bus, whose time waits for a busy computer."""
    if demo.run("virtual", "picture", "leaf-patch", Path()):
        raise RuntimeError("the demo saw no valid estimate")
    return Path("leaf-patch.png").read_bytes()


def of_the_monitor() -> bytes:
    """The screen at the first fall."""
    Path("leaves.toml").write_text(FOUR_AXLES)
    log = play("leaves.toml", "leaves.log")
    model, _ = model_of_log(log, load_config(None), [load_dbc(rig.TRUTH_DBC)], None, 500_000)
    app = Monitor(model, NoMore(log.name), colours="dark", ticking=False)

    async def shown() -> str:
        async with app.run_test(size=TERMINAL) as pilot:
            await pilot.press("right", "right", "right", "right")
            await pilot.pause()
            return app.export_screenshot(title="wrcd monitor leaves.log")

    return without_fonts(asyncio.run(shown())).encode()


def of_the_report() -> bytes:
    """The report of the scenario leaf-patch where adhesion falls."""
    log = play("leaf-patch", "leaf-patch.log")
    report_page.write(gather(log, load_packaged(1), [load_dbc(rig.TRUTH_DBC)]), None, Path("report.html"))
    with chromium() as browser, opened(browser, Path("report.html"), *WINDOW) as found:
        found.page.locator("button.fall").first.click()
        found.settle()
        found.page.evaluate("document.querySelector('#axle1').scrollIntoView()")
        found.settle()
        whole = Image.open(io.BytesIO(found.page.screenshot()))
        if found.complaints:
            raise RuntimeError("; ".join(found.complaints))
    out = io.BytesIO()
    whole.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()


PICTURES = {"leaf-patch.png": of_the_demo, "monitor.svg": of_the_monitor, "report.png": of_the_report}


def main(names: list[str]) -> None:
    """Write the pictures that are named, or all."""
    os.environ["TZ"] = "UTC"
    time.tzset()
    os.environ.pop("NO_COLOR", None)
    for name in names or PICTURES:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            data = PICTURES[name]()
        if len(data) > MAX_BYTES:
            raise RuntimeError(f"{name}: {len(data)} bytes are more than {MAX_BYTES}")
        (DOCS / name).write_bytes(data)
        print(f"{DOCS / name}: {len(data)} bytes")


if __name__ == "__main__":
    main(sys.argv[1:])
