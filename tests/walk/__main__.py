"""Take the walk, or the clone and the named steps of it: python -m tests.walk [STEP...]."""

import argparse
import sys
import tempfile
from pathlib import Path

from tests.walk import clone, demo, demo_log, own_dbc, vcan
from tests.walk.walk import OUT, Step, Walk, take

STEPS = [clone.STEP, demo.STEP, *demo_log.STEPS, own_dbc.STEP, vcan.STEP]


def chosen(names: list[str]) -> list[Step]:
    """The first step, and those named; all where none is."""
    return [STEPS[0]] + [s for s in STEPS[1:] if not names or s.name in names]


def main() -> int:
    """Walk in a temporary folder, which is gone afterwards."""
    parser = argparse.ArgumentParser(prog="python -m tests.walk", description=__doc__)
    parser.add_argument("step", nargs="*", choices=[[], *(s.name for s in STEPS)], metavar="STEP")
    names = parser.parse_args().step
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="walk.") as folder:
        return take(chosen(names), Walk(Path(folder) / "wrcd"))


if __name__ == "__main__":
    sys.exit(main())
