"""Makes docs/monitor.svg: python -m tests.support.monitor_picture [FILE]. A ride is played, and the screen saved."""

import asyncio
import os
import sys
import tempfile
import time
from pathlib import Path

from sim_ecu import resources as rig
from sim_ecu.cli import main as sim_ecu
from wrcd.bus.dbc import load_dbc
from wrcd.config import load_config
from wrcd.tools.monitor.of_log import model_of_log
from wrcd.tools.monitor.screen.app import Monitor
from wrcd.tools.monitor.snapshot import without_fonts
from wrcd.tools.monitor.sources import NoMore

PICTURE = Path(__file__).parents[2] / "docs" / "monitor.svg"
SIZE = (110, 34)
MAX_BYTES = 300_000
# Four axles, one behind the other, over 150 m of leaf film.
RIDE = """
title = "four axles over 150 m of leaf film, under steady traction"
duration_s = 24.0
speed_m_s = 25.0
axles = [1, 2, 3, 4]

[[rail]]
curve = "A"
[[rail]]
from_m = 225.0
curve = "F"
[[rail]]
from_m = 375.0
curve = "A"

[drive]
torque_N_m = [[0.0, 0.0], [1.5, 19000.0]]

[axle.4]
rail = [{ curve = "C" }]
"""


def picture(folder: Path) -> str:
    """The screen at the first fall."""
    scenario, log = folder / "leaves.toml", folder / "leaves.log"
    scenario.write_text(RIDE)
    if sim_ecu(["play", str(scenario), "--fast", "--log", str(log)]):
        raise RuntimeError("the ride could not be played")
    model, _ = model_of_log(log, load_config(None), [load_dbc(rig.TRUTH_DBC)], None, 500_000)
    app = Monitor(model, NoMore(log.name), colours="dark", ticking=False)

    async def shown() -> str:
        async with app.run_test(size=SIZE) as pilot:
            await pilot.press("right", "right", "right", "right")
            await pilot.pause()
            return app.export_screenshot(title="wrcd monitor leaves.log --dbc dbc/sim_ecu.dbc")

    return without_fonts(asyncio.run(shown()))


def main(arguments: list[str]) -> int:
    """Write the picture."""
    os.environ["TZ"] = "UTC"
    time.tzset()
    os.environ.pop("NO_COLOR", None)
    target = Path(arguments[0]) if arguments else PICTURE
    with tempfile.TemporaryDirectory() as folder:
        svg = picture(Path(folder))
    if len(svg.encode()) > MAX_BYTES:
        raise RuntimeError(f"{len(svg.encode())} bytes are too many for a page")
    target.write_text(svg, encoding="utf-8")
    print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
