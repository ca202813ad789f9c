"""docs/mark.png, the first picture of `sim-ecu mark`; and its page and figures in build. Half an hour on two cores."""

import sys
from pathlib import Path

from sim_ecu.cli.main import main

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "mark.png"

if __name__ == "__main__":
    build = ROOT / "build"
    build.mkdir(exist_ok=True)
    sys.exit(main(["mark", "--json", f"{build}/mark.json", "--html", f"{build}/mark.html", "--png", str(PICTURE)]))
