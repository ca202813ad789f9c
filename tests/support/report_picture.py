"""Makes docs/report.png: python -m tests.support.report_picture [FILE]. Plays a ride, opens its report at the fall."""

import io
import os
from pathlib import Path

from PIL import Image

from sim_ecu import resources as rig
from sim_ecu.cli import main as sim_ecu
from tests.browser.chromium import chromium, opened
from tests.browser.reading import settle
from tests.support.demo_picture import write
from wrcd.bus.dbc import load_dbc
from wrcd.config import load_packaged
from wrcd.tools.report import page
from wrcd.tools.story.gather import gather

PICTURE = Path(__file__).parents[2] / "docs" / "report.png"
WIDTH, HEIGHT = 1240, 980
COLOURS = 128
MAX_BYTES = 300_000


def picture(folder: Path) -> bytes:
    """The report of the scenario leaf-patch where adhesion falls, as PNG."""
    log = Path("leaf-patch.log")  # in the folder: the page shows the name that it was given
    before = Path.cwd()
    os.chdir(folder)
    try:
        if sim_ecu(["play", "leaf-patch", "--fast", "--log", str(log)]):
            raise RuntimeError("the ride could not be played")
        page.write(gather(log, load_packaged(1), [load_dbc(rig.TRUTH_DBC)]), None, Path("report.html"))
    finally:
        os.chdir(before)
    with chromium() as browser, opened(browser, folder / "report.html", WIDTH, HEIGHT) as found:
        found.page.locator("button.fall").first.click()
        settle(found.page)
        found.page.evaluate("document.querySelector('#axle1').scrollIntoView()")
        settle(found.page)
        whole = Image.open(io.BytesIO(found.page.screenshot()))
        if found.complaints:
            raise RuntimeError("; ".join(found.complaints))
    out = io.BytesIO()
    whole.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    data = out.getvalue()
    if len(data) > MAX_BYTES:
        raise RuntimeError(f"{len(data)} bytes are more than {MAX_BYTES}")
    return data


if __name__ == "__main__":
    write(picture, PICTURE)
